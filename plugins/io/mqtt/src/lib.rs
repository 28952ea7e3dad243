//! MQTT 3.1.1 and 5: messages of a broker as a source of a service, and its outputs as messages.
//!
//! | module | decides |
//! |---|---|
//! | [`broker`] | where a broker is, and how one logs in |
//! | [`client`] | one connection, of either version: will, topics, acknowledgements, for other crates too; no other module knows the crate that speaks the protocol |
//! | `subscriptions` | what is asked of a broker, until it has answered |
//! | `source`, `session` | all of it at work |
//! | `sink`, `publisher`, `outgoing` | outputs as messages, stored and sent again |
//!
//! What a message says, and what is missing of a topic, is decided in `athermal-messages`. How ticks are made of samples, and when rows leave, is decided in `athermal-serve`. The runtime of tokio is a matter of this crate:
//! one thread for each source and sink, which waits for nobody else.

#![cfg_attr(test, allow(clippy::unwrap_used))]

pub mod broker;
#[cfg(feature = "cli")]
mod browse;
pub mod client;
mod listen;
mod look;
mod outgoing;
mod publisher;
mod session;
mod sink;
mod source;
mod subscriptions;
#[cfg(feature = "tls")]
mod tls;
