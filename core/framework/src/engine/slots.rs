//! Decides where the values of a plan lie between its steps.

use crate::channel::ABSENT;
use crate::time::Instant;

/// One arena for all values of a plan, by slot number.
#[derive(Debug, Clone)]
pub(crate) struct Slots {
    /// The last value given; NaN where the last run gave none.
    pub(crate) values: Vec<f64>,
    /// The stamp of the value.
    pub(crate) stamps: Vec<Instant>,
    /// The number of the tick at which the slot was last given something, be it nothing.
    pub(crate) written: Vec<u64>,
    /// The number of the present tick, from 1.
    pub(crate) tick: u64,
}

impl Slots {
    pub(crate) fn new(count: usize) -> Self {
        Self {
            values: vec![ABSENT; count],
            stamps: vec![Instant::MIN; count],
            written: vec![0; count],
            tick: 0,
        }
    }

    pub(crate) fn set(&mut self, slot: usize, value: f64, stamp: Instant) {
        self.values[slot] = value;
        self.stamps[slot] = stamp;
        self.written[slot] = self.tick;
    }

    /// Whether the slot was given something at the present tick, be it nothing.
    pub(crate) fn ran(&self, slot: usize) -> bool {
        self.written[slot] == self.tick
    }

    /// Whether the slot has a new value at the present tick.
    pub(crate) fn fresh(&self, slot: usize) -> bool {
        self.ran(slot) && !self.values[slot].is_nan()
    }

    /// Nothing is held over into another segment.
    pub(crate) fn clear(&mut self) {
        self.values.fill(ABSENT);
        self.stamps.fill(Instant::MIN);
    }
}
