//! A log through an engine: the same bits as when it was written.

use std::sync::Arc;

use athermal_run::live::Feed;

use crate::channel::ABSENT;
use crate::engine::{Engine, EngineError};
use crate::journal::{Begin, FeedNames, Record, output_hash};
use crate::sequencer::Timeline;
use crate::time::Instant;

/// An engine that a log is applied to.
#[derive(Debug)]
pub struct Replay {
    engine: Engine,
    timeline: Timeline,
    feed: FeedNames,
    /// Where each channel that the engine reads stands in the feed.
    places: Vec<Option<usize>>,
    samples: Vec<f64>,
    stepped: u64,
    difference: Option<Difference>,
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
        let mut replay = Self {
            engine,
            timeline: begin.timeline(),
            feed: FeedNames::default(),
            places: Vec::new(),
            samples: Vec::new(),
            stepped: 0,
            difference: None,
        };
        replay.find_places(&begin.feed);
        replay
    }

    /// The next file begins. `has_gap`: records are missing before it, so that what waits is known from it alone.
    pub fn begin(&mut self, begin: &Begin, has_gap: bool) {
        if has_gap {
            self.timeline = begin.timeline();
        }
        if begin.feed != self.feed {
            self.find_places(&begin.feed);
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
                for (sample, place) in self.samples.iter_mut().zip(&self.places) {
                    *sample = place.map_or(ABSENT, |place| row[place]);
                }
                let outputs = self.engine.step(*at, &self.samples)?;
                if output_hash(outputs) != *hash && self.difference.is_none() {
                    self.difference = Some(Difference { event, at: *at });
                }
                self.stepped += 1;
                return Ok(true);
            }
            Record::Break { .. } => self.engine.segment(),
            Record::Freeze(frozen) => self.engine.freeze(*frozen),
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

    /// The engine.
    #[must_use]
    pub fn engine(&self) -> &Engine {
        &self.engine
    }

    /// What waits.
    #[must_use]
    pub fn timeline(&self) -> &Timeline {
        &self.timeline
    }

    /// Lets another engine go on.
    pub fn replace(&mut self, engine: Engine) {
        self.engine = engine;
        self.difference = None;
        let feed = std::mem::take(&mut self.feed);
        self.find_places(&feed);
    }

    /// The channels and sources of the log.
    #[must_use]
    pub fn feed(&self) -> &FeedNames {
        &self.feed
    }

    /// The engine.
    #[must_use]
    pub fn into_engine(self) -> Engine {
        self.engine
    }

    fn find_places(&mut self, feed: &FeedNames) {
        let plan = Arc::clone(self.engine.plan());
        let place = |of: &Feed| {
            let mut channels = feed.channels.iter();
            channels.position(|(name, column)| *name == of.name && *column == of.column)
        };
        self.places = Feed::of(&plan).iter().map(place).collect();
        self.samples = vec![ABSENT; self.places.len()];
        self.feed = feed.clone();
    }
}
