//! Finds leaps while samples come: a position that is zeroed, homed or pushed. A truth whose window holds one is none.
//!
//! What is a leap is decided by the changes beside it ([`stands_alone`], [`goes_on`]) and by those that are [`Usual`], here and where a
//! whole recording is looked at. Here it must be said before the next sample is there. So a change that may be a leap counts as one until the
//! next sample; a heater that is switched on costs the truths of a few ticks.

use std::ops::Range;

use serde::{Deserialize, Serialize};

use super::tick::Slots;
use crate::channel::LEAPT;
use crate::compile::{Plan, origins};
use crate::time::{Duration, Instant};

/// So many times as large as nineteen in twenty changes is a leap. In the largest measured and simulated sets of data without one,
/// what stands alone is at most 2.1 times as large.
const TIMES: f64 = 20.0;
/// The shares of changes that define what is usual; so many times what the smaller does not exceed is usual at most, where leaps are
/// many. In measured and simulated data without leaps, what nineteen in twenty do not exceed is at most 2.1 times that, and 11 times in a
/// heater.
pub const SHARES: [f64; 2] = [0.75, 0.95];
const SPREAD: f64 = 10.0;
/// The share of a leap that the changes beside it do not reach.
const BESIDE: f64 = 0.1;
/// Fewer changes do not define what is usual.
pub const FEWEST_CHANGES: usize = 20;
/// A change over a time so many times as long as the median is no leap, for much may have happened.
pub const LONGEST_GAP: f64 = 3.0;
/// By how much the changes before and after a zeroing may differ, as a share of what it differs from them.
const ALIKE: f64 = 0.3;
/// So many times as much as usual a zeroing differs from the changes on both sides; in measured and simulated data, what goes on alike
/// differs by at most 11 times that. Where it comes to one number again and again, fewer do.
const STEP: f64 = 20.0;
const STEP_TO_ONE: f64 = 8.0;
const PART_OF_MOST: f64 = 0.2;

/// How large what three and nineteen in twenty do not exceed is, of the changes of a series or of its steps.
#[derive(Debug, Clone, Copy)]
pub struct Usual(pub [f64; 2]);

impl Usual {
    /// A change that stands alone is a leap where it is larger.
    #[must_use]
    pub fn least_change(self) -> f64 {
        let [mostly, most] = self.0;
        TIMES * most.min(SPREAD * mostly)
    }

    /// A step from which a series goes on as before is a leap where it is larger; the second where it comes to one number again and again.
    #[must_use]
    pub fn least_step(self) -> [f64; 2] {
        let [mostly, most] = self.0;
        let usual = mostly.max(PART_OF_MOST * most);
        [STEP * usual, STEP_TO_ONE * usual]
    }
}

/// Whether a change beside another leaves that one alone: it is small, or takes it back.
#[must_use]
pub fn stands_alone(change: f64, beside: f64) -> bool {
    let least = BESIDE * change.abs();
    beside.abs() <= least || (beside + change).abs() <= least
}

/// By how much a change differs from those before and after, and whether these are alike.
#[must_use]
pub fn goes_on([before, change, after]: [f64; 3]) -> (f64, bool) {
    let size = (change - (before + after) / 2.0).abs();
    (size, (after - before).abs() <= ALIKE * size)
}

/// A value that a share of what comes does not exceed, as it moves with the last hundreds (Robbins and Monro 1951, on a scale of ratios).
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize)]
struct Quantile(f64);

impl Quantile {
    fn push(&mut self, value: f64, share: f64, nth: u32) {
        let by = (4.0 / f64::from(nth)).max(0.05);
        self.0 = match self.0 {
            _ if nth == 1 => value,
            was if value > was => was * (1.0 + by * share),
            was => was / (1.0 + by * (1.0 - share)),
        };
    }
}

/// The quantiles of what comes, of what is not 0.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize)]
struct Sizes {
    of: [Quantile; 2],
    seen: u32,
}

impl Sizes {
    fn push(&mut self, size: f64) {
        if size > 0.0 && size < f64::INFINITY {
            self.seen = self.seen.saturating_add(1);
            for (quantile, share) in self.of.iter_mut().zip(SHARES) {
                quantile.push(size, share, self.seen);
            }
        }
    }

    /// What is usual, once that is known; until then nothing is too large.
    fn usual(&self) -> Usual {
        let known = self.seen as usize >= FEWEST_CHANGES;
        Usual(self.of.map(|of| if known { of.0 } else { f64::INFINITY }))
    }
}

/// So many numbers are kept that large steps came to.
const HOMES: usize = 8;
/// One that came so often before is a home.
const HOMINGS: usize = 2;

/// A series as far as leaps in it are looked for.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(crate) struct Course {
    last: Option<(Instant, f64)>,
    /// The sample before the last, and the change to that one; and the change before, where no hole is between.
    newest: Option<(Instant, f64)>,
    before: Option<f64>,
    changes: Sizes,
    steps: Sizes,
    /// By how much each change differs from the one before: of a smooth series that is far more than from both sides.
    bends: Sizes,
    gap: Quantile,
    gaps: u32,
    /// The sample before the last leap, and before a change that may be one.
    leapt: Option<Instant>,
    suspected: Option<Instant>,
    homes: [f64; HOMES],
    homed: usize,
}

impl Course {
    /// Takes the next sample.
    fn push(&mut self, at: Instant, value: f64) {
        let Some((since, from)) = self.last.replace((at, value)) else {
            return;
        };
        let (change, gap) = (value - from, (at - since).secs());
        let least = self.changes.usual().least_change();
        let [least_step, to_one] = self.steps.usual().least_step();
        if let Some((leapt, newest)) = self.newest {
            let alone = stands_alone(newest, change) && newest.abs() > least;
            let mut is_leap = alone && self.before.is_none_or(|of| stands_alone(newest, of));
            if let Some(before) = self.before {
                let (size, alike) = goes_on([before, newest, change]);
                self.steps.push(size);
                if alike && size > to_one {
                    is_leap |= size > least_step || self.is_home(from);
                    self.homes[self.homed % HOMES] = from;
                    self.homed += 1;
                }
            }
            self.suspected = None;
            self.leapt = if is_leap { Some(leapt) } else { self.leapt };
        }
        let is_hole = self.gaps as usize >= FEWEST_CHANGES && gap > LONGEST_GAP * self.gap.0;
        self.gaps = self.gaps.saturating_add(1);
        self.gap.push(gap, 0.5, self.gaps);
        if is_hole {
            (self.before, self.newest) = (None, None);
            return;
        }
        let before = self.newest.map(|(_, of)| of);
        let alone = change.abs() > least && before.is_none_or(|of| stands_alone(change, of));
        let bend = before.map_or(0.0, |of| (change - of).abs());
        // From one of the changes beside it a step differs by more than this share of what it differs from both.
        let beside = bend / (1.0 - ALIKE / 2.0);
        let [least_bend, bend_to_one] = self.bends.usual().least_step();
        let steps = (bend > least_bend && beside > least_step)
            || (bend > bend_to_one && beside > to_one && self.is_home(value));
        self.bends.push(bend);
        self.suspected = (alone || steps).then_some(since);
        self.changes.push(change.abs());
        (self.before, self.newest) = (before, Some((since, change)));
    }

    fn is_home(&self, value: f64) -> bool {
        let homes = &self.homes[..self.homed.min(HOMES)];
        homes.iter().filter(|home| **home == value).count() >= HOMINGS
    }

    /// Whether there was a leap since an instant, or may have been.
    fn leapt_since(&self, from: Instant) -> bool {
        self.leapt.max(self.suspected).is_some_and(|at| at >= from)
    }

    /// What follows is not set against what was.
    fn interrupt(&mut self) {
        (self.last, self.newest, self.before) = (None, None, None);
        (self.leapt, self.suspected) = (None, None);
    }
}

/// A truth with a window, and the series that it is taken over, by their places.
struct Windowed {
    slot: usize,
    span: Duration,
    over: Box<[usize]>,
}

/// The series that truths with a window are taken over.
pub(crate) struct Leaps {
    /// Each by its slot.
    pub(crate) courses: Box<[(usize, Course)]>,
    /// By their slots.
    truths: Box<[Windowed]>,
}

impl Leaps {
    /// Of a plan; nothing seen yet.
    pub(crate) fn new(plan: &Plan) -> Self {
        let of = origins::windowed(plan);
        let mut all: Vec<usize> = of.values().flatten().copied().collect();
        all.sort_unstable();
        all.dedup();
        let place = |slot: &usize| all.binary_search(slot).ok();
        let truths = of.iter().map(|(&slot, over)| Windowed {
            slot,
            span: plan.channels[slot].channel.span,
            over: over.iter().filter_map(place).collect(),
        });
        Self {
            truths: truths.collect(),
            courses: all.iter().map(|slot| (*slot, Course::default())).collect(),
        }
    }

    /// The truths among the slots of a node, by their places.
    pub(crate) fn among(&self, slots: &Range<usize>) -> Range<usize> {
        let place = |end: usize| self.truths.partition_point(|of| of.slot < end);
        place(slots.start)..place(slots.end)
    }

    /// Takes what truths of this tick hold no leap of, where it is new, and makes those that do absent.
    #[inline(never)]
    pub(crate) fn refuse(&mut self, among: Range<usize>, slots: &mut Slots, now: Instant) {
        for truth in &self.truths[among] {
            let mut leapt = false;
            for &place in &truth.over {
                let (slot, course) = &mut self.courses[place];
                course.take(*slot, slots, now);
                leapt |= course.leapt_since(slots.given[truth.slot].stamp - truth.span);
            }
            if leapt && slots.fresh(truth.slot) {
                slots.values[truth.slot] = LEAPT;
            }
        }
    }

    /// Takes what is new at this tick of all that has not been taken.
    pub(crate) fn remember(&mut self, slots: &Slots, now: Instant) {
        for (slot, course) in &mut self.courses {
            course.take(*slot, slots, now);
        }
    }

    /// How much memory it takes.
    pub(crate) fn bytes(&self) -> usize {
        let over: usize = self.truths.iter().map(|of| size_of_val(&*of.over)).sum();
        size_of_val(&*self.courses) + size_of_val(&*self.truths) + over
    }

    /// Another segment begins.
    pub(crate) fn segment(&mut self) {
        self.courses.iter_mut().for_each(|(_, of)| of.interrupt());
    }
}

impl Course {
    #[inline]
    fn take(&mut self, slot: usize, slots: &Slots, now: Instant) {
        if slots.fresh(slot) && self.last.is_none_or(|(at, _)| at < now) {
            self.push(now, slots.values[slot]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(minute: usize) -> Instant {
        Instant::from_ns(minute as i64 * 60_000_000_000)
    }

    /// A position that follows a temperature in tens of minutes, with noise; in µm.
    fn position(minute: usize) -> f64 {
        let noise = (minute as f64 * 12.9898).sin() * 43_758.545_3;
        9.0 * (minute as f64 / 15.0).sin() + 0.02 * (noise - noise.floor() - 0.5)
    }

    /// The minutes that a window of five minutes ends at and is not believed.
    fn refused(minutes: Range<usize>, value: impl Fn(usize) -> f64) -> Vec<usize> {
        let mut course = Course::default();
        let refuses = |minute: &usize| {
            course.push(at(*minute), value(*minute));
            course.leapt_since(at(*minute) - Duration::from_ns(300_000_000_000))
        };
        minutes.filter(refuses).collect()
    }

    #[test]
    fn a_window_is_refused_as_long_as_it_holds_a_leap_and_no_longer() {
        let zeroed = |minute: usize| position(minute) - if minute < 1500 { 0.0 } else { 30.0 };
        let five: Vec<usize> = (1500..=1504).collect();
        assert_eq!(refused(0..2000, zeroed), five);
        let spike = |minute: usize| position(minute) + if minute == 700 { -50.0 } else { 0.0 };
        assert_eq!(refused(0..2000, spike), (700..=705).collect::<Vec<_>>());
        assert!(refused(0..2000, position).is_empty());
        assert!(refused(0..2000, |minute| (minute as f64 / 40.0).sin()).is_empty());
    }

    #[test]
    fn homings_hardly_larger_than_the_drift_of_a_minute_are_found() {
        let homed = |minute: usize| position(minute) - position(minute / 100 * 100);
        let found = refused(0..2000, homed);
        let homings: Vec<usize> = (1..20).map(|nth| 100 * nth).collect();
        let seen = homings
            .iter()
            .filter(|minute| found.contains(minute))
            .count();
        assert!(seen >= 14, "{found:?}");
        assert!(
            found
                .iter()
                .all(|minute| *minute >= 100 && minute % 100 < 6),
            "{found:?}"
        );
    }

    #[test]
    fn what_turns_fast_costs_truths_while_it_turns_and_what_changed_in_a_hole_none() {
        let heated = |minute: usize| {
            let since = minute.saturating_sub(1000) as f64;
            position(minute) + 300.0 * (1.0 - (-since / 10.0).exp())
        };
        let found = refused(0..2000, heated);
        assert!(
            found.iter().all(|minute| (1001..1015).contains(minute)),
            "{found:?}"
        );
        let shifted = |minute: usize| position(minute) + if minute < 1000 { 0.0 } else { 300.0 };
        let mut course = Course::default();
        for minute in (0..1000).chain(1600..2000) {
            course.push(at(minute), shifted(minute));
            assert!(!course.leapt_since(Instant::MIN), "{minute}");
        }
    }

    #[test]
    fn a_position_that_moves_all_the_time_is_no_row_of_leaps() {
        let moved = |minute: usize| [0.0, 3e3, -1e3, 8e3][minute % 4] + position(minute);
        assert!(refused(100..2000, moved).len() < 20);
    }
}
