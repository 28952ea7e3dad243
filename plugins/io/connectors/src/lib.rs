//! Sources and sinks of a service that need no network.
//!
//! | kind | source | sink |
//! |---|---|---|
//! | `csv`, `jsonl` | a file that is followed as it grows, also when it is rotated | a file with a row for each tick, and those that were full before |
//! | `stdin`, `stdout` | rows from standard input | rows to standard output |
//! | `replay` | a recording, at its pace or another | |
//! | `simulation` | a simulated machine | the corrections that it applies |
//!
//! How ticks are made of what comes, and when rows leave, is decided in `athermal-serve`.

#![cfg_attr(test, allow(clippy::unwrap_used))]

mod file_sink;
mod file_source;
mod follow;
mod pace;
mod pipe;
mod replay;
mod row_files;
mod simulation;
mod stream;
mod table;

pub use simulation::{SimulationSink, SimulationSource};

#[cfg(test)]
mod tests;
