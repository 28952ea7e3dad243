//! How a mistake in a file is told: its code, place, reason and a way out; what counts as a mistake is decided by the layers.

mod codes;
mod collector;
mod counted;
mod digits;
mod gaps;
mod names;
mod nearest;
mod panicked;
mod place;
mod render;

pub use codes::{CODES, Code, explain};
pub use collector::{Diagnostic, Diagnostics, Problem, Severity};
pub use counted::names;
pub use counted::{count, counted, listed};
pub use digits::digits;
pub use names::Names;
pub use nearest::nearest;
pub use panicked::{NodePanic, panic_text, said};
pub use place::{Place, SourceId, Sources};

#[cfg(test)]
mod tests;
