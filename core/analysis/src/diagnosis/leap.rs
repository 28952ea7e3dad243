//! Where a series leaps from one sample to the next: a sensor that fails, or a position that is zeroed anew.
//!
//! Temperatures and positions change step by step. A leap is 20 times as large as nineteen in twenty of the changes between two
//! samples. Where leaps are many, it is 200 times as large as three in four of them. It also stands alone: the changes before and
//! after it are less than a tenth of it, or take it back. A heater that is switched on makes many large changes in a row.
//!
//! A position that is zeroed at each homing may leap by less than it drifts within hours. It goes on after the step as fast as before, so
//! what is looked at is by how much the step differs from the changes on both sides, whatever the size of these: 20 times as much as
//! three in four do, or eight times where it comes back to one and the same number again and again.

use std::fmt;

use athermal_core::compile::{Plan, PlannedChannel};
use athermal_core::engine::leap::{
    FEWEST_CHANGES, LONGEST_GAP, SHARES, Usual, goes_on, stands_alone,
};
use athermal_core::unit::Unit;
use serde::Serialize;

use super::of_truths;
use crate::figures::apart;

/// So many that come to one and the same number are homings.
const HOMINGS: usize = 3;
/// So many of the largest changes are kept.
const KEPT: usize = 100;

/// From one sample to the next.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Leap {
    /// When the second sample came, in s.
    pub at_s: f64,
    /// The first sample.
    pub from: f64,
    /// The second.
    pub to: f64,
}

impl Leap {
    fn change(&self) -> f64 {
        self.to - self.from
    }
}

/// The leaps of a series.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Leaps {
    /// How many; 100 stands for as many or more.
    pub count: usize,
    /// The first of them, or of the 100 largest.
    pub first: Leap,
    /// Nine tenths of all samples lie between these.
    pub usual: (f64, f64),
}

impl fmt::Display for Leaps {
    /// `leaps 2 times, first from 21.50 to 850.0 within one sample`
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let times = match self.count {
            1 => "once".to_owned(),
            KEPT => format!("{KEPT} times or more, first"),
            many => format!("{many} times, first"),
        };
        let [from, to] = apart([self.first.from, self.first.to]);
        write!(f, "leaps {times} from {from} to {to} within one sample")
    }
}

/// For each measured channel a finder where a leap is a fault: in a temperature, and in what a truth is made of.
#[must_use]
pub fn finders(plan: &Plan) -> Vec<Option<Finder>> {
    let channels = plan.channels.iter().zip(of_truths(plan));
    let finder = |(of, of_truth): (&PlannedChannel, bool)| match of
        .channel
        .unit
        .measures_same(&Unit::kelvin())
    {
        true => Some(Finder::default()),
        false => of_truth.then(Finder::of_position),
    };
    channels.map(finder).collect()
}

/// Finds leaps while samples come, in memory that does not grow with them.
#[derive(Debug, Clone, Default)]
pub struct Finder {
    last: Option<(f64, f64)>,
    /// The change that led to the last sample, the time it took in s, and whether it stands alone as far as is known.
    newest: Option<(Leap, f64, bool)>,
    /// The largest that stand alone, each with the time it took in s and its place among all.
    alone: Vec<(Leap, f64, u64)>,
    /// How many samples came.
    met: u64,
    values: Thinned,
    changes: Thinned,
    gaps: Thinned,
    /// Steps from which a position goes on as before.
    steps: Option<Steps>,
}

impl Finder {
    /// That of a position, which may be zeroed.
    #[must_use]
    pub fn of_position() -> Self {
        Self {
            steps: Some(Steps::default()),
            ..Self::default()
        }
    }

    /// Takes the next sample.
    pub fn push(&mut self, at_s: f64, value: f64) {
        self.values.push(value);
        self.met += 1;
        let Some((last_s, from)) = self.last.replace((at_s, value)) else {
            return;
        };
        let leap = Leap {
            at_s,
            from,
            to: value,
        };
        let (change, gap_s) = (leap.change(), at_s - last_s);
        self.gaps.push(gap_s);
        if change != 0.0 {
            self.changes.push(change.abs());
        }
        if let Some(steps) = &mut self.steps {
            steps.push(leap, gap_s, self.met);
        }
        let before = self.newest.take();
        let alone = before.is_none_or(|(before, ..)| stands_alone(change, before.change()));
        self.newest = Some((leap, gap_s, alone));
        if let Some((before, gap_s, true)) = before
            && stands_alone(before.change(), change)
        {
            self.keep(before, gap_s);
        }
    }

    /// What follows is not set against what was.
    pub fn interrupt(&mut self) {
        (self.last, self.newest) = (None, None);
        if let Some(steps) = &mut self.steps {
            steps.last.clear();
        }
    }

    fn keep(&mut self, leap: Leap, gap_s: f64) {
        let size = |of: &Leap| of.change().abs();
        let at = self
            .alone
            .partition_point(|(kept, ..)| size(kept) >= size(&leap));
        if at < KEPT && leap.change() != 0.0 {
            self.alone.truncate(KEPT - 1);
            // It led to the sample before the newest.
            self.alone.insert(at, (leap, gap_s, self.met - 1));
        }
    }

    /// The leaps; none where there are none, or too few samples.
    #[must_use]
    pub fn found(&self) -> Option<Leaps> {
        if self.changes.kept.len() < FEWEST_CHANGES {
            return None;
        }
        let least = self.changes.usual().least_change();
        let longest_s = LONGEST_GAP * self.gaps.quantile(0.5);
        let is_leap = |(leap, gap_s, _): &&(Leap, f64, u64)| {
            leap.change().abs() > least && *gap_s <= longest_s
        };
        let alone = self.alone.iter().filter(is_leap);
        let steps = self.steps.iter().flat_map(|steps| steps.found(longest_s));
        let mut leaps: Vec<(Leap, u64)> = alone
            .map(|(leap, _, met)| (*leap, *met))
            .chain(steps)
            .collect();
        leaps.sort_by_key(|(_, met)| *met);
        leaps.dedup_by_key(|(_, met)| *met);
        let (first, _) = *leaps.first()?;
        Some(Leaps {
            count: leaps.len().min(KEPT),
            first,
            usual: (self.values.quantile(0.05), self.values.quantile(0.95)),
        })
    }
}

/// The steps of a position that differ from the changes on both sides, which are alike.
#[derive(Debug, Clone, Default)]
struct Steps {
    /// The last changes in a row, at most two, each with the time it took in s and the number of its second sample.
    last: Vec<(Leap, f64, u64)>,
    /// By how much changes differ from those on both sides.
    sizes: Thinned,
    /// The largest such steps: by how much they differ, the longest time in s of the changes, and the number of the sample.
    kept: Vec<(f64, Leap, f64, u64)>,
}

impl Steps {
    fn push(&mut self, next: Leap, gap_s: f64, met: u64) {
        if let [(before, ..), (step, ..)] = self.last[..] {
            let changes = [before.change(), step.change(), next.change()];
            let (size, is_alike) = goes_on(changes);
            if size != 0.0 {
                self.sizes.push(size);
            }
            let at = self.kept.partition_point(|(kept, ..)| *kept >= size);
            if is_alike && at < KEPT && size > 0.0 {
                let longest = self
                    .last
                    .iter()
                    .fold(gap_s, |longest, (_, gap, _)| longest.max(*gap));
                self.kept.truncate(KEPT - 1);
                self.kept.insert(at, (size, step, longest, met - 1));
            }
            self.last.remove(0);
        }
        self.last.push((next, gap_s, met));
    }

    /// Those that are far from usual, and fall into no gap.
    fn found(&self, longest_s: f64) -> Vec<(Leap, u64)> {
        if self.sizes.kept.len() < FEWEST_CHANGES {
            return Vec::new();
        }
        let [least, to_one] = self.sizes.usual().least_step();
        let far = || {
            let of = move |(size, _, longest, _): &&(f64, Leap, f64, u64)| {
                *size > to_one && *longest <= longest_s
            };
            self.kept.iter().filter(of)
        };
        let comes_back =
            |leap: &Leap| far().filter(|(_, of, ..)| of.to == leap.to).count() >= HOMINGS;
        let is_zeroing =
            |(size, leap, ..): &&(f64, Leap, f64, u64)| *size > least || comes_back(leap);
        far()
            .filter(is_zeroing)
            .map(|(_, leap, _, met)| (*leap, *met))
            .collect()
    }
}

/// Every so many of what comes, evenly, so that they stay few.
#[derive(Debug, Clone, Default)]
struct Thinned {
    kept: Vec<f64>,
    /// One in two to this power is kept.
    halvings: u32,
    seen: u64,
}

impl Thinned {
    const MOST: usize = 4096;

    fn push(&mut self, value: f64) {
        if self.seen.is_multiple_of(1 << self.halvings) {
            if self.kept.len() == Self::MOST {
                let mut even = false;
                self.kept.retain(|_| {
                    even = !even;
                    even
                });
                self.halvings += 1;
            }
            if self.seen.is_multiple_of(1 << self.halvings) {
                self.kept.push(value);
            }
        }
        self.seen += 1;
    }

    /// What is usual of them.
    fn usual(&self) -> Usual {
        Usual(SHARES.map(|share| self.quantile(share)))
    }

    /// What the share `share` does not exceed; of at least one value.
    fn quantile(&self, share: f64) -> f64 {
        let mut sorted = self.kept.clone();
        sorted.sort_by(f64::total_cmp);
        sorted[(share * (sorted.len() - 1) as f64).round() as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A temperature in °C about 22 that goes up and down within hours, with a noise of its own; a value a minute.
    fn temperature(minute: usize) -> f64 {
        let noise = (minute as f64 * 12.9898).sin() * 43_758.545_3;
        22.0 + 2.0 * (minute as f64 / 300.0).sin() + 0.02 * (noise - noise.floor() - 0.5)
    }

    fn found(minutes: std::ops::Range<usize>, value: impl Fn(usize) -> f64) -> Option<Leaps> {
        let mut finder = Finder::default();
        for minute in minutes {
            finder.push(60.0 * minute as f64, value(minute));
        }
        finder.found()
    }

    #[test]
    fn a_sensor_that_breaks_for_an_hour_leaps_twice() {
        let leaps = found(0..2000, |minute| match minute {
            1000..1060 => 850.0,
            _ => temperature(minute),
        });
        let leaps = leaps.unwrap();
        assert_eq!(leaps.count, 2);
        assert_eq!((leaps.first.at_s, leaps.first.to), (60_000.0, 850.0));
        assert!(leaps.usual.0 > 19.9 && leaps.usual.1 < 24.1, "{leaps:?}");
    }

    #[test]
    fn a_single_wrong_sample_leaps_there_and_back() {
        let leaps = found(0..2000, |minute| match minute {
            700 => -327.68,
            _ => temperature(minute),
        });
        assert_eq!(leaps.unwrap().count, 2);
    }

    #[test]
    fn a_position_that_is_zeroed_anew_leaps_once_however_far_it_drifted() {
        let leaps = found(0..2000, |minute| {
            let zero = if minute < 1500 { 0.0 } else { 5000.0 };
            10.0 * minute as f64 - zero + 50.0 * temperature(minute)
        });
        assert_eq!(leaps.unwrap().count, 1);
    }

    #[test]
    fn a_position_that_is_moved_at_every_sixth_sample_leaps_all_the_time() {
        let leaps = found(0..2000, |minute| {
            let place = [0.0, 3e6, -1e6, 8e6][minute / 6 % 4];
            place + 50.0 * temperature(minute)
        });
        let leaps = leaps.unwrap();
        assert_eq!(leaps.count, KEPT);
        assert!(
            leaps
                .to_string()
                .starts_with("leaps 100 times or more, first from ")
        );
    }

    /// A position in µm that follows a temperature in tens of minutes, with what it is set to at some minutes.
    fn position(minutes: usize, zero: impl Fn(usize, f64) -> Option<f64>) -> Option<Leaps> {
        let (mut finder, mut offset) = (Finder::of_position(), 0.0);
        for minute in 0..minutes {
            let at = 9.0 * (minute as f64 / 15.0).sin() + 0.3 * temperature(minute);
            if let Some(value) = zero(minute, at - offset) {
                offset = at - value;
            }
            finder.push(60.0 * minute as f64, at - offset);
        }
        finder.found()
    }

    #[test]
    fn a_position_that_is_zeroed_leaps_though_it_drifts_as_far_within_minutes() {
        let every = |minute: usize, of: usize| minute > 0 && minute % of == of / 3;
        // At each homing to zero, to a number of the machine, to any place near zero, and only once.
        let homed = position(2000, |minute, _| every(minute, 100).then_some(0.0));
        assert!((18..=20).contains(&homed.unwrap().count));
        let to_one = position(2000, |minute, _| every(minute, 70).then_some(12.5));
        assert!((25..=29).contains(&to_one.unwrap().count));
        let moved = position(2000, |minute, at| every(minute, 300).then_some(at - 4.0));
        assert_eq!(moved.unwrap().count, 7);
        let once = position(2000, |minute, at| (minute == 777).then_some(at + 5.0));
        assert_eq!(once.unwrap().count, 1);
        assert_eq!(position(2000, |_, _| None), None);
    }

    #[test]
    fn a_heater_that_is_switched_on_does_not_leap() {
        let heated = found(0..2000, |minute| {
            let since = minute.saturating_sub(1000) as f64;
            temperature(minute) + 100.0 * (1.0 - (-since / 3.0).exp())
        });
        assert_eq!(heated, None);
        assert_eq!(found(0..2000, temperature), None);
    }

    #[test]
    fn what_changed_during_a_gap_or_between_segments_is_no_leap() {
        let mut finder = Finder::default();
        for minute in (0..1000).chain(1600..2000) {
            let shift = if minute < 1000 { 0.0 } else { 30.0 };
            finder.push(60.0 * minute as f64, temperature(minute) + shift);
        }
        finder.interrupt();
        for minute in 0..1000 {
            finder.push(60.0 * minute as f64, temperature(minute) - 30.0);
        }
        assert_eq!(finder.found(), None);
    }

    #[test]
    fn a_long_series_takes_no_more_memory_than_a_short_one() {
        let mut finder = Finder::default();
        for minute in 0..200_000 {
            let value = if minute % 1000 == 999 {
                850.0
            } else {
                temperature(minute)
            };
            finder.push(60.0 * minute as f64, value);
        }
        assert_eq!(finder.found().unwrap().count, KEPT);
        assert!(finder.values.kept.len() <= Thinned::MOST && finder.alone.len() <= KEPT);
    }
}
