//! A log through an engine: the same bits as when it was written.

use athermal_run::live::Feed;

use crate::channel::ABSENT;
use crate::engine::{Engine, EngineError};
use crate::journal::{Begin, FeedNames, Record, output_hash};
use crate::sequencer::Timeline;
use crate::time::Instant;

/// An engine that a log is applied to.
#[derive(Debug)]
pub struct Replay {
    running: Placed,
    /// A graph that had been handed over, and has not taken over yet.
    next: Option<Placed>,
    timeline: Timeline,
    feed: FeedNames,
    stepped: u64,
    difference: Option<Difference>,
}

/// An engine, and where what it reads stands in the feed.
#[derive(Debug)]
struct Placed {
    engine: Engine,
    places: Vec<Option<usize>>,
    samples: Vec<f64>,
}

impl Placed {
    fn new(engine: Engine, feed: &FeedNames) -> Self {
        let mut placed = Self {
            samples: Vec::new(),
            places: Vec::new(),
            engine,
        };
        placed.find(feed);
        placed
    }

    fn find(&mut self, feed: &FeedNames) {
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
            running: Placed::new(engine, &begin.feed),
            next: None,
            timeline: begin.timeline(),
            feed: begin.feed.clone(),
            stepped: 0,
            difference: None,
        }
    }

    /// The next file begins. `has_gap`: records are missing before it, so that what waits is known from it alone.
    pub fn begin(&mut self, begin: &Begin, has_gap: bool) {
        if has_gap {
            self.timeline = begin.timeline();
        }
        if begin.feed != self.feed {
            // What was on its way when the service ended never took over.
            self.next = None;
            self.feed = begin.feed.clone();
            self.timeline = begin.timeline();
            self.running.find(&self.feed);
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
                if let Some(next) = &mut self.next {
                    // One that does not step is not what took over.
                    let _ = next.step(*at, row);
                }
                let outputs = self.running.step(*at, row)?;
                if output_hash(outputs) != *hash && self.difference.is_none() {
                    self.difference = Some(Difference { event, at: *at });
                }
                self.stepped += 1;
                return Ok(true);
            }
            Record::Break { .. } => self.for_all(Engine::segment),
            Record::Freeze(frozen) => self.for_all(|engine| engine.freeze(*frozen)),
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
        &self.running.engine
    }

    /// What waits.
    #[must_use]
    pub fn timeline(&self) -> &Timeline {
        &self.timeline
    }

    /// An engine as it was when it was handed over here: it is stepped along until it takes over.
    pub fn hand_over(&mut self, mut engine: Engine) {
        engine.freeze(self.running.engine.frozen());
        self.next = Some(Placed::new(engine, &self.feed));
    }

    /// The engine that was handed over, if its graph is of this revision.
    pub fn handed_over(&mut self, revision: &str) -> Option<Engine> {
        let next = self.next.take_if(|of| of.engine.revision() == revision);
        next.map(|of| of.engine)
    }

    /// Lets another engine go on.
    pub fn replace(&mut self, engine: Engine) {
        self.running = Placed::new(engine, &self.feed);
    }

    /// The channels and sources of the log.
    #[must_use]
    pub fn feed(&self) -> &FeedNames {
        &self.feed
    }

    /// The engine.
    #[must_use]
    pub fn into_engine(self) -> Engine {
        self.running.engine
    }

    fn for_all(&mut self, act: impl Fn(&mut Engine)) {
        let next = self.next.iter_mut();
        std::iter::once(&mut self.running)
            .chain(next)
            .for_each(|of| act(&mut of.engine));
    }
}
