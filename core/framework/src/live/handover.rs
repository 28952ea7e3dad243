//! Decides what passes between the engine thread and the control thread: ticks one way, engines both ways.

use crate::compile::Plan;
use crate::engine::Engine;
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
        let feed = |source: &crate::compile::SourceChannel| Self {
            name: source.name.clone(),
            column: source.column.clone(),
        };
        plan.sources.iter().map(feed).collect()
    }
}

/// An engine with all that it needs to take over, made off the engine thread.
#[derive(Debug)]
pub(super) struct Seated {
    pub(super) engine: Engine,
    pub(super) revision: String,
    /// For each channel that the engine reads, where its sample stands among those given.
    pub(super) places: Vec<usize>,
    /// The samples in the engine's own order.
    pub(super) samples: Vec<f64>,
    /// For each output, that of the engine before which it passes over from.
    pub(super) outputs: Vec<Option<usize>>,
    /// The number of the event, tick or segment break, up to which the engine has been taken.
    pub(super) event: u64,
    /// Whether it was sent back without having taken over.
    pub(super) refused: bool,
}

impl Seated {
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
            revision: engine.revision().to_owned(),
            samples: vec![f64::NAN; wanted.len()],
            places: places.into_iter().flatten().collect(),
            outputs: vec![None; engine.plan().outputs.len()],
            event,
            refused: false,
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

    /// The next tick belongs to another segment.
    pub(super) fn segment(&mut self) {
        self.engine.segment();
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

/// What stands for a segment break, in the place of a time.
const BREAK: f64 = f64::INFINITY;

/// An instant, or none for a segment break, as a number of the same bits.
pub(super) fn write_time(time: Option<Instant>) -> f64 {
    time.map_or(BREAK, |time| f64::from_bits(time.as_ns().cast_unsigned()))
}

/// The instant that was written as a number; none for a segment break.
pub(super) fn read_time(number: f64) -> Option<Instant> {
    let bits = number.to_bits();
    (bits != BREAK.to_bits()).then(|| Instant::from_ns(bits.cast_signed()))
}

/// What is mirrored of a tick or segment break beside the samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Mark {
    /// The instant; none for a segment break.
    pub(super) time: Option<Instant>,
    /// The number of the event, ticks and segment breaks counted alike.
    pub(super) event: u64,
    /// The number of ticks so far.
    pub(super) tick: u64,
    /// How many hand-overs there have been.
    pub(super) generation: u64,
}

impl Mark {
    /// How many numbers a mark takes.
    pub(super) const WIDTH: usize = 4;

    /// The mark as numbers: their bits carry integers, none of which is rounded.
    pub(super) fn write(self) -> [f64; Self::WIDTH] {
        let [event, tick, generation] =
            [self.event, self.tick, self.generation].map(f64::from_bits);
        [write_time(self.time), event, tick, generation]
    }

    pub(super) fn read([time, event, tick, generation]: [f64; Self::WIDTH]) -> Self {
        Self {
            time: read_time(time),
            event: event.to_bits(),
            tick: tick.to_bits(),
            generation: generation.to_bits(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_go_through_the_ring_to_the_last_bit() {
        for time in [
            None,
            Some(i64::MIN + 1),
            Some(-1),
            Some(0),
            Some(1_760_000_000_000_000_001),
        ] {
            let mark = Mark {
                time: time.map(Instant::from_ns),
                event: u64::MAX,
                tick: u64::MAX - 1,
                generation: 7,
            };
            assert_eq!(Mark::read(mark.write()), mark);
        }
    }
}
