//! A service fits anew from its own journal.
//!
//! | part | decides |
//! |---|---|
//! | [`settings`] | what `[retrain]` says, and when the process is started |
//! | [`sensors`] | whether the data of a fit are those of whole sensors |
//! | [`propose`] | whether a new fit is worth proposing |
//! | `commands` | `retrain`, which is that process, and `models` |
//!
//! The fit is made by a process of its own, so that one that is killed for its memory takes no correction with it. It stages what it
//! has made over the control interface of the service. There it runs in the shadow of what runs, on the same ticks, and takes over only
//! where `commit = true` lets it.

#![cfg_attr(test, allow(clippy::unwrap_used))]

mod commands;
pub mod propose;
pub mod sensors;
pub mod settings;
mod shelf;

#[cfg(test)]
mod tests;

athermal_serve::register_companion!(settings::Retrain, "retrain");
