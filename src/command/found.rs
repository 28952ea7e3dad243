//! What a command found out: for people and for programs.

use athermal_core::watch::{Kept, Progress, Watch};
use athermal_jobs::Found;

use crate::message::Message;
use crate::terminal::{Failure, Format, Terminal};

/// A terminal that shows progress at once, and remarks behind what is found.
struct Behind<'a>(&'a Terminal, Kept);

impl Watch for Behind<'_> {
    fn remark(&self, level: &'static str, message: Message) {
        self.1.remark(level, message);
    }

    fn begin(&self, what: &str, total: Option<u64>) -> Box<dyn Progress> {
        self.0.begin(what, total)
    }
}

/// Prints what is found in the form that was asked for. What is remarked on the way comes behind it.
///
/// # Errors
/// As of what finds it.
pub fn show<T>(
    terminal: &Terminal,
    find: impl FnOnce(&dyn Watch) -> Result<(Found, T), Failure>,
) -> Result<(Found, T), Failure> {
    let behind = Behind(terminal, Kept::default());
    let found = find(&behind);
    if let Ok((found, _)) = &found {
        match terminal.format {
            Format::Json => println!("{:#}", found.facts),
            Format::Table => print!("{}", found.text),
        }
    }
    for of in behind.1.remarks() {
        terminal.remark(of.level, of.message);
    }
    found
}
