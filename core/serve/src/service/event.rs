//! What a service reports while it runs. Whoever runs it puts that into words.

use athermal_run::live::monitor::Finding;
use athermal_run::live::{Notice, Verdict};

use crate::checkpoint::CheckpointError;
use crate::connector::ConnectorError;
use crate::engine::NodeCarry;
use crate::journal::JournalStatus;
use crate::sequencer::{Admission, Leader};
use crate::time::Instant;

/// What happened.
#[derive(Debug)]
pub enum ServiceEvent {
    /// A source failed, and is started again after a while.
    SourceFailed {
        /// Its name.
        source: String,
        /// Why.
        error: ConnectorError,
        /// After so many seconds.
        again_s: f64,
    },
    /// A source left something out.
    SourceRemark {
        /// Its name.
        source: String,
        /// What, and why.
        words: String,
    },
    /// A source has come to its end.
    SourceEnded {
        /// Its name.
        source: String,
    },
    /// A sink cannot put a row out; it is tried again after a while, and rows wait meanwhile.
    SinkFailed {
        /// Its name.
        sink: String,
        /// Why.
        error: ConnectorError,
    },
    /// A sink that had failed puts out again.
    SinkBack {
        /// Its name.
        sink: String,
    },
    /// A sample was not accepted: the first of its channel and reason, the tenth, the hundredth …
    NotAccepted {
        /// Why.
        admission: Admission,
        /// How many so far.
        count: u64,
        /// Whose clock is ahead of it, where that is why.
        leader: Option<(String, Leader)>,
    },
    /// The last tick was of the future by the host's clock, or by what most sources have shown for a minute: a segment has begun, whose
    /// times start again.
    WentBack {
        /// The last tick.
        last: Instant,
        /// A stamp of the time that it is.
        to: Instant,
    },
    /// A monitor has found something at a tick of this instant, or of the graph alone before the first.
    Found(Instant, Finding),
    /// Something happened at a hand-over.
    Swap(Notice),
    /// Another graph than that of the last checkpoint was given, and takes over.
    Staged {
        /// Its revision.
        revision: String,
        /// What becomes of each node.
        carry: Vec<NodeCarry>,
    },
    /// Another graph than that of the last checkpoint was given, and cannot take over: what ran last goes on.
    NotStaged(String),
    /// The comparison of a staged graph with what runs is over.
    Compared {
        /// The revision of the staged graph.
        revision: String,
        /// What it has come to.
        verdict: Verdict,
    },
    /// A graph was to take over after its comparison, and does not; what runs goes on.
    NotTakenOver(String),
    /// Whether the host's clock is known to be right, where that matters to a source: at the start, and once it is.
    HostClock {
        /// Until it is, clocks of sources are not judged by it: what is of the future is known from sources alone.
        is_synchronised: bool,
    },
    /// A checkpoint was not written; it is tried again.
    NoCheckpoint(CheckpointError),
    /// The journal cannot be written, or can again.
    Journal(JournalStatus),
    /// The code of a node panicked: it is absent from then on, and the graph goes on.
    NodeGivenUp(String),
    /// The engine cannot go on: the service ends.
    EngineFailed(String),
}
