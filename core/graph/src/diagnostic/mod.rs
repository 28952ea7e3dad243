//! How a mistake in a file is shown: its code, place, reason and a way out. Each layer declares its own mistakes.

mod codes;
mod collector;
mod counted;
mod declare;
mod digits;
mod names;
mod nearest;
mod panicked;
mod place;
mod render;

pub use codes::{Code, codes, explain};
pub use collector::{Diagnostic, Diagnostics, Problem, Severity};
pub use counted::names;
pub use counted::{count, counted, listed};
pub use declare::Help;
pub use digits::digits;
#[doc(hidden)]
pub use inventory;
pub use names::Names;
pub use nearest::nearest;
pub use panicked::{NodePanic, panic_message, panic_text};
pub use place::{Place, SourceId, Sources};

pub use crate::problem;

#[cfg(test)]
mod tests;
