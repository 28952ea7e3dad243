//! What a command found out: for people and for programs.

use athermal_command::collect::collected;
use serde_json::Value;

use crate::terminal::{Failure, Format, Terminal};

/// What a command found out, before it is printed.
#[derive(Debug)]
pub struct Found {
    /// For people.
    pub text: String,
    /// For programs.
    pub facts: Value,
}

/// Prints what is found in the form that was asked for. What is reported on the way comes behind it.
///
/// # Errors
/// As of what finds it.
pub fn show(
    terminal: &Terminal,
    find: impl FnOnce() -> Result<Found, Failure>,
) -> Result<Found, Failure> {
    let (found, reports) = collected(None, find);
    if let Ok(found) = &found {
        match terminal.format {
            Format::Json => println!("{:#}", found.facts),
            Format::Table => print!("{}", found.text),
        }
    }
    for report in &reports {
        terminal.pass_on(report);
    }
    found
}
