//! Each node in a graph of its own, stepped by the real engine.

#![allow(clippy::unwrap_used)]

mod compensate;
mod conformance;
mod health;
mod loss_and_settling;
mod machine;
mod remeasure;
mod safe_state;
mod stability;
mod uncorrected;
