//! Decides what a node sees of the slots that it reads: fresh or held, how old, how far back; not what it does with it.

use std::ops::Range;

use super::Slots;
use super::history::{Cursor, History};
use crate::channel::{ABSENT, UNCHANGED};
use crate::compile::{Entry, Gather};
use crate::node::Read;
use crate::time::{Duration, Instant};

/// A bundle of slots as read at the present tick, side by side.
#[derive(Debug, Clone)]
pub(crate) struct Gathered {
    /// The values; NaN where there is none.
    pub(crate) values: Vec<f64>,
    /// Their stamps; of no meaning where there is no value.
    pub(crate) stamps: Vec<Instant>,
    /// Whether any of the slots, read without a lag, has a new value at this tick.
    pub(crate) fresh: bool,
    cursors: Vec<Cursor>,
    /// The slots, where they lie side by side and none is read with a lag.
    side_by_side: Option<Range<usize>>,
}

impl Gathered {
    pub(crate) fn new(gather: &Gather) -> Self {
        let width = gather.entries.len();
        Self {
            values: vec![ABSENT; width],
            stamps: vec![Instant::MIN; width],
            fresh: false,
            cursors: vec![0; width],
            side_by_side: side_by_side(&gather.entries),
        }
    }

    /// Reads the slots as they stand now.
    pub(crate) fn read(
        &mut self,
        gather: &Gather,
        slots: &Slots,
        histories: &[Option<History>],
        now: Instant,
    ) {
        match self.side_by_side.clone() {
            Some(range) => self.read_range(gather, slots, range, now),
            None => self.read_each(gather, slots, histories, now),
        }
        for conversion in &gather.conversions {
            let value = &mut self.values[conversion.entry];
            // A NaN says why there is no value, and must stay as it is.
            if !value.is_nan() {
                *value *= conversion.factor();
            }
        }
    }

    /// A whole port, as it is most often read. It has a loop of its own since it is the widest of a tick.
    fn read_range(&mut self, gather: &Gather, slots: &Slots, range: Range<usize>, now: Instant) {
        let tick = slots.tick;
        let (values, written) = (&slots.values[range.clone()], &slots.written[range.clone()]);
        self.stamps.copy_from_slice(&slots.stamps[range]);
        let from = values.iter().zip(written).zip(&self.stamps);
        let to = self.values.iter_mut().zip(&gather.entries);
        let mut fresh = false;
        for ((to, entry), ((&value, &written), &stamp)) in to.zip(from) {
            fresh |= written == tick && !value.is_nan();
            *to = seen(gather.read, entry, value, written == tick, now - stamp);
        }
        self.fresh = fresh;
    }

    fn read_each(
        &mut self,
        gather: &Gather,
        slots: &Slots,
        histories: &[Option<History>],
        now: Instant,
    ) {
        self.fresh = false;
        for (i, entry) in gather.entries.iter().enumerate() {
            if entry.lag > Duration::ZERO {
                self.read_past(i, entry, histories, now);
                continue;
            }
            let (value, stamp) = (slots.values[entry.slot], slots.stamps[entry.slot]);
            let ran = slots.ran(entry.slot);
            self.fresh |= ran && !value.is_nan();
            self.values[i] = seen(gather.read, entry, value, ran, now - stamp);
            self.stamps[i] = stamp;
        }
    }

    fn read_past(&mut self, i: usize, entry: &Entry, histories: &[Option<History>], now: Instant) {
        let history = histories[entry.slot]
            .as_ref()
            .expect("a slot that is read with a lag has a history");
        let (value, stamp) = history.at(now - entry.lag, entry.max_age, &mut self.cursors[i]);
        self.values[i] = value;
        self.stamps[i] = stamp + entry.lag;
    }

    /// The oldest stamp among the values that are there.
    pub(crate) fn oldest(&self) -> Option<Instant> {
        let present = self
            .values
            .iter()
            .zip(&self.stamps)
            .filter(|(value, _)| !value.is_nan());
        present.map(|(_, &stamp)| stamp).min()
    }

    /// Looks its places in histories up anew: they are not those that it read from before.
    pub(crate) fn forget_places(&mut self) {
        self.cursors.fill(0);
    }

    /// Starts afresh for another segment.
    pub(crate) fn clear(&mut self) {
        self.values.fill(ABSENT);
        self.cursors.fill(0);
        self.fresh = false;
    }
}

fn side_by_side(entries: &[Entry]) -> Option<Range<usize>> {
    let first = entries.first()?.slot;
    let in_place = |(i, entry): (usize, &Entry)| entry.slot == first + i && entry.lag.is_zero();
    let all = entries.iter().enumerate().all(in_place);
    all.then_some(first..first + entries.len())
}

/// What a reader without a lag sees of a slot.
#[inline]
fn seen(read: Read, entry: &Entry, value: f64, ran: bool, age: Duration) -> f64 {
    match read {
        Read::Fresh if !ran => UNCHANGED,
        Read::Fresh => value,
        Read::Held | Read::Truth if !value.is_nan() && age > entry.max_age => ABSENT,
        Read::Held | Read::Truth => value,
    }
}
