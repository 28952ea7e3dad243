//! Where the values of a plan lie between its steps.

use std::ops::Range;

use crate::channel::ABSENT;
use crate::node::SlotTime;
use crate::time::Instant;

/// One arena for all values of a plan, by slot number.
#[derive(Debug, Clone)]
pub struct Slots {
    /// The last value given; NaN where the last run gave none.
    pub(crate) values: Vec<f64>,
    /// When it was.
    pub(crate) given: Vec<SlotTime>,
    /// The number of the present tick, from 1.
    pub(crate) tick: u64,
}

impl Slots {
    pub(crate) fn new(count: usize) -> Self {
        Self {
            values: vec![ABSENT; count],
            given: vec![SlotTime::NEVER; count],
            tick: 0,
        }
    }

    #[inline]
    pub(crate) fn set(&mut self, slot: usize, value: f64, stamp: Instant) {
        self.values[slot] = value;
        self.given[slot] = SlotTime {
            stamp,
            tick: self.tick,
        };
    }

    /// Whether the slot was given something at the present tick, be it nothing.
    #[inline]
    pub(crate) fn ran(&self, slot: usize) -> bool {
        self.given[slot].tick == self.tick
    }

    /// The value that the slot was given at the present tick; NaN where its node did not run or gave nothing.
    #[inline]
    pub(crate) fn now(&self, slot: usize) -> f64 {
        if self.ran(slot) {
            self.values[slot]
        } else {
            f64::NAN
        }
    }

    /// Whether the slot has a new value at the present tick.
    #[inline]
    pub(crate) fn fresh(&self, slot: usize) -> bool {
        self.ran(slot) && !self.values[slot].is_nan()
    }

    /// When slots side by side were given their values, where all have one that was given at the same tick with the same stamp.
    #[inline]
    pub(crate) fn given_together(&self, range: Range<usize>) -> Option<SlotTime> {
        let first = *self.given.get(range.start)?;
        // Loops without a way out take several values at once.
        let (mut apart, mut late) = (0, 0);
        for given in &self.given[range.clone()] {
            apart |= given.stamp.as_ns() ^ first.stamp.as_ns();
            late |= given.tick ^ first.tick;
        }
        let lacks = self.values[range].iter();
        let lacks = lacks.fold(0, |lacks, value| lacks | u64::from(value.is_nan()));
        (late == 0 && apart == 0 && lacks == 0).then_some(first)
    }

    /// Nothing is held over into another segment.
    pub(crate) fn clear(&mut self) {
        self.values.fill(ABSENT);
        for given in &mut self.given {
            given.stamp = Instant::MIN;
        }
    }
}
