//! From what a state folder holds to where the service was: newest valid checkpoint, then the journal.

use std::sync::Arc;
use std::{fmt, io};

use athermal_run::live::Feed;
use athermal_run::model::Model;

use crate::checkpoint::{Checkpoint, CheckpointError, Checkpoints};
use crate::compile::Plan;
use crate::engine::{Engine, EngineError, StateTransfer};
use crate::folder::{StateFolder, StatePaths, may_pass};
use crate::journal::{Begin, Entry, FeedNames, Gap, JournalError, Log, Record, Torn};
use crate::replay::{Difference, NotStepped, Replay};
use crate::sequencer::Timeline;
use crate::time::Instant;

/// Where a service was when it ended.
#[derive(Debug)]
pub struct Recovered {
    /// The engine, as if it had not ended.
    pub engine: Engine,
    /// The model that it runs: the last one that took over, which need not be the one given.
    pub model: Model,
    /// What waits, and what has been stepped.
    pub timeline: Timeline,
    /// How it was found.
    pub report: RecoveryReport,
    feed: FeedNames,
    event: u64,
    happenings: u64,
    /// Whether the end of the journal could not be cut to what was read of it.
    is_unsealed: bool,
}

/// How a service was found.
#[derive(Debug, Default)]
pub struct RecoveryReport {
    /// Where it began.
    pub start: Start,
    /// Checkpoints that could not be used, newest first, and why.
    pub refused: Vec<CheckpointError>,
    /// How many ticks and beats were stepped again.
    pub stepped: u64,
    /// How many of those were beats.
    pub beats: u64,
    /// The damaged end of the journal, which has been cut off.
    pub torn: Option<Torn>,
    /// What was never written.
    pub gaps: Vec<Gap>,
    /// How many ticks, beats, breaks and freezes the journal lacks that the checkpoint has.
    pub ahead: u64,
    /// The first tick whose outputs differ from those in the journal.
    pub difference: Option<Difference>,
    /// The graphs that took over behind the checkpoint.
    pub swaps: Vec<String>,
}

/// Where a recovery began.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Start {
    /// There was nothing.
    #[default]
    Nothing,
    /// At the first tick of the journal.
    Beginning,
    /// At a checkpoint after so many ticks, beats, breaks and freezes.
    Checkpoint(u64),
    /// Cold, at the oldest tick that is still in the journal: no checkpoint could be used.
    Cold,
}

/// Why a service cannot go on from its state folder.
#[derive(Debug)]
pub enum RecoveryError {
    /// The journal cannot be read.
    Journal(JournalError),
    /// The checkpoints cannot be read.
    Checkpoints(CheckpointError),
    /// The engine refuses a tick of the journal.
    Engine {
        /// The number of its record.
        event: u64,
        /// Why.
        error: EngineError,
    },
    /// A graph that took over is not there any more.
    Model {
        /// Its revision.
        revision: String,
        /// Why.
        error: io::Error,
    },
    /// What was fitted does not belong to its graph.
    Unfit(EngineError),
}

impl fmt::Display for RecoveryError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Journal(error) => error.fmt(f),
            Self::Checkpoints(error) => error.fmt(f),
            Self::Engine { event, error } => {
                write!(
                    f,
                    "record {event} of the journal cannot be stepped: {error}"
                )
            }
            Self::Model { revision, error } => {
                write!(
                    f,
                    "the graph of revision {revision} cannot be read: {error}"
                )
            }
            Self::Unfit(error) => error.fmt(f),
        }
    }
}

impl std::error::Error for RecoveryError {}

from! { RecoveryError: JournalError => Journal, CheckpointError => Checkpoints }

impl From<NotStepped> for RecoveryError {
    fn from((event, error): NotStepped) -> Self {
        Self::Engine { event, error }
    }
}

impl Recovered {
    /// Finds where a service was. `model` is what is to run where there was nothing before, `feed` what it is given from now on, by the plan that
    /// runs.
    ///
    /// A checkpoint that cannot be used is passed over for an older one. The journal's damaged end is cut off. `look` sees each
    /// step that is made again, with how many ticks, beats, breaks and freezes there are then. `least` is up to where all sinks have
    /// put out: what lies behind is stepped again where the folder still allows it.
    ///
    /// # Errors
    /// When the journal is damaged elsewhere, or lacks something; what is there is as it was.
    pub fn find(
        folder: &StateFolder,
        checkpoints: &Checkpoints,
        model: &Model,
        feed: impl Fn(&Plan) -> FeedNames,
        least: u64,
        look: impl FnMut(u64, &Engine),
    ) -> Result<Self, RecoveryError> {
        Self::search((folder, true), checkpoints, Some(model), feed, least, look)
    }

    /// Steps all that a state folder has again behind so many ticks, beats, breaks and freezes, or from as early on as it allows, and
    /// changes nothing in it. None where it has no journal. `look` is as for [`find`](Self::find).
    ///
    /// # Errors
    /// As [`find`](Self::find).
    pub fn replay(
        folder: &StatePaths,
        least: u64,
        look: impl FnMut(u64, &Engine),
    ) -> Result<Option<Self>, RecoveryError> {
        if Log::open(&folder.journal())?.is_empty() {
            return Ok(None);
        }
        let checkpoints = Checkpoints::new(folder.checkpoints(), 1);
        let feed = |plan: &Plan| FeedNames::new(&Feed::of(plan), Vec::new());
        Self::search((folder, false), &checkpoints, None, feed, least, look).map(Some)
    }

    fn search(
        (folder, seals): (&StatePaths, bool),
        checkpoints: &Checkpoints,
        model: Option<&Model>,
        feed: impl Fn(&Plan) -> FeedNames,
        least: u64,
        mut look: impl FnMut(u64, &Engine),
    ) -> Result<Self, RecoveryError> {
        let mut report = RecoveryReport::default();
        let first = match Log::open(&folder.journal())?.read()? {
            Some(Entry::Begin(begin)) => Some(begin),
            _ => None,
        };
        let goes_back_to = first.as_ref().map_or(0, |begin| begin.happenings);
        let is_whole = first.as_ref().is_some_and(|of| of.happenings == 0);
        let mut found = None;
        for checkpoint in checkpoints.read()? {
            let usable = checkpoint.and_then(|of| usable(folder, model, of, goes_back_to));
            match usable {
                Ok(of) if of.2 <= least => {
                    found = Some(of);
                    break;
                }
                Ok(of) if !is_whole => found = Some(of),
                Ok(_) => {}
                Err(error) => report.refused.push(error),
            }
        }
        if let Some((engine, model, happenings)) = found {
            report.start = Start::Checkpoint(happenings);
            return Self::follow(
                (folder, seals),
                (engine, model),
                happenings,
                report,
                &feed,
                &mut look,
            );
        }
        let revision = first.as_ref().map(|begin| begin.revision.as_str());
        let given =
            model.filter(|of| revision.is_none_or(|it| of.revision().as_deref() == Some(it)));
        let model = match (given, revision) {
            (Some(model), _) => model.clone(),
            (None, revision) => {
                let revision = revision.unwrap_or_default();
                let of = folder.model(revision);
                of.map_err(|error| no_model(revision, error))?
            }
        };
        report.start = match &first {
            None => Start::Nothing,
            Some(_) if is_whole => Start::Beginning,
            Some(_) => Start::Cold,
        };
        let engine = Engine::new(Arc::clone(&model.plan), &model.fitted);
        let mut engine = engine.map_err(RecoveryError::Unfit)?;
        engine.isolate_panics();
        Self::follow(
            (folder, seals),
            (engine, model),
            goes_back_to,
            report,
            &feed,
            &mut look,
        )
    }

    /// What the next file of the journal begins with.
    #[must_use]
    pub fn begin(&self) -> Begin {
        let (revision, frozen) = (self.engine.revision().to_owned(), self.engine.frozen());
        let at = (self.event, self.happenings);
        let mut begin = Begin::new(self.feed.clone(), revision, at, frozen, &self.timeline);
        begin.after_failure = self.report.ahead > 0 || self.is_unsealed;
        begin
    }

    /// How many ticks, beats, breaks and freezes there were.
    #[must_use]
    pub fn happenings(&self) -> u64 {
        self.happenings
    }

    /// Steps what the journal has behind so many ticks, beats, breaks and freezes.
    fn follow(
        (folder, seals): (&StatePaths, bool),
        (engine, mut model): (Engine, Model),
        from: u64,
        mut report: RecoveryReport,
        feed: impl Fn(&Plan) -> FeedNames,
        look: &mut impl FnMut(u64, &Engine),
    ) -> Result<Self, RecoveryError> {
        let mut log = Log::open_at(&folder.journal(), from)?;
        let mut seen = 0;
        let mut replay = Replay::new(engine, &Begin::nothing());
        let known = folder.commits().since(from).map(|of| of.happenings).max();
        let mut committed = committed(folder, from);
        while let Some(entry) = log.read()? {
            let (event, record) = match entry {
                Entry::Begin(begin) => {
                    replay.catch_up(look)?;
                    replay.begin(&begin, log.gaps().len() > report.gaps.len());
                    report.gaps = log.gaps().to_vec();
                    seen = begin.happenings;
                    continue;
                }
                Entry::Record(event, record) => (event, record),
            };
            // A graph that was committed saw all that came between that and its taking over.
            while let Some((_, engine)) = committed.next_if(|(at, _)| *at <= seen) {
                replay.catch_up(look)?;
                replay.follow(engine);
            }
            seen += u64::from(record.is_happening());
            match record {
                Record::Swap { revision } if seen >= from => {
                    replay.catch_up(look)?;
                    let revision = format!("{revision:016x}");
                    let next = folder.model(&revision);
                    model = next.map_err(|error| no_model(&revision, error))?;
                    let next = match replay.followed(&revision) {
                        Some(next) => next,
                        // It was committed while this was on its way: whoever goes on from here knows of it.
                        None if is_known_now(folder, &revision, known.unwrap_or(from)) => break,
                        None => carried(replay.engine(), &model)?,
                    };
                    replay.replace(next);
                    report.swaps.push(revision);
                }
                _ if seen > from || seen == from && !record.is_happening() => {
                    replay.apply((event, seen), &record, look)?;
                }
                _ => replay.pass_by(&record),
            }
        }
        replay.catch_up(look)?;
        let is_unsealed = seals
            && match log.seal() {
                Err(JournalError::NotWritten { error, .. }) if may_pass(&error) => true,
                sealed => sealed.map(|()| false)?,
            };
        report.ahead = from.saturating_sub(seen);
        report.torn = log.torn().cloned();
        (report.stepped, report.beats) = (replay.stepped(), replay.beats());
        report.difference = replay.difference();
        let engine = replay.engine();
        let feed = feed(engine.plan());
        let mut timeline = replay.feed().map(replay.timeline(), &feed);
        let engine = replay.into_engine();
        if report.ahead > 0 {
            timeline.not_before(engine.last().unwrap_or(Instant::MIN));
        }
        Ok(Self {
            engine,
            model,
            timeline,
            feed,
            event: log.event() + report.ahead,
            happenings: seen.max(from),
            is_unsealed,
            report,
        })
    }
}

/// An engine that goes on from a checkpoint, the model of it, and how far it is.
fn usable(
    folder: &StatePaths,
    given: Option<&Model>,
    checkpoint: Checkpoint,
    goes_back_to: u64,
) -> Result<(Engine, Model, u64), CheckpointError> {
    let Checkpoint {
        happenings,
        revision,
        snapshot,
    } = checkpoint;
    let refused = |reason: String| CheckpointError::Refused {
        path: folder.path().to_owned(),
        reason: format!("the checkpoint at {happenings}: {reason}"),
    };
    if happenings < goes_back_to {
        return Err(refused("the journal no longer goes back to it".to_owned()));
    }
    let given = given.filter(|of| of.revision().as_deref() == Some(&revision));
    let model = match given {
        Some(given) => given.clone(),
        None => {
            let model = folder.model(&revision);
            model.map_err(|error| refused(error.to_string()))?
        }
    };
    let engine = Engine::new(Arc::clone(&model.plan), &model.fitted);
    let mut engine = engine.map_err(|error| refused(error.to_string()))?;
    engine.isolate_panics();
    let restored = engine.restore(&snapshot);
    restored.map_err(|error| refused(error.to_string()))?;
    Ok((engine, model, happenings))
}

fn no_model(revision: &str, error: impl fmt::Display) -> RecoveryError {
    RecoveryError::Model {
        revision: revision.to_owned(),
        error: io::Error::other(error.to_string()),
    }
}

/// Graphs as they were when they were committed, by after how many ticks, beats, breaks and freezes that was. One that cannot be read is
/// made anew where it took over.
fn committed(
    folder: &StatePaths,
    from: u64,
) -> std::iter::Peekable<impl Iterator<Item = (u64, Engine)>> {
    let commits = folder.commits().since(from);
    let folder = folder.clone();
    let engine = move |of: Checkpoint| {
        let (engine, _, happenings) = usable(&folder, None, of, 0).ok()?;
        Some((happenings, engine))
    };
    commits.filter_map(engine).peekable()
}

/// Whether a graph has been committed after so many ticks, beats, breaks and freezes.
fn is_known_now(folder: &StatePaths, revision: &str, after: u64) -> bool {
    let mut commits = folder.commits().since(after);
    commits.any(|of| of.revision == revision && of.happenings > after)
}

/// A graph that takes over from the state of another, without a past to warm it by.
fn carried(before: &Engine, model: &Model) -> Result<Engine, RecoveryError> {
    let next = Engine::new(Arc::clone(&model.plan), &model.fitted);
    let mut next = next.map_err(RecoveryError::Unfit)?;
    next.isolate_panics();
    let transfer = StateTransfer::between(before, &next, false);
    next.adopt(&before.state(), &transfer, false);
    Ok(next)
}
