//! What the control thread does beside the engine: checkpoints of the replica, at intervals.

use std::sync::Arc;
use std::time::{Duration as Wait, Instant as Clock};

use athermal_run::live::{Control, Notice};

use crate::checkpoint::{Checkpoint, CheckpointError, Checkpoints};
use crate::journal::Progress;

/// Takes checkpoints from the replica, so that the engine thread never serialises.
#[derive(Debug)]
pub struct Keeper {
    control: Control,
    checkpoints: Checkpoints,
    progress: Arc<Progress>,
    /// How many ticks, beats, breaks and freezes there were before this run.
    before: u64,
    every: Wait,
    taken: Clock,
    /// One that waits until the journal is synced up to it.
    waiting: Option<Checkpoint>,
    last: u64,
}

impl Keeper {
    /// Takes a checkpoint each `every`. `before` is how many ticks, beats, breaks and freezes there were before this run.
    #[must_use]
    pub fn new(
        control: Control,
        checkpoints: Checkpoints,
        progress: Arc<Progress>,
        before: u64,
        every: Wait,
    ) -> Self {
        Self {
            control,
            checkpoints,
            progress,
            before,
            every,
            taken: Clock::now(),
            waiting: None,
            last: before,
        }
    }

    /// Takes in what has been stepped, and saves a checkpoint when it is time for one. Call it many times a second.
    ///
    /// A checkpoint is saved once the journal is synced up to it: after a power cut none is ahead of the journal. While nothing can
    /// be journalled it is saved at once, to bridge the gap.
    ///
    /// # Errors
    /// When it cannot be written. It is tried again after `every`.
    pub fn pump(&mut self) -> Result<Vec<Notice>, CheckpointError> {
        let notices = self.control.pump();
        if self.waiting.is_none() && self.taken.elapsed() >= self.every {
            self.take();
        }
        self.save()?;
        Ok(notices)
    }

    /// Takes a checkpoint now; it is saved once the journal is synced up to it. After how many ticks, beats, breaks and freezes it
    /// is; none where none can be taken.
    pub fn take_now(&mut self) -> Option<u64> {
        self.take();
        self.waiting.as_ref().map(|of| of.happenings)
    }

    /// After how many ticks, beats, breaks and freezes the last checkpoint was saved.
    #[must_use]
    pub fn last(&self) -> u64 {
        self.last
    }

    /// How many ticks, beats, breaks and freezes have been taken in, those before this run included.
    #[must_use]
    pub fn happenings(&self) -> u64 {
        self.before + self.control.events()
    }

    /// Saves what the replica knows now, once the journal is synced up to it. For the end, when the journal is finished.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn finish(mut self) -> Result<Control, CheckpointError> {
        self.control.pump();
        self.take();
        self.save()?;
        Ok(self.control)
    }

    /// After how many ticks, beats, breaks and freezes the oldest checkpoint was taken; none where there is none.
    #[must_use]
    pub fn oldest(&self) -> Option<u64> {
        self.checkpoints.oldest().ok().flatten()
    }

    /// The control of the graph.
    #[must_use]
    pub fn look(&self) -> &Control {
        &self.control
    }

    /// The control of the graph.
    pub fn control(&mut self) -> &mut Control {
        &mut self.control
    }

    fn take(&mut self) {
        self.taken = Clock::now();
        let happenings = self.happenings();
        // Between a hand-over and the take-over there is none: a replay that began there would not know what was handed over.
        if let Some(replica) = self.control.replica()
            && happenings > self.last
            && !self.control.is_busy()
            // What a node that was given up had learned is not whole: the journal goes on from before.
            && replica.panics().is_empty()
        {
            self.waiting = Some(Checkpoint::of(replica, happenings));
        }
    }

    fn save(&mut self) -> Result<(), CheckpointError> {
        let is_safe = |of: &Checkpoint| {
            self.progress.synced_happenings() >= of.happenings || self.progress.is_degraded()
        };
        let Some(checkpoint) = self.waiting.take_if(|of| is_safe(of)) else {
            return Ok(());
        };
        self.checkpoints.save(&checkpoint)?;
        self.last = checkpoint.happenings;
        Ok(())
    }
}
