//! The node in a graph of its own, stepped by the real engine, and the geometry beside it worked out in another way.

#![allow(clippy::unwrap_used)]

mod conformance;
mod oracle;
