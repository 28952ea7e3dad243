//! The words of a replacement: what a graph takes over, and why it does not.

use std::fmt::{self, Write as _};
use std::path::Path;

use athermal::Duration;
use athermal::core::engine::NodeCarry;
use athermal::core::event::Event as _;
use athermal::run::live::session::{Refusal, WatchedGraph};
use athermal::run::live::{Notice, StageError, Staged, Verdict};
use serde_json::json;

use crate::message::Message;
use crate::terminal::{Failure, Terminal};
use athermal_analysis::figures::{apart, counted, length};

/// How a graph is run that cannot take over, since what is read and written is settled when a run begins.
const ANOTHER_RUN: &str =
    "a run that begins with other files for `--output` and `--state` takes it";

/// A graph that is ready to take over: what it lacks, what becomes of its nodes, and what it gives no value of.
pub fn ready(
    terminal: &Terminal,
    path: &Path,
    of: &Staged,
    lacking: &[String],
    (past, silent): (Duration, &[&str]),
) {
    if !lacking.is_empty() {
        let (what, are) = match lacking.len() {
            1 => ("output", "whose column is empty"),
            _ => ("outputs", "whose columns are empty"),
        };
        let names = lacking.join("`, `");
        terminal.warning(format_args!(
            "{} has no {what} `{names}`, {are} while it runs",
            path.display()
        ));
    }
    terminal.note(staged(path, of));
    if !silent.is_empty() {
        let (names, past) = (silent.join("`, `"), length(past));
        terminal.warning(format_args!(
            "{} gives no `{names}` over the past {past} that it was warmed by: are its sensors those of this machine?",
            path.display()
        ));
    }
}

/// What becomes of each node of a graph that is ready to take over.
fn staged(path: &Path, staged: &Staged) -> Message {
    let all = staged.carry();
    let mut text = NodeCarry::graph_words(path, staged.revision(), all);
    let (past, endless) = staged.endless();
    if !endless.is_empty() {
        let _ = write!(
            text,
            "\n  {}: goes by all of its past, of which {} is known",
            endless.join(", "),
            length(past)
        );
    }
    if let Some((past, wanted)) = staged.too_short_a_past() {
        let _ = write!(
            text,
            "\n  the past to warm it by is {}, and it looks back as far as {}: until then it may give less than it will",
            length(past),
            length(wanted)
        );
    }
    let facts =
        json!({ "graph": path.display().to_string(), "revision": staged.revision(), "nodes": all });
    Message::new("staged", facts, text)
}

/// What becomes of the nodes of a graph that was given at the start of a service.
pub fn carry(terminal: &Terminal, all: &[NodeCarry]) {
    let text = NodeCarry::words(all);
    if !text.is_empty() {
        terminal.note(text.trim_start());
    }
}

/// How a graph did in the shadow of what runs.
pub fn shadow(verdict: &Verdict) -> Message {
    let mut text = "in the shadow:".to_owned();
    for output in &verdict.outputs {
        let [running, new] = apart([output.running_rmse, output.candidate_rmse]);
        let _ = write!(
            text,
            "\n  {}: RMSE {running} running, {new} new, in {}, over {}",
            output.output,
            output.unit,
            counted(output.n as u64, "instant")
        );
    }
    match verdict.ratio {
        Some(ratio) => {
            let _ = write!(text, "\n  new to running: {ratio:.3}");
        }
        None => text += " there was nothing to compare",
    }
    let facts = json!({ "outputs": verdict.outputs, "ratio": verdict.ratio });
    Message::new("shadow", facts, text)
}

/// A graph that does not take over, and why.
pub fn not_taken_over(terminal: &Terminal, path: &Path, refusal: Refusal<'_>) {
    let (reason, words) = match refusal {
        Refusal::Unusable(error) => {
            terminal.setback(&error.into());
            return unusable(terminal, path, "what runs goes on");
        }
        Refusal::Stage(error) => {
            terminal.setback(&Failure::Request(format!("{}: {error}", path.display())));
            let goes_on: &str = match error {
                StageError::MissingChannels { .. }
                | StageError::OtherTime { .. }
                | StageError::OtherUnit { .. } => &format!("what runs goes on; {ANOTHER_RUN}"),
                _ => "what runs goes on",
            };
            return unusable(terminal, path, goes_on);
        }
        Refusal::NoColumn(name) => (
            "no_column",
            &*format!(
                "has the output `{name}`, for which there is no column; what runs goes on; {ANOTHER_RUN}"
            ),
        ),
        Refusal::Changed => (
            "changed",
            "has changed: as it was in the shadow until now, it does not take over",
        ),
        Refusal::Gone => (
            "changed",
            "is gone: as it was in the shadow until now, it does not take over",
        ),
        Refusal::LargerError => ("larger_error", "does not take over: its error is larger"),
        Refusal::NothingToCompare => (
            "nothing_to_compare",
            "does not take over: there was nothing to compare",
        ),
        Refusal::DataEnded => ("data_ended", "did not take over: the data ended before"),
    };
    terminal.warning(message(path, reason, format_args!("{words}")));
}

/// What stands in a file is no graph that can be run, and what goes on.
pub fn unusable(terminal: &Terminal, path: &Path, goes_on: &str) {
    let words = format_args!("is not taken over; {goes_on}");
    terminal.warning(message(path, "refused", words));
}

/// The reason in a word for programs, in a sentence for people.
fn message(path: &Path, reason: &str, words: fmt::Arguments<'_>) -> Message {
    let facts = json!({ "graph": path.display().to_string(), "reason": reason });
    let words = format_args!("{} {words}", path.display());
    Message::new("not_taken_over", facts, words)
}

/// Why an input cannot be read: where it is not the watched graph that runs, that may be the one for it.
pub fn not_read(failure: Failure, watched: Option<&WatchedGraph>) -> Failure {
    match (failure, watched) {
        (Failure::Request(why), Some(watched)) if watched.is_unlike() => Failure::Request(format!(
            "{why} (that is what the graph reads that ran last and would go on; {} holds another: {ANOTHER_RUN})",
            watched.path().display()
        )),
        (other, _) => other,
    }
}

/// What happened at a hand-over.
pub fn notice(terminal: &Terminal, notice: &Notice) {
    notice
        .messages(true)
        .into_iter()
        .for_each(|of| terminal.report(of));
}
