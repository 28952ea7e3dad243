//! OPC UA: variables of a server as a source of a service, and its outputs as what is written into variables.
//!
//! | module | decides |
//! |---|---|
//! | `server` | where a server is, how one logs in, and how its messages are secured |
//! | `certificates` | which certificate is ours, and which of theirs are trusted |
//! | `link` | one session, on a connection that can be cut; no other module knows how the crate that speaks the protocol connects |
//! | `node` | how a node is named: by the URI of its namespace |
//! | `value` | what a value says |
//! | `subscription` | what is asked of a server, and in which order it answers |
//! | `source`, `session`, `look` | all of it at work |
//! | `sink` | outputs into variables |
//!
//! How ticks are made of samples, and when rows leave, is decided in `athermal-serve`. The runtime of tokio is a matter of this crate:
//! one thread for each source and sink, which waits for nobody else.

#![cfg_attr(test, allow(clippy::unwrap_used))]

#[cfg(feature = "cli")]
mod browse;
mod certificates;
mod link;
mod look;
mod node;
mod server;
mod session;
mod sink;
mod source;
mod subscription;
#[cfg(feature = "cli")]
mod trust;
mod value;
