//! A log through an engine: the same bits as when it was written.

use athermal_run::live::Feed;

use crate::channel::ABSENT;
use crate::compile::PlannedOutput;
use crate::engine::{Engine, EngineError};
use crate::journal::{Begin, FeedNames, Record, output_hash};
use crate::sequencer::Timeline;
use crate::time::Instant;

/// An engine that a log is applied to.
#[derive(Debug)]
pub struct Replay {
    runs: Fed,
    /// Engines that may take over, and see all that the one that runs does.
    beside: Vec<Fed>,
    timeline: Timeline,
    feed: FeedNames,
    stepped: u64,
    beats: u64,
    difference: Option<Difference>,
}

/// An engine, and what it is given.
#[derive(Debug)]
struct Fed {
    engine: Engine,
    /// Where each channel that the engine reads stands in the feed.
    places: Vec<Option<usize>>,
    samples: Vec<f64>,
}

impl Fed {
    fn new(engine: Engine, feed: &FeedNames) -> Self {
        let mut fed = Self {
            engine,
            places: Vec::new(),
            samples: Vec::new(),
        };
        fed.find_places(feed);
        fed
    }

    fn find_places(&mut self, feed: &FeedNames) {
        let place = |of: &Feed| {
            let mut channels = feed.channels.iter();
            channels.position(|(name, column)| *name == of.name && *column == of.column)
        };
        self.places = Feed::of(self.engine.plan()).iter().map(place).collect();
        self.samples = vec![ABSENT; self.places.len()];
    }

    fn step(&mut self, at: Instant, row: &[f64]) -> Result<&[f64], EngineError> {
        for (sample, place) in self.samples.iter_mut().zip(&self.places) {
            *sample = place.map_or(ABSENT, |place| row[place]);
        }
        self.engine.step(at, &self.samples)
    }
}

/// The first tick whose outputs differ from those in the log.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Difference {
    /// The number of its record.
    pub event: u64,
    /// Its instant.
    pub at: Instant,
}

impl Replay {
    /// An engine at the beginning of a file of the log.
    #[must_use]
    pub fn new(engine: Engine, begin: &Begin) -> Self {
        Self {
            runs: Fed::new(engine, &begin.feed),
            beside: Vec::new(),
            timeline: begin.timeline(),
            feed: begin.feed.clone(),
            stepped: 0,
            beats: 0,
            difference: None,
        }
    }

    /// The next file begins. `has_gap`: records are missing before it, so that what waits is known from it alone.
    pub fn begin(&mut self, begin: &Begin, has_gap: bool) {
        if has_gap {
            self.timeline = begin.timeline();
        }
        if begin.feed != self.feed {
            self.feed.clone_from(&begin.feed);
            self.all().for_each(|fed| fed.find_places(&begin.feed));
            self.timeline = begin.timeline();
        }
    }

    /// Applies a record to what waits alone: the engine has seen it already.
    pub fn pass_by(&mut self, record: &Record) {
        record.apply(&mut self.timeline);
    }

    /// Applies a record. True where the engine made a step.
    ///
    /// # Errors
    /// When the engine refuses a tick.
    pub fn apply(&mut self, event: u64, record: &Record) -> Result<bool, EngineError> {
        match record {
            Record::Tick { at, hash } | Record::Beat { at, hash } => {
                let row = self.timeline.tick(*at);
                self.beside.retain_mut(|fed| fed.step(*at, row).is_ok());
                let outputs = self.runs.step(*at, row)?;
                if output_hash(outputs) != *hash && self.difference.is_none() {
                    self.difference = Some(Difference { event, at: *at });
                }
                self.stepped += 1;
                self.beats += u64::from(matches!(record, Record::Beat { .. }));
                return Ok(true);
            }
            Record::Break { .. } => self.all().for_each(|fed| fed.engine.segment()),
            Record::Freeze(frozen) => self.all().for_each(|fed| fed.engine.freeze(*frozen)),
            _ => {}
        }
        record.apply(&mut self.timeline);
        Ok(false)
    }

    /// The first difference so far.
    #[must_use]
    pub fn difference(&self) -> Option<Difference> {
        self.difference
    }

    /// How many ticks and beats were stepped.
    #[must_use]
    pub fn stepped(&self) -> u64 {
        self.stepped
    }

    /// How many of those were beats.
    #[must_use]
    pub fn beats(&self) -> u64 {
        self.beats
    }

    /// The engine.
    #[must_use]
    pub fn engine(&self) -> &Engine {
        &self.runs.engine
    }

    /// What waits.
    #[must_use]
    pub fn timeline(&self) -> &Timeline {
        &self.timeline
    }

    /// Lets an engine see all that the one that runs does from now on.
    pub fn follow(&mut self, engine: Engine) {
        self.beside.push(Fed::new(engine, &self.feed));
    }

    /// The engine of a revision that has followed, the last one where there are several. The others are let go.
    pub fn followed(&mut self, revision: &str) -> Option<Engine> {
        let mut beside = self.beside.drain(..).rev();
        let found = beside.find(|fed| fed.engine.revision() == revision);
        found.map(|fed| fed.engine)
    }

    /// Lets another engine go on, whose outputs pass over from those of the one that runs.
    pub fn replace(&mut self, mut engine: Engine) {
        let outputs = &self.runs.engine.plan().outputs;
        let place = |of: &PlannedOutput| outputs.iter().position(|output| output.name == of.name);
        let places: Vec<_> = engine.plan().outputs.iter().map(place).collect();
        engine.pass_over(&self.runs.engine, &places);
        self.runs = Fed::new(engine, &self.feed);
    }

    /// The channels and sources of the log.
    #[must_use]
    pub fn feed(&self) -> &FeedNames {
        &self.feed
    }

    /// The engine.
    #[must_use]
    pub fn into_engine(self) -> Engine {
        self.runs.engine
    }

    fn all(&mut self) -> impl Iterator<Item = &mut Fed> {
        std::iter::once(&mut self.runs).chain(&mut self.beside)
    }
}
