//! The control interface of a service: HTTP/1.1 on a Unix socket, and on loopback where a machine file asks for it.
//!
//! | part | decides |
//! |---|---|
//! | [`settings`] | what `[control]` says |
//! | `server` | connections: how many, how long, how large |
//! | `guard` | who is heard: `Host`, `Origin`, tokens |
//! | `tls` | certificates, behind the feature of that name |
//! | [`Route`], `routes` | what a route is, and what is answered; [`mount!`] lets another crate answer too |
//! | `stage` | how a file becomes a graph that can take over, or all of its mistakes |
//! | `openapi`, `stream` | the description of it all, and what happens, for listeners |
//!
//! It runs on a thread of its own. What it asks of a service goes through [`ServiceHandle`](athermal_serve::service::ServiceHandle);
//! the engine thread does not notice.

#![cfg_attr(test, allow(clippy::unwrap_used))]

mod answer;
pub mod client;
mod commands;
mod control;
mod guard;
mod hub;
mod openapi;
mod reload;
mod route;
mod routes;
mod server;
pub mod settings;
mod shown;
mod stage;
mod stream;
#[cfg(feature = "tls")]
mod tls;
mod token;

pub use answer::Refused;
pub use openapi::openapi;
pub use reload::reload;
pub use route::{Answerer, Asked, Gives, Mounted, Reply, Route, SchemaOf, routes};

/// What macros of this crate make use of.
#[doc(hidden)]
pub mod __private {
    pub use inventory;
}

#[cfg(test)]
mod tests;

athermal_serve::register_companion!(settings::Control, "control");
