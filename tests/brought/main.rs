//! Logs, scores and messages that users brought: what was wrong, or led nowhere, and others of its kind. No kind of node is registered
//! here, so that those linked are those shipped.

#![allow(clippy::unwrap_used)]

#[path = "../workbench/mod.rs"]
mod workbench;

mod ages;
mod cases;
mod dates;
mod random_forms;
mod scored_outputs;
