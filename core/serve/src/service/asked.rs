//! What a running service says of itself.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration as Wait;

use super::{Held, Service, SinkCounts, Snapshot};
use crate::connector::SourceCounts;
use crate::folder::StateFolder;
use crate::journal::JournalStatus;

impl Service {
    /// How long it has been running.
    #[must_use]
    pub fn uptime(&self) -> Wait {
        self.began.elapsed()
    }

    /// After how many ticks, beats, breaks and freezes the last checkpoint was saved.
    #[must_use]
    pub fn last_checkpoint(&self) -> u64 {
        self.keeper.last()
    }

    /// What the graph keeps of the past; none before there are two checkpoints of this run.
    #[must_use]
    pub fn held(&self) -> Option<Held> {
        self.keeper.held()
    }

    /// The state folder.
    #[must_use]
    pub fn folder(&self) -> &StateFolder {
        &self.folder
    }

    /// How often the engine thread has gone round: it lives for as long as this grows from one call to the next.
    #[must_use]
    pub fn beat(&self) -> u64 {
        self.engine.thread().unpark();
        self.shared.beat.load(Ordering::Relaxed)
    }

    /// What the engine thread knew within the last second or two.
    #[must_use]
    pub fn snapshot(&self) -> Snapshot {
        self.shared.read()
    }

    /// The channels, in the order of [`Snapshot::counts`].
    #[must_use]
    pub fn channels(&self) -> &[String] {
        &self.channels
    }

    /// The sources, and what each counts.
    #[must_use]
    pub fn sources(&self) -> &[(String, Arc<SourceCounts>)] {
        &self.sources
    }

    /// The sinks, and what each counts.
    #[must_use]
    pub fn sinks(&self) -> &[(String, Arc<SinkCounts>)] {
        &self.sinks
    }

    /// How the journal is.
    #[must_use]
    pub fn journal(&self) -> JournalStatus {
        self.progress.status()
    }
}
