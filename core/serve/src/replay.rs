//! A log through an engine: the same bits as when it was written.

use athermal_run::live::Feed;

use crate::channel::ABSENT;
use crate::compile::PlannedOutput;
use crate::engine::{Engine, EngineError};
use crate::journal::{Begin, FeedNames, Record, output_hash};
use crate::sequencer::Timeline;
use crate::time::Instant;

/// Ticks that are stepped together: where several engines follow each other, what one knows is brought into the caches once for them.
const TOGETHER: usize = 16;

/// An engine that a log is applied to. Ticks wait until there are several, or something else is to be done.
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
    /// Ticks that are to be stepped, and their rows.
    waiting: Vec<Waiting>,
    rows: Vec<f64>,
}

/// A tick of the log.
#[derive(Debug, Clone, Copy)]
struct Waiting {
    /// The number of its record, and how many happenings there were then.
    event: u64,
    happenings: u64,
    at: Instant,
    hash: u64,
}

/// A record that cannot be stepped, by its number, and why.
pub type NotStepped = (u64, EngineError);

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
    }

    /// Steps rows of the feed, one after the other.
    fn step(
        &mut self,
        ticks: &[Waiting],
        rows: &[f64],
        look: impl FnMut(&Engine, Instant),
    ) -> Result<(), EngineError> {
        self.samples.clear();
        for row in rows.chunks((rows.len() / ticks.len().max(1)).max(1)) {
            let sample = |place: &Option<usize>| place.map_or(ABSENT, |place| row[place]);
            self.samples.extend(self.places.iter().map(sample));
        }
        let width = self.places.len();
        let row = |nth: usize| &self.samples[nth * width..][..width];
        let rows = ticks.iter().enumerate().map(|(nth, of)| (of.at, row(nth)));
        self.engine.step_rows(rows, look)
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
            waiting: Vec::with_capacity(TOGETHER),
            rows: Vec::new(),
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

    /// Applies a record, after so many ticks, beats, breaks and freezes; `look` sees each step that is made, with how many of these there are
    /// then.
    ///
    /// # Errors
    /// When the engine refuses a tick.
    pub fn apply(
        &mut self,
        (event, happenings): (u64, u64),
        record: &Record,
        look: &mut impl FnMut(u64, &Engine),
    ) -> Result<(), NotStepped> {
        if let Record::Tick { at, hash } | Record::Beat { at, hash } = *record {
            self.rows.extend_from_slice(self.timeline.tick(at));
            self.waiting.push(Waiting {
                event,
                happenings,
                at,
                hash,
            });
            self.beats += u64::from(matches!(record, Record::Beat { .. }));
            return match self.waiting.len() < TOGETHER {
                true => Ok(()),
                false => self.catch_up(look),
            };
        }
        match record {
            Record::Break { .. } => {
                self.catch_up(look)?;
                self.all().for_each(|fed| fed.engine.segment());
            }
            Record::Freeze(frozen) => {
                self.catch_up(look)?;
                self.all().for_each(|fed| fed.engine.freeze(*frozen));
            }
            _ => {}
        }
        record.apply(&mut self.timeline);
        Ok(())
    }

    /// Steps the ticks that wait.
    ///
    /// # Errors
    /// As [`apply`](Self::apply).
    pub fn catch_up(&mut self, look: &mut impl FnMut(u64, &Engine)) -> Result<(), NotStepped> {
        let (ticks, rows) = (&*self.waiting, &*self.rows);
        self.beside
            .retain_mut(|fed| fed.step(ticks, rows, |_, _| ()).is_ok());
        let (mut left, difference) = (ticks.iter(), &mut self.difference);
        let stepped = self.runs.step(ticks, rows, |engine, at| {
            let Some(of) = left.next() else { return };
            if output_hash(engine.outputs()) != of.hash && difference.is_none() {
                *difference = Some(Difference {
                    event: of.event,
                    at,
                });
            }
            look(of.happenings, engine);
        });
        self.stepped += (ticks.len() - left.len()) as u64;
        let refused = left.next().map_or(0, |of| of.event);
        self.waiting.clear();
        self.rows.clear();
        stepped.map_err(|error| (refused, error))
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
