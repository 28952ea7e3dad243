//! What a session reports while it runs: what can happen, declared once.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use athermal_core::events;

use super::super::monitor::{Finding, words};
use super::super::store::StateError;
use super::super::{Compared, Notice, StageError, Staged, Verdict};
use crate::diagnostic::{Diagnostics, Sources, count, listed};
use crate::engine::NodeCarry;
use crate::figures::{length, seconds};
use crate::model::ModelError;
use crate::time::{Duration, Instant};

/// How a graph is run that cannot take over, since what is read and written is settled when a run begins.
pub const ANOTHER_RUN: &str =
    "a run that begins with other files for `--output` and `--state` takes it";
/// What to do where a clock was ahead.
const BEGIN_COLD: &str =
    "a run with another `--state` and `--output` file begins cold and goes on from there";

/// Takes what a session reports.
pub trait Reporter {
    /// Takes a report, which is due now.
    fn report(&self, report: Report);
}

/// Passes over all reports.
impl Reporter for () {
    fn report(&self, _report: Report) {}
}

events! {
    /// What happened.
    #[derive(Debug)]
    pub enum Report {
        /// There is no state yet: the run begins cold.
        NoState(path: PathBuf) => "no_state", note, {}, format!("{}: not there yet, the run begins cold", path.display());
        /// The state was not saved. That is tried again after the first row, or in a minute.
        NotSaved {
            /// Why.
            error: StateError,
            /// Whether the run is about to begin, with the state that was read.
            at_start: bool,
        } => "not_saved", fault, {}, match at_start {
            true => format!("{error}; the run goes on from what was read, and tries again after the first row"),
            false => format!("{error}; the run goes on, and tries again in a minute"),
        };
        /// A row is not after the last one that the run before saw or wrote. Reported at the first that is skipped, and at ten, a
        /// hundred …
        Skipped {
            /// How many rows so far.
            rows: u64,
            /// The instant of this one, as the source wrote it.
            time: String,
            /// How long it is before the last row of the run before.
            before: Duration,
        } => "passed_over", fault if *rows > 1, { count: u64 = rows, time: String = time }, match rows {
            1 => format!("the row of {time} was seen by the run before: it and all like it are passed over"),
            rows => format!(
                "{} rows so far, up to that of {time}, which is {} before the last of the run before: nothing is put out until rows come \
                 after that; this is right where a log is read again, and not where a clock was ahead then: {BEGIN_COLD}",
                count(rows),
                length(*before)
            ),
        };
        /// The source ended, and nothing came after what the run before saw.
        AllSkipped {
            /// How long the last row is before the last of the run before.
            before: Duration,
        } => "all_passed_over", fault if *before > Duration::ZERO, {}, match *before > Duration::ZERO {
            true => format!(
                "the last row is {} before what the run before saw last: nothing was predicted; if a clock was ahead then, {BEGIN_COLD}",
                length(*before)
            ),
            false => "no row is after what the run before saw last: nothing was predicted; where times begin anew with each file, a run \
                      with another `--state` and `--output` file takes them".to_owned(),
        };
        /// The output file was removed, moved or replaced: rows go on into the file that was opened.
        OutputMoved(path: PathBuf) => "output_moved", fault, {}, format!(
            "{} was removed, moved or replaced while it is written: rows go on into the file that was there, and none into what is there \
             now; end the run before it is moved, or copy it and cut it to nothing",
            path.display()
        );
        /// Nodes of a model could not be fitted there, and keep the fit of what ran before.
        FitsKept(path: PathBuf, nodes: Vec<String>) => "fits_kept", fault, {}, format!(
            "{}: {} could not be fitted there, and {} the fit of what ran before",
            path.display(),
            listed(nodes, 6),
            if nodes.len() == 1 { "keeps" } else { "keep" },
        );
        /// Nodes could not be fitted, and give nothing.
        Unfitted(path: PathBuf, nodes: Vec<String>) => "unfitted", fault, {}, format!(
            "{}: {} could not be fitted and {} nothing",
            path.display(),
            listed(nodes, 6),
            if nodes.len() == 1 { "gives" } else { "give" },
        );
        /// Nodes keep a fit although what they read is made in another way.
        DoubtfulFits(path: PathBuf, nodes: Vec<String>) => "doubtful_fits", fault, {}, format!(
            "{}: {} {} as fitted before, though what they read is now made in another way: fit the graph anew to be sure",
            path.display(),
            nodes.join(", "),
            if nodes.len() == 1 { "stays" } else { "stay" },
        );
        /// A graph that is ready to take over lacks outputs of what runs.
        Lacking(path: PathBuf, outputs: Vec<String>) => "lacking_outputs", fault, {}, format!(
            "{} has no {} `{}`, whose {} empty while it runs",
            path.display(),
            if outputs.len() == 1 { "output" } else { "outputs" },
            outputs.join("`, `"),
            if outputs.len() == 1 { "column is" } else { "columns are" },
        );
        /// A graph is ready to take over.
        Staged {
            /// The file.
            path: PathBuf,
            /// Its revision.
            revision: String,
            /// What becomes of its nodes.
            carry: Vec<NodeCarry>,
            /// What of them is not as it would be with all of the past.
            short: String,
        } => "staged", note,
            { graph: String = path.display().to_string(), revision: String = revision, nodes: Vec<NodeCarry> = carry },
            NodeCarry::graph_words(path, revision, carry) + short;
        /// Outputs of it had no value in the past that it was warmed by.
        Silent {
            /// The file.
            path: PathBuf,
            /// How long that past is.
            past: Duration,
            /// The outputs.
            outputs: Vec<String>,
        } => "silent_outputs", fault, {}, format!(
            "{} gives no `{}` over the past {} that it was warmed by: are its sensors those of this machine?",
            path.display(),
            outputs.join("`, `"),
            length(*past)
        );
        /// How a graph did in the shadow of what runs.
        Shadow(of: Verdict) => "shadow", note, { outputs: Vec<Compared> = of.outputs, ratio: Option<f64> = of.ratio }, of.words();
        /// A graph does not take over.
        NotTakenOver {
            /// The file.
            path: PathBuf,
            /// Why, in a word for programs.
            reason: &'static str,
            /// The same for people, after its name.
            why: String,
        } => "not_taken_over", fault, { graph: String = path.display().to_string(), reason: String = reason },
            format!("{} {why}", path.display());
        /// A watched file holds again what runs.
        RunsAlready(path: PathBuf) => "runs_already", note, {}, format!("{} is what runs again", path.display());
        /// A watched file is no longer there.
        FileGone(path: PathBuf) => "file_gone", fault, {},
            format!("{} is no longer there: what runs goes on until it is there again with a change", path.display());
        /// A watched file is there again, as it was.
        FileBack(path: PathBuf) => "file_back", note, {}, format!("{} is there again, as it was", path.display());
    }
    and together {
        /// A monitor has found something at the row of an instant, here and as the source wrote it.
        Found(at: Instant, time: String, finding: Finding) => words::messages(finding, (time, seconds(*at)), together);
        /// Something happened at a hand-over.
        Swap(of: Notice) => of.messages(together);
        /// What is doubtful in a graph that is about to be staged, and the texts that this points into: whoever has a terminal shows them.
        Doubts(_doubts: Diagnostics, _sources: Sources) => Vec::new();
        /// Why a graph cannot be read, or has mistakes: likewise.
        Unusable(_error: ModelError) => Vec::new();
        /// Why a graph does not follow on what runs: likewise.
        Unfit(_error: String) => Vec::new();
    }
}

impl Report {
    /// A graph does not take over, and why.
    #[must_use]
    pub fn not_taken_over(path: &Path, (reason, why): (&'static str, &str)) -> Self {
        Self::NotTakenOver {
            path: path.to_owned(),
            reason,
            why: why.to_owned(),
        }
    }

    /// A graph cannot take over, and what goes on.
    #[must_use]
    pub fn refused(path: &Path, goes_on: &str) -> Self {
        let why = format!("is not taken over; {goes_on}");
        Self::not_taken_over(path, ("refused", &why))
    }

    /// Why a graph does not follow on what runs.
    pub(super) fn unfit(path: &Path, error: &StageError) -> [Self; 2] {
        let goes_on = match error {
            StageError::MissingChannels { .. }
            | StageError::OtherTime { .. }
            | StageError::OtherUnit { .. } => format!("what runs goes on; {ANOTHER_RUN}"),
            _ => "what runs goes on".to_owned(),
        };
        let words = format!("{}: {error}", path.display());
        [Self::Unfit(words), Self::refused(path, &goes_on)]
    }

    /// A graph is ready to take over.
    pub(super) fn staged(path: &Path, staged: &Staged) -> Self {
        let mut short = String::new();
        let (past, endless) = staged.endless();
        if !endless.is_empty() {
            let _ = write!(
                short,
                "\n  {}: goes by all of its past, of which {} is known",
                endless.join(", "),
                length(past)
            );
        }
        if let Some((past, wanted)) = staged.too_short_a_past() {
            let _ = write!(
                short,
                "\n  the past to warm it by is {}, and it looks back as far as {}: until then it may give less than it will",
                length(past),
                length(wanted)
            );
        }
        Self::Staged {
            path: path.to_owned(),
            revision: staged.revision().to_owned(),
            carry: staged.carry().to_vec(),
            short,
        }
    }
}
