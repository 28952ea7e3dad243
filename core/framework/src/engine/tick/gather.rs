//! What a node sees of the slots that it reads: fresh or held, how old, how far back.

use super::history::{Cursor, History};
use super::slots::Slots;
use crate::channel::{ABSENT, UNCHANGED};
use crate::compile::{Conversion, Entry, Gather};
use crate::node::{PortValues, Read, SlotTime};
use crate::time::{Duration, Instant};

/// A bundle of slots as read at the present tick, side by side. What stays as it is lies in the plan, which engines share.
#[derive(Debug, Clone)]
pub struct Gathered {
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
    /// Whether one whose value would be held ran and gave nothing, which ends the hold.
    pub(crate) ended: bool,
    read: Read,
    /// Whether some are converted, or do not age what is made of them.
    changes: bool,
    origin: Origin,
    /// How long any of them counts at least.
    shortest: Duration,
}

/// Where the values of a gather are from.
#[derive(Debug, Clone)]
enum Origin {
    /// Slots side by side, of which this is the first, without a lag.
    SideBySide(usize),
    /// Slots without a lag.
    Apart,
    /// Slots of which some are read with a lag.
    Past(Box<AllPast>),
}

impl Origin {
    fn new(entries: &[Entry], with_history: &[usize]) -> Self {
        if let Some(first) = side_by_side(entries) {
            return Self::SideBySide(first);
        }
        if entries.iter().all(|entry| entry.lag.is_zero()) {
            return Self::Apart;
        }
        Self::Past(Box::new(AllPast::new(entries, with_history)))
    }
}

/// What is read with a lag, and what beside it.
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
    /// Its place in the gather, and that of its slot among those that have a history.
    place: u32,
    history: u32,
    cursor: Cursor,
    /// Until when it stays as it is.
    until: Instant,
}

/// What is known of values that have been looked at.
struct Glance {
    /// Whether one was given at the present tick, whether one ran and gave nothing, and whether one did not run.
    fresh: bool,
    ended: bool,
    late: bool,
    /// Whether one is not there.
    lacks: bool,
    oldest: Instant,
    newest: Instant,
}

impl Glance {
    const NOTHING: Self = Self {
        fresh: false,
        ended: false,
        late: false,
        lacks: false,
        oldest: Instant::MAX,
        newest: Instant::MIN,
    };

    #[inline(always)]
    fn add(&mut self, value: f64, given: &SlotTime, tick: u64) {
        let (ran, there) = (given.tick == tick, !value.is_nan());
        self.fresh |= ran & there;
        self.ended |= ran & !there;
        self.late |= !ran;
        self.lacks |= !there;
        self.oldest = self.oldest.min(given.stamp);
        self.newest = self.newest.max(given.stamp);
    }
}

impl PortValues for &[Gathered] {
    #[inline]
    fn values(&self, bundle: usize) -> &[f64] {
        &self[bundle].values
    }

    #[inline]
    fn stamps(&self, bundle: usize) -> &[Instant] {
        &self[bundle].stamps
    }
}

impl Gathered {
    /// Of a gather, nothing yet; `with_history` are the slots that have one.
    pub(crate) fn new(gather: &Gather, with_history: &[usize]) -> Self {
        let width = gather.entries.len();
        Self {
            values: vec![ABSENT; width].into(),
            stamps: vec![Instant::MIN; width].into(),
            whole: None,
            together: false,
            fresh: false,
            ended: false,
            read: gather.read,
            changes: !(gather.conversions.is_empty() && gather.rare.is_empty()),
            origin: Origin::new(&gather.entries, with_history),
            shortest: shortest(&gather.entries),
        }
    }

    /// Reads the slots of its gather as they stand now.
    #[inline]
    pub(crate) fn read(&mut self, of: &Gather, slots: &Slots, histories: &[History], now: Instant) {
        match self.origin {
            Origin::SideBySide(first) => self.read_side_by_side(of, slots, first, now),
            Origin::Apart => self.read_apart(of, slots, now),
            Origin::Past(_) => self.read_past(of, slots, histories, now),
        }
        if self.changes {
            self.convert(&of.conversions);
            self.spare(&of.rare, now);
        }
    }

    /// Takes what is rare and not too old for new: whoever reads what is made of it would take nothing so old.
    #[inline(never)]
    fn spare(&mut self, rare: &[(usize, Duration)], now: Instant) {
        if rare.is_empty() {
            return;
        }
        for &(place, age) in rare {
            let stamp = &mut self.stamps[place];
            if now - *stamp <= age {
                *stamp = now;
            }
        }
        self.together = false;
        self.whole = self.whole.and_then(|_| self.stamps.iter().copied().min());
    }

    #[inline(never)]
    fn convert(&mut self, conversions: &[Conversion]) {
        for conversion in conversions {
            let value = &mut self.values[conversion.entry];
            // A NaN carries the reason why there is no value, and must stay as it is.
            if !value.is_nan() {
                *value *= conversion.factor();
            }
        }
    }

    /// A whole port, as it is most often read. What nearly always holds of all its values is looked at first, since a port may
    /// be wide.
    #[inline(never)]
    fn read_side_by_side(&mut self, of: &Gather, slots: &Slots, first: usize, now: Instant) {
        let range = first..first + self.values.len();
        let hides = |given: &SlotTime| match self.read {
            Read::Fresh => given.tick < slots.tick,
            Read::Held | Read::Truth => given.stamp < now - self.shortest,
        };
        if let Some(given) = slots.given_together(range.clone())
            && !hides(&given)
        {
            self.values.copy_from_slice(&slots.values[range]);
            self.stamps.fill(given.stamp);
            self.fresh = given.tick == slots.tick;
            self.ended = false;
            self.whole = Some(given.stamp);
            self.together = true;
            return;
        }
        self.whole = None;
        self.fresh = false;
        self.ended = false;
        let from = slots.values[range.clone()].iter().zip(&slots.given[range]);
        let to = self.values.iter_mut().zip(&mut self.stamps);
        for ((to, (&value, given)), entry) in to.zip(from).zip(&of.entries) {
            let ran = given.tick == slots.tick;
            self.fresh |= ran && !value.is_nan();
            self.ended |= ran && value.is_nan();
            *to.0 = seen(value, self.read, ran, now - given.stamp, entry.max_age);
            *to.1 = given.stamp;
        }
        self.ended &= self.read == Read::Held;
    }

    #[inline(never)]
    fn read_apart(&mut self, of: &Gather, slots: &Slots, now: Instant) {
        let mut glance = Glance::NOTHING;
        let to = self.values.iter_mut().zip(&mut self.stamps);
        for ((value, stamp), &Entry { slot, .. }) in to.zip(&of.entries) {
            let (last, given) = (slots.values[slot], &slots.given[slot]);
            (*value, *stamp) = (last, given.stamp);
            glance.add(last, given, slots.tick);
        }
        self.together = glance.oldest == glance.newest;
        let nothing = of.entries.is_empty();
        self.take(of, &glance, (!nothing).then_some(Instant::MAX), slots, now);
    }

    #[inline(never)]
    fn read_past(&mut self, of: &Gather, slots: &Slots, histories: &[History], now: Instant) {
        let Origin::Past(past) = &mut self.origin else {
            return;
        };
        let (values, stamps) = (&mut *self.values, &mut *self.stamps);
        if now >= past.until {
            past.read(of, values, stamps, histories, now, self.changes);
        }
        let mut glance = Glance::NOTHING;
        for (place, slot) in present(of) {
            let (value, given) = (slots.values[slot], &slots.given[slot]);
            (values[place], stamps[place]) = (value, given.stamp);
            glance.add(value, given, slots.tick);
        }
        let whole = past.whole;
        self.take(of, &glance, whole, slots, now);
    }

    /// Takes what is known of the values that are read without a lag, and hides those that a reader does not see. `of_past` is the
    /// oldest stamp of those that are read with one, where all of these are there.
    #[inline(always)]
    fn take(
        &mut self,
        of: &Gather,
        glance: &Glance,
        of_past: Option<Instant>,
        slots: &Slots,
        now: Instant,
    ) {
        let hides = match self.read {
            Read::Fresh => glance.late,
            Read::Held | Read::Truth => glance.oldest < now - self.shortest,
        };
        self.fresh = glance.fresh;
        self.ended = glance.ended && self.read == Read::Held;
        let whole = of_past.filter(|_| !(glance.lacks | hides));
        self.whole = whole.map(|of_past| of_past.min(glance.oldest));
        if hides {
            self.hide(of, slots, now);
        }
    }

    #[inline(never)]
    fn hide(&mut self, of: &Gather, slots: &Slots, now: Instant) {
        for (place, slot) in present(of) {
            let (value, age) = (&mut self.values[place], now - self.stamps[place]);
            let max_age = of.entries[place].max_age;
            *value = seen(*value, self.read, slots.ran(slot), age, max_age);
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
        if let Origin::Past(past) = &mut self.origin {
            past.forget_places();
        }
    }

    /// Starts afresh for another segment.
    pub(crate) fn clear(&mut self) {
        self.values.fill(ABSENT);
        self.forget_places();
        self.fresh = false;
        self.ended = false;
        self.whole = None;
    }
}

impl AllPast {
    fn new(entries: &[Entry], with_history: &[usize]) -> Self {
        let past = entries.iter().enumerate();
        let past = past.filter(|(_, entry)| !entry.lag.is_zero());
        let past = past.map(|(place, entry)| Past {
            place: place as u32,
            history: with_history.partition_point(|&slot| slot < entry.slot) as u32,
            cursor: 0,
            until: Instant::MIN,
        });
        Self {
            of: past.collect(),
            until: Instant::MIN,
            whole: None,
        }
    }

    #[inline(never)]
    fn read(
        &mut self,
        of: &Gather,
        values: &mut [f64],
        stamps: &mut [Instant],
        histories: &[History],
        now: Instant,
        changed: bool,
    ) {
        self.until = Instant::MAX;
        self.whole = Some(Instant::MAX);
        for past in &mut self.of {
            let place = past.place as usize;
            let entry = &of.entries[place];
            if now >= past.until {
                let history = &histories[past.history as usize];
                let at = now - entry.lag;
                let (value, stamp, until) = if entry.lag.is_negative() {
                    // A plan may be another at the next tick.
                    let (value, from) = history.planned(at, entry.max_age);
                    (value, from, at)
                } else {
                    history.at_until(at, now, entry.max_age, &mut past.cursor)
                };
                values[place] = value;
                stamps[place] = stamp + entry.lag;
                // A value that is converted, or whose stamp is, is read afresh, lest it be converted twice.
                past.until = if changed { now } else { until + entry.lag };
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

/// The places and slots of what is read without a lag.
#[inline]
fn present(of: &Gather) -> impl Iterator<Item = (usize, usize)> {
    let entries = of.entries.iter().enumerate();
    let present = entries.filter(|(_, entry)| entry.lag.is_zero());
    present.map(|(place, entry)| (place, entry.slot))
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
