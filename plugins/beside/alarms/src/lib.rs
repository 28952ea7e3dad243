//! Alarms: what is raised, acknowledged and gone, and who is to know of it.
//!
//! | part | decides |
//! |---|---|
//! | [`settings`] | what `[alarms.NAME]` says |
//! | `alarm` | when an alarm is raised, and when it is gone |
//! | `book` | what changed, and which of it whom reached; kept over restarts |
//! | `receivers` | how each receiver is given it, in order, until it has it |
//! | `webhook` | a message to an address that is a secret |
//! | `asked`, `commands` | `/v1/alarms`, and `athermal alarm` |
//!
//! The control thread looks at ticks. All else has threads of its own, and no tick waits for it.

#![cfg_attr(test, allow(clippy::unwrap_used))]

mod alarm;
mod asked;
mod book;
mod commands;
mod receivers;
pub mod settings;
mod watch;
mod webhook;

pub use asked::{AlarmsNow, Change, Message};
