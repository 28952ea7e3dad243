//! Decides what is told of a graph that is to take over; not whether it does.

use std::fmt::Write as _;
use std::path::Path;

use athermal::core::engine::Carry;
use athermal::run::live::{Notice, StageError, Staged, Verdict};
use serde_json::{Value, json};

use crate::command::run::watched::{Watched, Went};
use crate::message::Message;
use crate::terminal::{Failure, Terminal};
use athermal_analysis::figures::{count, counted, length, number, seconds};

/// How a graph is run that cannot take over, since what is read and written is settled when a run begins.
pub const ANOTHER_RUN: &str =
    "a run that begins with other files for `--output` and `--state` takes it";

/// What becomes of each node of a graph that is ready to take over.
pub fn staged(path: &Path, staged: &Staged) -> Message {
    let all = staged.carry();
    let carried = all
        .iter()
        .filter(|node| node.outcome == Carry::Carried)
        .count();
    let mut text = format!(
        "{} (revision {}): {carried} of {} nodes go on as they were",
        path.display(),
        staged.revision(),
        all.len()
    );
    for node in all {
        let (word, why) = match &node.outcome {
            Carry::Carried => continue,
            Carry::Adopted { reason } => ("goes on from the old state", reason.clone()),
            Carry::Migrated { from } => ("goes on", format!("from a state of the form {from}")),
            Carry::Warmed { reason } => ("warmed by the past", reason.clone()),
            Carry::Cold { reason } => ("cold", reason.clone()),
        };
        let _ = write!(text, "\n  {}: {word}, {why}", node.node);
    }
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

/// How a graph did in the shadow of what runs.
pub fn shadow(verdict: &Verdict) -> Message {
    let mut text = "in the shadow:".to_owned();
    for output in &verdict.outputs {
        let _ = write!(
            text,
            "\n  {}: RMSE {} running, {} new, in {}, over {}",
            output.output,
            number(output.running_rmse),
            number(output.candidate_rmse),
            output.unit,
            counted(output.n as u64, "instant")
        );
    }
    if let Some(ratio) = verdict.ratio {
        let _ = write!(text, "\n  new to running: {ratio:.3}");
    }
    let facts = json!({ "outputs": verdict.outputs, "ratio": verdict.ratio });
    Message::new("shadow", facts, text)
}

/// That a graph does not take over, and why: in a word for programs, in a sentence for people.
pub fn not_taken_over(path: &Path, reason: &str, words: impl std::fmt::Display) -> Message {
    let facts = json!({ "graph": path.display().to_string(), "reason": reason });
    Message::new(
        "not_taken_over",
        facts,
        format_args!("{} {words}", path.display()),
    )
}

/// That what stands in a file is no graph that can be run, and what goes on.
pub fn unusable(path: &Path, goes_on: &str) -> Message {
    let words = format_args!("is not taken over; {goes_on}");
    not_taken_over(path, "refused", words)
}

/// That a watched file has gone, or is back.
pub fn went(terminal: &Terminal, went: &Went) {
    match went {
        Went::Away(path) => terminal.warning(format_args!(
            "{} is no longer there: what runs goes on until it is there again with a change",
            path.display()
        )),
        Went::Back(path) => {
            terminal.note(format_args!("{} is there again, as it was", path.display()))
        }
    }
}

/// Why an input cannot be read: where it is not the watched graph that runs, that may be the one for it.
pub fn not_read(failure: Failure, watched: &Watched) -> Failure {
    match failure {
        Failure::Request(why) if watched.is_unlike => Failure::Request(format!(
            "{why} (that is what the graph reads that ran last and would go on; {} holds another: {ANOTHER_RUN})",
            watched.path.display()
        )),
        other => other,
    }
}

/// That a graph does not take over from what runs, with the way to run it where there is one.
pub fn refused(path: &Path, error: &StageError) -> Message {
    match error {
        StageError::MissingChannels { .. }
        | StageError::OtherTime { .. }
        | StageError::OtherUnit { .. } => {
            unusable(path, &format!("what runs goes on; {ANOTHER_RUN}"))
        }
        _ => unusable(path, "what runs goes on"),
    }
}

/// Tells what has happened.
pub fn notices(terminal: &Terminal, notices: Vec<Notice>) {
    for notice in notices {
        match notice {
            Notice::TookOver {
                revision,
                tick,
                time,
            } => {
                let words = format!("revision {revision} took over before tick {}", count(tick));
                let facts = json!({ "revision": revision, "tick": tick, "time_s": seconds(time) });
                terminal.note(Message::new("took_over", facts, words));
            }
            Notice::SentBack => {
                let words = "the new graph came too late and was sent back";
                terminal.warning(Message::new("sent_back", Value::Null, words));
            }
            Notice::Missed { ticks } => {
                let were = if ticks == 1 { "was" } else { "were" };
                let words = format!("{} {were} missed", counted(ticks, "tick"));
                terminal.warning(Message::new("missed", json!({ "ticks": ticks }), words));
            }
        }
    }
}
