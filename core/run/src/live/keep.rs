//! What a graph at work leaves behind, so that another goes on from there.

use super::record::Record;
use super::sequencer::Timeline;
use crate::engine::Engine;
use crate::time::Instant;

/// What a graph at work leaves behind: files, or nothing. It is asked between two decisions, never waits, and asks for memory only where
/// it wants a checkpoint.
pub trait Keep {
    /// Takes a decision down. How many records there are then.
    fn record(&mut self, record: Record) -> u64;

    /// Takes down that all that waited up to an instant was stepped, or that time alone was, and what came of it. How many records there
    /// are then.
    fn tick(&mut self, at: Instant, is_beat: bool, outputs: &[f64]) -> u64;

    /// How many ticks, beats, breaks and freezes were taken down, those of earlier runs included.
    fn happenings(&self) -> u64;

    /// Lets what was taken down last, soon.
    fn sync(&mut self);

    /// All that was due is done, and where what waits stands then.
    fn passed(&mut self, has_ticked: bool, timeline: &Timeline);

    /// Whether it is time for a [checkpoint](Self::checkpoint).
    fn wants_checkpoint(&self) -> bool;

    /// Takes what an engine knows, after all that was taken down.
    fn checkpoint(&mut self, engine: &Engine);
}

/// Nothing is left behind.
impl Keep for () {
    fn record(&mut self, _: Record) -> u64 {
        0
    }

    fn tick(&mut self, _: Instant, _: bool, _: &[f64]) -> u64 {
        0
    }

    fn happenings(&self) -> u64 {
        0
    }

    fn sync(&mut self) {}

    fn passed(&mut self, _: bool, _: &Timeline) {}

    fn wants_checkpoint(&self) -> bool {
        false
    }

    fn checkpoint(&mut self, _: &Engine) {}
}
