//! The control interface of a service: HTTP/1.1 on a Unix socket, and on loopback where a machine file asks for it.
//!
//! | part | decides |
//! |---|---|
//! | [`settings`] | what `[control]` says |
//! | `server` | connections: how many, how long, how large |
//! | `guard` | who is heard: `Host`, `Origin`, token |
//! | `routes` | what is answered |
//! | `stage` | how a file becomes a graph that can take over, or all of its mistakes |
//! | `status`, `metrics`, `stream` | what is known of the service, for people, Prometheus and listeners |
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
mod metrics;
mod prediction_error;
mod reload;
mod routes;
mod server;
pub mod settings;
mod shown;
mod stage;
mod status;
mod stream;
mod token;
pub mod words;

pub use reload::reload;
pub use routes::{OPENAPI, ROUTES};

#[cfg(test)]
mod tests;

athermal_serve::register_companion!(settings::Control, "control");
