//! Decides what a node sees of the slots that it reads: fresh or held, how old, how far back; not what it does with it.

use super::history::{Cursor, History};
use super::{Given, Slots};
use crate::channel::{ABSENT, UNCHANGED};
use crate::compile::{Conversion, Entry, Gather};
use crate::node::Read;
use crate::time::{Duration, Instant};

/// A bundle of slots as read at the present tick, side by side.
///
/// What a tick needs of the plan is copied here, so that it touches little memory.
#[derive(Debug, Clone)]
pub(crate) struct Gathered {
    /// The values; NaN where there is none.
    pub(crate) values: Box<[f64]>,
    /// Their stamps; of no meaning where there is no value.
    pub(crate) stamps: Box<[Instant]>,
    /// The oldest stamp, where all values are known to be there.
    whole: Option<Instant>,
    /// Whether all have that stamp.
    together: bool,
    /// Whether any of the slots, read without a lag, has a new value at this tick.
    pub(crate) fresh: bool,
    read: Read,
    /// The first slot, where all lie side by side and are read without a lag.
    side_by_side: Option<usize>,
    /// Otherwise places and slots of what is read without a lag.
    present: Box<[(usize, usize)]>,
    past: Option<Box<AllPast>>,
    conversions: Box<[Conversion]>,
    /// How long each of them counts, and how long any does at least.
    ages: Box<[Duration]>,
    shortest: Duration,
}

/// What is read with a lag.
#[derive(Debug, Clone)]
struct AllPast {
    of: Box<[Past]>,
    /// Until when all of it stays as it is.
    until: Instant,
    /// The oldest stamp, where all of it is there.
    whole: Option<Instant>,
}

/// A value that is read with a lag.
#[derive(Debug, Clone)]
struct Past {
    place: usize,
    entry: Entry,
    cursor: Cursor,
    /// Until when it stays as it is.
    until: Instant,
}

impl Gathered {
    pub(crate) fn new(gather: &Gather) -> Self {
        let width = gather.entries.len();
        let placed = || gather.entries.iter().copied().enumerate();
        let past: Box<[_]> = placed()
            .filter(|(_, entry)| !entry.lag.is_zero())
            .map(|(place, entry)| Past {
                place,
                entry,
                cursor: 0,
                until: Instant::MIN,
            })
            .collect();
        let present = placed().filter(|(_, entry)| entry.lag.is_zero());
        let side_by_side = side_by_side(&gather.entries);
        Self {
            values: vec![ABSENT; width].into(),
            stamps: vec![Instant::MIN; width].into(),
            whole: None,
            together: false,
            fresh: false,
            read: gather.read,
            side_by_side,
            present: match side_by_side {
                Some(_) => Box::default(),
                None => present.map(|(place, entry)| (place, entry.slot)).collect(),
            },
            past: (!past.is_empty()).then(|| Box::new(AllPast::new(past))),
            conversions: gather.conversions.clone().into(),
            ages: placed().map(|(_, entry)| entry.max_age).collect(),
            shortest: shortest(&gather.entries),
        }
    }

    /// Reads the slots as they stand now.
    #[inline]
    pub(crate) fn read(&mut self, slots: &Slots, histories: &[Option<History>], now: Instant) {
        match self.side_by_side {
            Some(first) => self.read_range(slots, first, now),
            None => self.read_apart(slots, histories, now),
        }
        for conversion in &self.conversions {
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
    fn read_range(&mut self, slots: &Slots, first: usize, now: Instant) {
        let range = first..first + self.values.len();
        let hides = |given: &Given| match self.read {
            Read::Fresh => given.tick < slots.tick,
            Read::Held | Read::Truth => given.stamp < now - self.shortest,
        };
        if let Some(given) = slots.given_together(range.clone())
            && !hides(&given)
        {
            self.values.copy_from_slice(&slots.values[range]);
            self.stamps.fill(given.stamp);
            self.fresh = given.tick == slots.tick;
            self.whole = Some(given.stamp);
            self.together = true;
            return;
        }
        self.whole = None;
        self.fresh = false;
        let from = slots.values[range.clone()].iter().zip(&slots.given[range]);
        let to = self.values.iter_mut().zip(&mut self.stamps);
        for ((to, (&value, given)), &max_age) in to.zip(from).zip(&self.ages) {
            let ran = given.tick == slots.tick;
            self.fresh |= ran && !value.is_nan();
            *to.0 = seen(value, self.read, ran, now - given.stamp, max_age);
            *to.1 = given.stamp;
        }
    }

    #[inline]
    fn read_apart(&mut self, slots: &Slots, histories: &[Option<History>], now: Instant) {
        let mut whole = (!self.values.is_empty()).then_some(Instant::MAX);
        if let Some(past) = &mut self.past {
            if now >= past.until {
                let converted = !self.conversions.is_empty();
                past.read(
                    &mut self.values,
                    &mut self.stamps,
                    histories,
                    now,
                    converted,
                );
            }
            whole = past.whole;
        }
        let present = &self.present;
        // Said once that both are of one length, each place is checked once.
        let (all, width) = (slots.values.len(), self.values.len());
        let (from, given) = (&slots.values[..all], &slots.given[..all]);
        let (values, stamps) = (&mut self.values[..width], &mut self.stamps[..width]);
        let (mut fresh, mut hidden, mut lacks, mut apart) = (false, false, false, 0);
        let oldest = match self.read {
            Read::Fresh => Instant::MIN,
            Read::Held | Read::Truth => now - self.shortest,
        };
        let first = present
            .first()
            .map_or(Instant::MAX, |&(_, slot)| given[slot].stamp);
        for &(place, slot) in present {
            let (value, given) = (from[slot], given[slot]);
            let (ran, there) = (given.tick == slots.tick, !value.is_nan());
            values[place] = value;
            stamps[place] = given.stamp;
            fresh |= ran & there;
            lacks |= !there;
            hidden |= (given.stamp < oldest) | (!ran & (self.read == Read::Fresh));
            apart |= given.stamp.as_ns() ^ first.as_ns();
        }
        self.fresh = fresh;
        self.together = self.past.is_none() && apart == 0;
        if lacks || hidden {
            self.whole = None;
        } else if apart == 0 {
            self.whole = whole.map(|of_past| of_past.min(first));
        } else {
            let stamps = present.iter().map(|&(place, _)| stamps[place]);
            self.whole = whole.map(|of_past| stamps.fold(of_past, Instant::min));
        }
        if hidden {
            for &(place, slot) in present {
                let (value, age) = (&mut values[place], now - stamps[place]);
                *value = seen(*value, self.read, slots.ran(slot), age, self.ages[place]);
            }
        }
    }

    /// The stamp of some of the values, where it is known without looking at each: all are there, and these are all or have all
    /// the same.
    #[inline]
    pub(crate) fn stamp_of(&self, count: usize) -> Option<Instant> {
        self.whole
            .filter(|_| self.together || count == self.values.len())
    }

    /// The oldest stamp among the values that are there.
    #[inline]
    pub(crate) fn oldest(&self) -> Option<Instant> {
        if self.whole.is_some() {
            return self.whole;
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
        if let Some(past) = &mut self.past {
            past.forget_places();
        }
    }

    /// Starts afresh for another segment.
    pub(crate) fn clear(&mut self) {
        self.values.fill(ABSENT);
        self.forget_places();
        self.fresh = false;
        self.whole = None;
    }
}

impl AllPast {
    fn new(of: Box<[Past]>) -> Self {
        Self {
            of,
            until: Instant::MIN,
            whole: None,
        }
    }

    #[inline(never)]
    fn read(
        &mut self,
        values: &mut [f64],
        stamps: &mut [Instant],
        histories: &[Option<History>],
        now: Instant,
        converted: bool,
    ) {
        self.until = Instant::MAX;
        self.whole = Some(Instant::MAX);
        for past in &mut self.of {
            let (entry, place) = (&past.entry, past.place);
            if now >= past.until {
                let history = histories[entry.slot]
                    .as_ref()
                    .expect("a slot that is read with a lag has a history");
                let (at, cursor) = (now - entry.lag, &mut past.cursor);
                let (value, stamp) = history.at(at, entry.max_age, cursor);
                values[place] = value;
                stamps[place] = stamp + entry.lag;
                // A value that is converted is read afresh, lest it be converted twice.
                past.until = if converted {
                    now
                } else {
                    history.stays(at, now, entry.max_age, *cursor) + entry.lag
                };
            }
            self.until = self.until.min(past.until);
            let there = !values[place].is_nan();
            self.whole = self
                .whole
                .filter(|_| there)
                .map(|oldest| oldest.min(stamps[place]));
        }
    }

    fn forget_places(&mut self) {
        for past in &mut self.of {
            past.cursor = 0;
            past.until = Instant::MIN;
        }
        self.until = Instant::MIN;
    }
}

/// What a reader sees of a slot: only what is new, or what is young enough.
fn seen(value: f64, read: Read, ran: bool, age: Duration, max_age: Duration) -> f64 {
    match read {
        Read::Fresh if !ran => UNCHANGED,
        Read::Held | Read::Truth if !value.is_nan() && age > max_age => ABSENT,
        _ => value,
    }
}

/// The first of slots that lie side by side, all of them read without a lag.
fn side_by_side(entries: &[Entry]) -> Option<usize> {
    let first = entries.first()?.slot;
    let in_place = |(i, entry): (usize, &Entry)| entry.slot == first + i && entry.lag.is_zero();
    let all = entries.iter().enumerate().all(in_place);
    all.then_some(first)
}

fn shortest(entries: &[Entry]) -> Duration {
    let ages = entries.iter().map(|entry| entry.max_age);
    ages.min().unwrap_or(Duration::MAX)
}
