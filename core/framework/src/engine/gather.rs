//! Decides what a node sees of the slots that it reads: fresh or held, how old, how far back; not what it does with it.

use std::ops::Range;

use super::history::{Cursor, History};
use super::{Given, Slots};
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
    /// The stamp of all values, where all are there, have the same, and none is read with a lag.
    pub(crate) together: Option<Instant>,
    /// The slots, where they lie side by side and none is read with a lag.
    side_by_side: Option<Range<usize>>,
    /// Places and slots of what is read without a lag.
    present: Vec<(usize, usize)>,
    /// What is read with a lag.
    past: Vec<Past>,
    /// Until when all that is read with a lag stays as it is.
    until: Instant,
    /// How long any of them counts at least.
    shortest: Duration,
}

/// A value that is read with a lag.
#[derive(Debug, Clone)]
struct Past {
    place: usize,
    cursor: Cursor,
    /// Until when it stays as it is.
    until: Instant,
}

impl Gathered {
    pub(crate) fn new(gather: &Gather) -> Self {
        let width = gather.entries.len();
        let (present, past): (Vec<_>, Vec<_>) = gather
            .entries
            .iter()
            .enumerate()
            .partition(|(_, entry)| entry.lag.is_zero());
        Self {
            values: vec![ABSENT; width],
            stamps: vec![Instant::MIN; width],
            fresh: false,
            together: None,
            side_by_side: side_by_side(&gather.entries),
            present: present
                .iter()
                .map(|&(place, entry)| (place, entry.slot))
                .collect(),
            past: past
                .iter()
                .map(|&(place, _)| Past {
                    place,
                    cursor: 0,
                    until: Instant::MIN,
                })
                .collect(),
            until: Instant::MIN,
            shortest: shortest(&gather.entries),
        }
    }

    /// Reads the slots as they stand now.
    #[inline]
    pub(crate) fn read(
        &mut self,
        gather: &Gather,
        slots: &Slots,
        histories: &[Option<History>],
        now: Instant,
    ) {
        match &self.side_by_side {
            Some(range) => self.read_range(gather, slots, range.clone(), now),
            None => {
                if now >= self.until {
                    self.read_past(gather, histories, now);
                }
                self.read_present(gather, slots, now);
            }
        }
        for conversion in &gather.conversions {
            let value = &mut self.values[conversion.entry];
            // A NaN says why there is no value, and must stay as it is.
            if !value.is_nan() {
                *value *= conversion.factor();
            }
        }
    }

    /// A whole port, as it is most often read. What nearly always holds of all its values is looked at first, since a port may
    /// be wide.
    #[inline(never)]
    fn read_range(&mut self, gather: &Gather, slots: &Slots, range: Range<usize>, now: Instant) {
        let hides = |given: &Given| match gather.read {
            Read::Fresh => given.tick < slots.tick,
            Read::Held | Read::Truth => given.stamp < now - self.shortest,
        };
        if let Some(given) = slots.given_together(range.clone())
            && !hides(&given)
        {
            self.values.copy_from_slice(&slots.values[range]);
            self.stamps.fill(given.stamp);
            self.fresh = given.tick == slots.tick;
            self.together = Some(given.stamp);
            return;
        }
        self.together = None;
        self.fresh = false;
        let from = slots.values[range.clone()].iter().zip(&slots.given[range]);
        let to = self.values.iter_mut().zip(&mut self.stamps);
        for ((to, (&value, given)), entry) in to.zip(from).zip(&gather.entries) {
            let ran = given.tick == slots.tick;
            self.fresh |= ran && !value.is_nan();
            *to.0 = seen(value, gather.read, ran, now - given.stamp, entry);
            *to.1 = given.stamp;
        }
    }

    #[inline]
    fn read_present(&mut self, gather: &Gather, slots: &Slots, now: Instant) {
        let oldest = now - self.shortest;
        let (mut fresh, mut late, mut old) = (false, false, false);
        let (mut whole, mut same) = (self.past.is_empty(), true);
        let mut first = None;
        for &(place, slot) in &self.present {
            let (value, given) = (slots.values[slot], slots.given[slot]);
            let ran = given.tick == slots.tick;
            let there = !value.is_nan();
            fresh |= ran & there;
            late |= !ran;
            old |= given.stamp < oldest;
            whole &= there;
            same &= *first.get_or_insert(given.stamp) == given.stamp;
            self.values[place] = value;
            self.stamps[place] = given.stamp;
        }
        self.fresh = fresh;
        let some_hidden = match gather.read {
            Read::Fresh => late,
            Read::Held | Read::Truth => old,
        };
        self.together = first.filter(|_| whole && same && !some_hidden);
        if some_hidden {
            for &(place, slot) in &self.present {
                let (value, age) = (&mut self.values[place], now - self.stamps[place]);
                let entry = &gather.entries[place];
                *value = seen(*value, gather.read, slots.ran(slot), age, entry);
            }
        }
    }

    #[inline(never)]
    fn read_past(&mut self, gather: &Gather, histories: &[Option<History>], now: Instant) {
        self.until = Instant::MAX;
        for past in &mut self.past {
            if now >= past.until {
                let entry = &gather.entries[past.place];
                let history = histories[entry.slot]
                    .as_ref()
                    .expect("a slot that is read with a lag has a history");
                let (at, cursor) = (now - entry.lag, &mut past.cursor);
                let (value, stamp) = history.at(at, entry.max_age, cursor);
                self.values[past.place] = value;
                self.stamps[past.place] = stamp + entry.lag;
                // A value that is converted is read afresh, lest it be converted twice.
                past.until = if gather.conversions.is_empty() {
                    history.stays(at, now, entry.max_age, *cursor) + entry.lag
                } else {
                    now
                };
            }
            self.until = self.until.min(past.until);
        }
    }

    /// The oldest stamp among the values that are there.
    #[inline]
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
        for past in &mut self.past {
            past.cursor = 0;
            past.until = Instant::MIN;
        }
        self.until = Instant::MIN;
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
