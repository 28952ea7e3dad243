//! What a session reports while it runs. Whoever runs it puts that into words.

use std::path::Path;

use super::super::monitor::Finding;
use super::super::store::StateError;
use super::super::{Notice, StageError, Staged, Verdict};
use crate::diagnostic::{Diagnostics, Sources};
use crate::model::ModelError;
use crate::time::{Duration, Instant};

/// Takes what a session reports.
pub trait Reporter {
    /// Takes a report, which is due now.
    fn report(&self, report: Report<'_>);
}

/// Passes over all reports.
impl Reporter for () {
    fn report(&self, _report: Report<'_>) {}
}

/// What happened.
#[derive(Debug)]
pub enum Report<'a> {
    /// There is no state yet: the run begins cold.
    NoState(&'a Path),
    /// The state was not saved. That is tried again after the first row, or in a minute.
    NotSaved {
        /// Why.
        error: StateError,
        /// Whether the run is about to begin, with the state that was read.
        at_start: bool,
    },
    /// A row is not after the last one that the run before saw or wrote. Reported at the first that is skipped, and at ten, a hundred …
    Skipped {
        /// How many rows so far.
        rows: u64,
        /// The instant of this one, as the source wrote it.
        time: &'a str,
        /// How long it is before the last row of the run before.
        before: Duration,
    },
    /// The source ended, and nothing came after what the run before saw.
    AllSkipped {
        /// How long the last row is before the last of the run before.
        before: Duration,
    },
    /// The output file was removed, moved or replaced: rows go on into the file that was opened.
    OutputMoved(&'a Path),
    /// A monitor has found something.
    Found {
        /// What.
        finding: &'a Finding,
        /// The instant of the row.
        at: Instant,
        /// The same, as the source wrote it.
        time: &'a str,
    },
    /// Something happened at a hand-over.
    Swap(Notice),
    /// What is doubtful in a graph that is about to be staged.
    Doubts {
        /// The doubts, which may be none.
        doubts: &'a Diagnostics,
        /// The texts that they point into.
        sources: &'a Sources,
    },
    /// Nodes of a model could not be fitted there, and keep the fit of what ran before.
    FitsKept {
        /// The file.
        path: &'a Path,
        /// The nodes.
        nodes: &'a [String],
    },
    /// Nodes could not be fitted, and give nothing.
    Unfitted {
        /// The file.
        path: &'a Path,
        /// The nodes.
        nodes: &'a [String],
    },
    /// Nodes keep a fit although what they read is made in another way.
    DoubtfulFits {
        /// The file.
        path: &'a Path,
        /// The nodes.
        nodes: &'a [String],
    },
    /// A graph is ready to take over.
    Staged {
        /// The file.
        path: &'a Path,
        /// What becomes of its nodes.
        staged: &'a Staged,
        /// Outputs of what runs that it lacks.
        lacking: &'a [String],
        /// How long the past is that it was warmed by, and the outputs that had no value in it.
        silent: (Duration, &'a [&'a str]),
    },
    /// How a graph did in the shadow of what runs.
    Shadow(&'a Verdict),
    /// A graph does not take over.
    NotTakenOver {
        /// The file.
        path: &'a Path,
        /// Why.
        reason: Refusal<'a>,
    },
    /// A watched file holds again what runs.
    RunsAlready(&'a Path),
    /// A watched file is no longer there.
    FileGone(&'a Path),
    /// A watched file is there again, as it was.
    FileBack(&'a Path),
}

/// Why a graph does not take over.
#[derive(Debug)]
pub enum Refusal<'a> {
    /// The file cannot be read, or has mistakes.
    Unusable(ModelError),
    /// It does not follow on what runs.
    Stage(&'a StageError),
    /// It has an output for which there is no column.
    NoColumn(&'a str),
    /// Its file has changed since.
    Changed,
    /// Its file is gone.
    Gone,
    /// Its error in the shadow is larger.
    LargerError,
    /// There was nothing to compare in the shadow.
    NothingToCompare,
    /// The data ended before.
    DataEnded,
}
