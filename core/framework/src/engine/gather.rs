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
    /// The stamp of all values, where all are there, have the same, and lie side by side.
    pub(crate) together: Option<Instant>,
    cursors: Vec<Cursor>,
    /// Until when each value that is read with a lag stays as it is.
    until: Vec<Instant>,
    /// The slots, where they lie side by side and none is read with a lag.
    side_by_side: Option<Range<usize>>,
    /// How long any of them counts at least.
    shortest: Duration,
}

impl Gathered {
    pub(crate) fn new(gather: &Gather) -> Self {
        let width = gather.entries.len();
        Self {
            values: vec![ABSENT; width],
            stamps: vec![Instant::MIN; width],
            fresh: false,
            together: None,
            cursors: vec![0; width],
            until: vec![Instant::MIN; width],
            side_by_side: side_by_side(&gather.entries),
            shortest: shortest(&gather.entries),
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

    /// A whole port, as it is most often read. It has loops of its own since it is the widest of a tick.
    fn read_range(&mut self, gather: &Gather, slots: &Slots, range: Range<usize>, now: Instant) {
        let tick = slots.tick;
        let (values, written) = (&slots.values[range.clone()], &slots.written[range.clone()]);
        self.values.copy_from_slice(values);
        self.stamps.copy_from_slice(&slots.stamps[range]);
        let first = self.stamps.first().copied().unwrap_or(Instant::MIN);
        let oldest = now - self.shortest;
        let (mut fresh, mut all_ran, mut old) = (false, true, false);
        let (mut whole, mut same) = (true, true);
        for ((value, &written), &stamp) in values.iter().zip(written).zip(&self.stamps) {
            let (there, ran) = (!value.is_nan(), written == tick);
            fresh |= ran & there;
            all_ran &= ran;
            old |= stamp < oldest;
            whole &= there;
            same &= stamp == first;
        }
        let some_hidden = match gather.read {
            Read::Fresh => !all_ran,
            Read::Held | Read::Truth => old,
        };
        if some_hidden {
            whole = false;
            let from = written.iter().zip(&self.stamps).zip(&gather.entries);
            for (value, ((&written, &stamp), entry)) in self.values.iter_mut().zip(from) {
                *value = seen(*value, gather.read, written == tick, now - stamp, entry);
            }
        }
        self.fresh = fresh;
        self.together = (whole && same).then_some(first);
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
                if now >= self.until[i] {
                    self.read_past(i, gather, histories, now);
                }
                continue;
            }
            let (value, stamp) = (slots.values[entry.slot], slots.stamps[entry.slot]);
            let (there, ran) = (!value.is_nan(), slots.ran(entry.slot));
            self.fresh |= ran && there;
            self.values[i] = seen(value, gather.read, ran, now - stamp, entry);
            self.stamps[i] = stamp;
        }
    }

    fn read_past(
        &mut self,
        i: usize,
        gather: &Gather,
        histories: &[Option<History>],
        now: Instant,
    ) {
        let entry = &gather.entries[i];
        let history = histories[entry.slot]
            .as_ref()
            .expect("a slot that is read with a lag has a history");
        let (at, cursor) = (now - entry.lag, &mut self.cursors[i]);
        let (value, stamp) = history.at(at, entry.max_age, cursor);
        self.values[i] = value;
        self.stamps[i] = stamp + entry.lag;
        // A value that is converted is read afresh, lest it be converted twice.
        self.until[i] = if gather.conversions.is_empty() {
            history.stays(at, now, entry.max_age, *cursor) + entry.lag
        } else {
            now
        };
    }

    /// The oldest stamp among the values that are there.
    pub(crate) fn oldest(&self) -> Option<Instant> {
        if self.together.is_some() {
            return self.together;
        }
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
        self.until.fill(Instant::MIN);
    }

    /// Starts afresh for another segment.
    pub(crate) fn clear(&mut self) {
        self.values.fill(ABSENT);
        self.forget_places();
        self.fresh = false;
        self.together = None;
    }
}

/// What a reader sees of a slot: only what is new, or what is young enough.
fn seen(value: f64, read: Read, ran: bool, age: Duration, entry: &Entry) -> f64 {
    match read {
        Read::Fresh if !ran => UNCHANGED,
        Read::Held | Read::Truth if !value.is_nan() && age > entry.max_age => ABSENT,
        _ => value,
    }
}

fn side_by_side(entries: &[Entry]) -> Option<Range<usize>> {
    let first = entries.first()?.slot;
    let in_place = |(i, entry): (usize, &Entry)| entry.slot == first + i && entry.lag.is_zero();
    let all = entries.iter().enumerate().all(in_place);
    all.then_some(first..first + entries.len())
}

fn shortest(entries: &[Entry]) -> Duration {
    let ages = entries.iter().map(|entry| entry.max_age);
    ages.min().unwrap_or(Duration::MAX)
}
