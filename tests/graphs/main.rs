//! Graphs through the public interface of the library: what they compute, what is refused, what a swap and a restart keep.
//! Tests here may register kinds of their own.

#![allow(clippy::unwrap_used)]

#[path = "../workbench/mod.rs"]
mod workbench;

mod allocation;
mod closed_loop;
mod determinism;
mod diff;
mod hostile;
mod kinematics;
mod language;
mod leaks;
mod learning;
mod memory;
mod modules;
mod pictures;
mod planned;
mod predicted_at_once;
mod runs_between_truths;
mod swap;
mod units;
