//! What a session reports, in words for the terminal.

use std::path::Path;

use athermal::Instant;
use athermal::core::event::Event as _;
use athermal::core::watch::Watch;
use athermal::run::live::monitor::Finding;
use athermal::run::live::{Report, Reporter};

use crate::terminal::{Failure, Terminal};
use athermal_analysis::figures::{instant, length, seconds};

/// A session's way to the terminal.
pub struct Reports {
    pub terminal: Terminal,
    /// Whether the input is known to end.
    pub ends: bool,
}

impl Reporter for Reports {
    fn report(&self, report: Report) {
        let terminal = &self.terminal;
        match report {
            // It is said at the end of an input that has one.
            Report::Skipped { rows, .. } if rows > 1 && self.ends => {}
            Report::Doubts(doubts, sources) => terminal.doubts(&doubts, &sources),
            Report::Unusable(error) => terminal.setback(&error.into()),
            Report::Unfit(error) => terminal.setback(&Failure::Request(error)),
            report => {
                let (all, host): (_, &dyn Watch) = (report.messages(!terminal.events), terminal);
                all.into_iter().for_each(|of| host.report(of));
            }
        }
    }
}

impl Reports {
    /// Reports what is found of a graph, and not at a row.
    pub fn found(&self, all: Vec<Finding>) {
        let found = |of| Report::Found(Instant::MIN, String::new(), of);
        all.into_iter().map(found).for_each(|of| self.report(of));
    }

    /// An output that is appended to: its last row is at `written`, and the run before saw rows up to `seen`.
    pub fn appended(&self, output: &Path, written: Option<Instant>, seen: Option<Instant>) {
        let name = output.display();
        let terminal = &self.terminal;
        match (written, seen) {
            (Some(last), Some(seen)) if last < seen => terminal.warning(format_args!(
                "{name}: its last row is {} before what the run before saw last: what was predicted between stands in another file, or \
                 is lost",
                length(seen - last)
            )),
            (Some(last), Some(seen)) if last > seen && !self.ends => {
                terminal.warning(format_args!(
                    "{name}: its last row is {} after what the run before kept: what this run does not read again of that time it \
                     does not know",
                    length(last - seen)
                ));
            }
            (None, Some(seen)) if output.is_file() => terminal.warning(format_args!(
                "{name}: none of the rows up to {} stand there, which the run before saw: what was predicted stands in another file, or \
                 is lost",
                instant(seconds(seen))
            )),
            (Some(last), None) => terminal.warning(format_args!(
                "{name}: rows of a run before stand there and stay, though this one begins cold: none up to the last of them, of {}, is \
                 written again",
                instant(seconds(last))
            )),
            _ => {}
        }
    }
}
