//! What a session reports, in words for the terminal.

use std::path::Path;

use athermal::run::live::monitor::Finding;
use athermal::run::live::{Report, Reporter};
use athermal::{Duration, Instant};
use serde_json::json;

use super::swap_words;
use crate::command::model::{few, warn_nodes_unfitted};
use crate::message::Message;
use crate::terminal::Terminal;
use athermal_analysis::figures::{count, instant, length, seconds};
use athermal_command::findings;

/// What to do where a clock was ahead.
const BEGIN_COLD: &str =
    "a run with another `--state` and `--output` file begins cold and goes on from there";

/// A session's way to the terminal.
pub struct Reports {
    pub terminal: Terminal,
    /// Whether the input is known to end.
    pub ends: bool,
}

impl Reporter for Reports {
    fn report(&self, report: Report<'_>) {
        let terminal = &self.terminal;
        match report {
            Report::NoState(path) => terminal.note(format_args!(
                "{}: not there yet, the run begins cold",
                path.display()
            )),
            Report::NotSaved { error, at_start: true } => terminal.warning(format_args!(
                "{error}; the run goes on from what was read, and tries again after the first row"
            )),
            Report::NotSaved { error, .. } => terminal.warning(format_args!(
                "{error}; the run goes on, and tries again in a minute"
            )),
            Report::Skipped { rows, time, before } => self.skipped(rows, time, before),
            Report::AllSkipped { before } => self.all_skipped(before),
            Report::OutputMoved(path) => terminal.warning(format_args!(
                "{} was removed, moved or replaced while it is written: rows go on into the file that was there, and none into what is \
                 there now; end the run before it is moved, or copy it and cut it to nothing",
                path.display()
            )),
            Report::Found { finding, at, time } => {
                let together = !terminal.events;
                let all = findings::messages(finding, (time, seconds(at)), together);
                all.into_iter().for_each(|of| terminal.report(of));
            }
            Report::Swap(notice) => swap_words::notice(terminal, &notice),
            Report::Doubts { doubts, sources } => terminal.doubts(doubts, sources),
            Report::FitsKept { path, nodes } => terminal.warning(format_args!(
                "{}: {} could not be fitted there, and {} the fit of what ran before",
                path.display(),
                few(nodes),
                if nodes.len() == 1 { "keeps" } else { "keep" },
            )),
            Report::Unfitted { path, nodes } => warn_nodes_unfitted(terminal, nodes, path),
            Report::DoubtfulFits { path, nodes } => terminal.warning(format_args!(
                "{}: {} {} as fitted before, though what they read is now made in another way: fit the graph anew to be sure",
                path.display(),
                nodes.join(", "),
                if nodes.len() == 1 { "stays" } else { "stay" },
            )),
            Report::Staged {
                path,
                staged,
                lacking,
                silent,
            } => swap_words::ready(terminal, path, staged, lacking, silent),
            Report::Shadow(verdict) => terminal.note(swap_words::shadow(verdict)),
            Report::NotTakenOver { path, reason } => {
                swap_words::not_taken_over(terminal, path, reason);
            }
            Report::RunsAlready(path) => {
                terminal.note(format_args!("{} is what runs again", path.display()));
            }
            Report::FileGone(path) => terminal.warning(format_args!(
                "{} is no longer there: what runs goes on until it is there again with a change",
                path.display()
            )),
            Report::FileBack(path) => {
                terminal.note(format_args!("{} is there again, as it was", path.display()));
            }
        }
    }
}

impl Reports {
    /// Reports what is found of a graph, and not at a row.
    pub fn found(&self, all: &[Finding]) {
        let (at, time) = (Instant::MIN, "");
        let found = all
            .iter()
            .map(|finding| Report::Found { finding, at, time });
        found.for_each(|of| self.report(of));
    }

    fn skipped(&self, rows: u64, newest: &str, before: Duration) {
        let facts = json!({ "count": rows, "time": newest });
        let message = |words: String| Message::new("passed_over", facts, words);
        if rows == 1 {
            self.terminal.note(message(format!(
                "the row of {newest} was seen by the run before: it and all like it are passed over"
            )));
        } else if !self.ends {
            self.terminal.warning(message(format!(
                "{} rows so far, up to that of {newest}, which is {} before the last of the run before: nothing is put out until rows \
                 come after that; this is right where a log is read again, and not where a clock was ahead then: {BEGIN_COLD}",
                count(rows),
                length(before)
            )));
        }
    }

    fn all_skipped(&self, before: Duration) {
        if before > Duration::ZERO {
            self.terminal.warning(format_args!(
                "the last row is {} before what the run before saw last: nothing was predicted; if a clock was ahead then, {BEGIN_COLD}",
                length(before)
            ));
        } else {
            self.terminal.note(
                "no row is after what the run before saw last: nothing was predicted; where times begin anew with each file, a run \
                 with another `--state` and `--output` file takes them",
            );
        }
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
