//! Decides what passes between the engine thread and the control thread: ticks one way, engines both ways.

use std::sync::Arc;

use super::tick_view::mirrored;
use crate::compile::{Plan, SourceChannel};
use crate::engine::{Engine, SampleRange};
use crate::time::Instant;

/// A channel that samples are given for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Feed {
    /// Signal and channel: `temperature.plate1`.
    pub name: String,
    /// Its column in tables.
    pub column: String,
}

impl Feed {
    /// What a plan reads.
    #[must_use]
    pub fn of(plan: &Plan) -> Vec<Self> {
        let feed = |source: &SourceChannel| Self {
            name: source.name.clone(),
            column: source.column.clone(),
        };
        plan.sources.iter().map(feed).collect()
    }

    /// The channel as a plan reads it, where it does.
    #[must_use]
    pub fn source<'a>(&self, plan: &'a Plan) -> Option<&'a SourceChannel> {
        let mut sources = plan.sources.iter();
        sources.find(|source| source.name == self.name && source.column == self.column)
    }
}

/// An engine with all that it needs to take over, made off the engine thread.
#[derive(Debug)]
pub(super) struct LiveEngine {
    pub(super) engine: Engine,
    /// What the engine thread steps of it.
    pub(super) plan: Arc<Plan>,
    pub(super) revision: String,
    /// For each channel that the engine reads, where its sample stands among those given.
    pub(super) places: Vec<usize>,
    /// The samples in the engine's own order.
    pub(super) samples: Vec<f64>,
    /// For each output, that of the engine before which it passes over from.
    pub(super) outputs: Vec<Option<usize>>,
    /// The number of the event up to which the engine has been taken.
    pub(super) event: u64,
    /// The slots that are mirrored with each tick.
    pub(super) shown: Arc<[usize]>,
    /// Where samples lay in its fit, as far as the control thread knows it.
    pub(super) usual: Vec<SampleRange>,
    /// Whether it was sent back without having taken over.
    pub(super) refused: bool,
    /// Whether it is a copy of what runs, for the control thread, which had missed something.
    pub(super) is_replica: bool,
}

impl LiveEngine {
    /// An engine that reads its channels among `feed`; the names of those that are not there otherwise.
    pub(super) fn new(engine: Engine, feed: &[Feed], event: u64) -> Result<Self, Vec<String>> {
        let wanted = Feed::of(engine.plan());
        let place = |channel: &Feed| feed.iter().position(|fed| fed == channel);
        let places: Vec<_> = wanted.iter().map(place).collect();
        let unplaced = wanted
            .iter()
            .zip(&places)
            .filter(|(_, place)| place.is_none());
        let missing: Vec<_> = unplaced.map(|(channel, _)| channel.name.clone()).collect();
        if !missing.is_empty() {
            return Err(missing);
        }
        Ok(Self {
            plan: Arc::clone(engine.plan()),
            revision: engine.revision().to_owned(),
            samples: vec![f64::NAN; wanted.len()],
            places: places.into_iter().flatten().collect(),
            outputs: vec![None; engine.plan().outputs.len()],
            event,
            shown: mirrored(engine.plan()),
            usual: Vec::new(),
            refused: false,
            is_replica: false,
            engine,
        })
    }

    /// Steps the engine with samples in the order of the feed.
    pub(super) fn step(
        &mut self,
        time: Instant,
        fed: &[f64],
    ) -> Result<(), crate::engine::EngineError> {
        for (sample, &place) in self.samples.iter_mut().zip(&self.places) {
            *sample = fed[place];
        }
        self.engine.step(time, &self.samples)?;
        self.event += 1;
        Ok(())
    }

    /// Computes more from now on, for whoever looks on; where that cannot be, it stays as it is.
    pub(super) fn look_into(&mut self) {
        if let Ok(engine) = self.engine.twin_on(&Arc::new(self.plan.looked_into())) {
            self.engine = engine;
        }
    }

    /// The next tick belongs to another segment.
    pub(super) fn segment(&mut self) {
        self.engine.segment();
        self.event += 1;
    }

    /// Freezes learning, or lets it go on.
    pub(super) fn freeze(&mut self, frozen: bool) {
        self.engine.freeze(frozen);
        self.event += 1;
    }

    /// Notes which outputs of another plan those of this one pass over from.
    pub(super) fn follow(&mut self, before: &Plan) {
        let old = &before.outputs;
        let place = |name: &String| old.iter().position(|output| output.name == *name);
        self.outputs = self
            .engine
            .plan()
            .outputs
            .iter()
            .map(|output| place(&output.name))
            .collect();
    }

    /// Lets outputs pass over from what another engine put out last, as [`follow`](Self::follow) noted.
    pub(super) fn take_over(&mut self, before: &Engine) {
        self.engine.pass_over(before, &self.outputs);
    }
}

/// What happens to an engine.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Happening {
    /// A tick.
    Tick(Instant),
    /// What follows belongs to another segment.
    Break,
    /// Learning is frozen, or goes on.
    Freeze(bool),
}

impl Happening {
    /// What stands for a happening without an instant: the bits of instants in the year 2262.
    const BREAK: u64 = f64::INFINITY.to_bits();
    const FROZEN: u64 = Self::BREAK - 1;
    const THAWED: u64 = Self::BREAK - 2;

    /// As a number: an instant has the bits that it has as an integer.
    pub(super) fn write(self) -> f64 {
        f64::from_bits(match self {
            Self::Tick(time) => time.as_ns().cast_unsigned(),
            Self::Break => Self::BREAK,
            Self::Freeze(true) => Self::FROZEN,
            Self::Freeze(false) => Self::THAWED,
        })
    }

    /// What was written as a number.
    pub(super) fn read(number: f64) -> Self {
        match number.to_bits() {
            Self::BREAK => Self::Break,
            Self::FROZEN => Self::Freeze(true),
            Self::THAWED => Self::Freeze(false),
            bits => Self::Tick(Instant::from_ns(bits.cast_signed())),
        }
    }
}

/// What is mirrored of a happening before the samples and what came of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Mark {
    /// What happened.
    pub(super) what: Happening,
    /// The number of the event, whatever happened.
    pub(super) event: u64,
    /// The number of ticks so far.
    pub(super) tick: u64,
    /// How many hand-overs there have been.
    pub(super) generation: u64,
    /// How many nodes have been given up.
    pub(super) given_up: u64,
    /// How many numbers follow: samples and what came of them.
    pub(super) width: u64,
}

impl Mark {
    /// How many numbers a mark takes.
    pub(super) const WIDTH: usize = 6;

    /// The mark as numbers: their bits carry integers, none of which is rounded.
    pub(super) fn write(self) -> [f64; Self::WIDTH] {
        let Self {
            event,
            tick,
            generation,
            given_up,
            width,
            ..
        } = self;
        let what = self.what.write().to_bits();
        [what, event, tick, generation, given_up, width].map(f64::from_bits)
    }

    pub(super) fn read(numbers: [f64; Self::WIDTH]) -> Self {
        let [_, event, tick, generation, given_up, width] = numbers.map(f64::to_bits);
        Self {
            what: Happening::read(numbers[0]),
            event,
            tick,
            generation,
            given_up,
            width,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_go_through_the_ring_to_the_last_bit() {
        let tick = |ns| Happening::Tick(Instant::from_ns(ns));
        for what in [
            Happening::Break,
            Happening::Freeze(true),
            Happening::Freeze(false),
            tick(i64::MIN + 1),
            tick(-1),
            tick(0),
            tick(1_760_000_000_000_000_001),
        ] {
            let mark = Mark {
                what,
                event: u64::MAX,
                tick: u64::MAX - 1,
                generation: 7,
                given_up: 1,
                width: 40,
            };
            assert_eq!(Mark::read(mark.write()), mark);
        }
    }
}
