//! What the control thread does beside the engine: checkpoints at intervals.

use std::io;
use std::sync::Arc;
use std::time::{Duration as Wait, Instant as Clock};

use athermal_run::live::{Control, Notice, StageError};

use crate::aside::{Aside, PATIENCE, within};
use crate::checkpoint::{Checkpoint, CheckpointError, Checkpoints, LeftState};
use crate::folder::FolderError;
use crate::journal::Progress;
use crate::time::{Duration, Instant};

/// How often is looked whether a checkpoint has been saved, or can be.
const LOOK: Wait = Wait::from_millis(100);

/// Takes checkpoints from the replica where there is one, and else from what the engine thread leaves in a moment in which nothing is
/// due. It never writes them itself.
#[derive(Debug)]
pub struct Keeper {
    control: Control,
    checkpoints: Checkpoints,
    /// Graphs as they were when they were committed.
    swaps: Checkpoints,
    progress: Arc<Progress>,
    /// How many ticks, beats, breaks and freezes there were before this run.
    before: u64,
    every: Wait,
    taken: Clock,
    /// Whether the engine thread has been asked for what it knows, and no graph was sent to it since.
    is_asking: bool,
    /// One that waits until the journal is synced up to it.
    waiting: Option<Checkpoint>,
    /// One that is being saved, on a disk that may hang.
    pub(crate) saving: Aside<Result<u64, CheckpointError>>,
    last: u64,
    /// The first tick that was looked at in this run: its number and its time.
    first: Option<(u64, Instant)>,
    held: Option<Held>,
}

impl Keeper {
    /// Takes a checkpoint each `every`. `before` is how many ticks, beats, breaks and freezes there were before this run.
    #[must_use]
    pub fn new(
        control: Control,
        (checkpoints, swaps): (Checkpoints, Checkpoints),
        progress: Arc<Progress>,
        before: u64,
        every: Wait,
    ) -> Self {
        Self {
            control,
            checkpoints,
            swaps,
            progress,
            before,
            every,
            taken: Clock::now(),
            is_asking: false,
            waiting: None,
            saving: Aside::default(),
            last: before,
            first: None,
            held: None,
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
        if self.is_due() {
            self.take();
        }
        self.save()?;
        Ok(notices)
    }

    fn is_due(&self) -> bool {
        self.waiting.is_none() && self.taken.elapsed() >= self.every
    }

    /// How long nothing is due for [`pump`](Self::pump), where nothing is stepped.
    #[must_use]
    pub fn due(&self) -> Wait {
        match self.waiting.is_none() && self.saving.is_free() && !self.is_due() {
            true => self.every.saturating_sub(self.taken.elapsed()),
            false => LOOK,
        }
    }

    /// Lets the staged graph take over before the next tick. It is saved as it is, so that a replay lets the same take over.
    ///
    /// # Errors
    /// When it cannot be saved, nothing is staged, or a graph is still on its way; what runs is untouched.
    pub fn commit(&mut self) -> Result<(), CommitError> {
        self.send(0, Control::commit)
    }

    /// Lets the graph before the last swap take over again; as [`commit`](Self::commit).
    ///
    /// # Errors
    /// As of [`commit`](Self::commit), and when none is still warm.
    pub fn rollback(&mut self) -> Result<(), CommitError> {
        self.send(1, Control::rollback)
    }

    fn send(
        &mut self,
        which: usize,
        send: fn(&mut Control) -> Result<(), StageError>,
    ) -> Result<(), CommitError> {
        // What is saved may have the name of the one that is on its way.
        if self.control.is_on_the_way() {
            return Err(StageError::Busy.into());
        }
        let happenings = self.before + self.control.events();
        if let Some(engine) = self.control.beside()[which] {
            let (swaps, checkpoint) = (self.swaps.clone(), Checkpoint::of(engine, happenings));
            within(move || swaps.save(&checkpoint)).ok_or(CommitError::Hangs)??;
        }
        // What the engine thread leaves from here on may be from before it takes over.
        self.is_asking = false;
        let sent = send(&mut self.control);
        if sent.is_err() {
            let swaps = self.swaps.clone();
            within(move || swaps.retain(..happenings));
        }
        Ok(sent?)
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

    /// Saves what the replica knows now, once the journal is synced up to it. For the end, when the journal is finished.
    ///
    /// # Errors
    /// When it cannot be written, also where the disk hangs.
    pub fn finish(mut self) -> Result<Control, CheckpointError> {
        self.control.pump();
        // One that is on its way is older.
        if let Some(saved) = self.saving.wait(PATIENCE) {
            self.last = saved?;
        }
        self.take();
        self.save()?;
        self.saving.wait(PATIENCE).transpose()?;
        if !self.saving.is_free() {
            let (path, error) = (self.checkpoints.folder, io::ErrorKind::TimedOut.into());
            return Err(CheckpointError::NotWritten { path, error });
        }
        Ok(self.control)
    }

    /// What the graph that runs kept at the last checkpoint; none before there are two of this run.
    #[must_use]
    pub fn held(&self) -> Option<Held> {
        self.held
    }

    /// The checkpoints.
    #[must_use]
    pub fn checkpoints(&self) -> &Checkpoints {
        &self.checkpoints
    }

    /// The control of the graph, to be looked at.
    #[must_use]
    pub fn look(&self) -> &Control {
        &self.control
    }

    /// The control of the graph.
    pub fn control(&mut self) -> &mut Control {
        &mut self.control
    }

    /// What the engine thread has left since it was asked and no graph was sent to it; else it is asked.
    fn left(&mut self) -> Option<LeftState> {
        let left = self.progress.desk.take().filter(|_| self.is_asking);
        self.is_asking = left.is_none();
        if self.is_asking {
            self.progress.desk.ask();
        }
        left
    }

    fn take(&mut self) {
        // Until what is on its way has taken over, what runs is not what a start is to go on from. What a node that was given up had
        // learned is not whole: the journal goes on from before.
        let is_fit = !self.control.is_on_the_way() && self.control.given_up().is_empty();
        let happenings = self.before + self.control.events();
        let mut taken = None;
        if is_fit && happenings > self.last {
            let replica = self.control.replica();
            taken = replica.map(|of| LeftState::of(of, happenings));
            taken = taken.or_else(|| self.left());
            if taken.is_none() {
                return;
            }
        }
        self.taken = Clock::now();
        if let Some(of) = taken.filter(|of| of.happenings > self.last) {
            self.held = Held::of(&of, &mut self.first);
            self.waiting = Some(Checkpoint::of_state(&of.state, of.happenings));
        }
    }

    fn save(&mut self) -> Result<(), CheckpointError> {
        if let Some(saved) = self.saving.take() {
            self.last = saved?;
        }
        // Where the one before is still being saved, the disk hangs, and this one waits.
        let is_safe = |of: &Checkpoint| {
            let is_synced = self.progress.synced_happenings() >= of.happenings;
            self.saving.is_free() && (is_synced || self.progress.is_degraded())
        };
        let Some(checkpoint) = self.waiting.take_if(|of| is_safe(of)) else {
            return Ok(());
        };
        let checkpoints = self.checkpoints.clone();
        self.saving.start(move || {
            let saved = checkpoints.save(&checkpoint);
            saved.map(|()| checkpoint.happenings)
        });
        Ok(())
    }
}

/// What a graph keeps of the past. While something needs a copy of it, that keeps as much again.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Held {
    /// How many bytes that is, as a checkpoint has them.
    pub bytes: u64,
    /// How many it will be once all windows are full, at the rate of ticks that this run has seen.
    pub full: u64,
    /// That rate, a second.
    pub rate: f64,
}

impl Held {
    fn of(left: &LeftState, first: &mut Option<(u64, Instant)>) -> Option<Self> {
        let (tick, last) = (left.state.tick(), left.last?);
        let (begin, since) = *first.get_or_insert((tick, last));
        let passed = (last - since).secs();
        if tick <= begin || passed <= 0.0 {
            return None;
        }
        let rate = (tick - begin) as f64 / passed;
        // What an earlier run kept came at this rate too, as far as is known.
        let span = Duration::from_secs_f64(tick as f64 / rate).unwrap_or(Duration::MAX);
        let (bytes, full) = left.state.held(&left.plan, span);
        Some(Self { bytes, full, rate })
    }
}

/// Why a graph does not take over.
#[derive(Debug)]
pub enum CommitError {
    /// It cannot be saved, so that no replay could let it take over.
    NotSaved(CheckpointError),
    /// The disk hangs, so that it cannot be saved.
    Hangs,
    /// Its model cannot be kept.
    NotKept(FolderError),
    /// It cannot take over.
    NotStaged(StageError),
    /// It was compared, and its error is larger by more than the margin.
    Worse {
        /// Its error relative to that of what runs.
        ratio: Option<f64>,
    },
}

impl std::fmt::Display for CommitError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::NotSaved(error) => error.fmt(f),
            Self::Hangs => f.write_str("the disk of the state hangs: try again once it does not"),
            Self::NotKept(error) => error.fmt(f),
            Self::NotStaged(error) => error.fmt(f),
            Self::Worse { ratio: Some(ratio) } => write!(
                f,
                "its error is {ratio:.3} times that of what runs, more than the margin allows"
            ),
            Self::Worse { ratio: None } => f.write_str("there was nothing to compare it by"),
        }
    }
}

impl std::error::Error for CommitError {}

from! { CommitError: CheckpointError => NotSaved, FolderError => NotKept, StageError => NotStaged }
