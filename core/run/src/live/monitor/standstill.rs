//! Where a series repeats one value for much longer than ever else, as a stuck sensor does.
//!
//! A fine sensor changes with almost every sample. A coarse one repeats its value; the rest of the series shows for how long.

use serde::Serialize;

/// Fewer samples in a row with the very same value are nothing to speak of.
const FEWEST: u64 = 20;
/// The share of samples that differ from the one before in a channel that changes.
const CHANGES: f64 = 0.9;
/// So many times as often as ever else is long in a channel of so many changes, too.
const LONGER: u64 = 5;
const ENOUGH_CHANGES: u64 = 50;

/// Samples in a row with the very same value.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Standstill {
    /// How many.
    pub samples: u64,
    /// Their value.
    pub value: f64,
    /// When the first of them came, in s.
    pub from_s: f64,
    /// When the last of them came, in s.
    pub to_s: f64,
}

/// Finds the longest standstill while samples come.
#[derive(Debug, Clone, Default)]
pub struct Finder {
    samples: u64,
    changes: u64,
    run: Standstill,
    longest: Standstill,
    /// How many samples the longest of all others has.
    second: u64,
}

impl Finder {
    /// Takes the next sample.
    pub fn push(&mut self, at_s: f64, value: f64) {
        self.samples += 1;
        if self.run.samples > 0 && value == self.run.value {
            self.run.samples += 1;
            self.run.to_s = at_s;
            return;
        }
        self.changes += u64::from(self.run.samples > 0);
        self.interrupt();
        self.run = Standstill {
            samples: 1,
            value,
            from_s: at_s,
            to_s: at_s,
        };
    }

    /// What follows is not set against what was.
    pub fn interrupt(&mut self) {
        let over = std::mem::take(&mut self.run);
        if over.samples > self.longest.samples {
            self.second = self.longest.samples;
            self.longest = over;
        } else {
            self.second = self.second.max(over.samples);
        }
    }

    /// The standstill that goes on while samples come. What has not often changed before is not known to change.
    #[must_use]
    pub fn goes_on(&self) -> Option<Standstill> {
        let Self { run, longest, .. } = self;
        let is_known = self.changes >= ENOUGH_CHANGES;
        let stands = is_known && self.stands(run.samples, longest.samples);
        stands.then_some(*run)
    }

    /// Lets the standstill that goes on end, so that none after it is measured by it.
    pub fn forget(&mut self) {
        self.samples -= std::mem::take(&mut self.run).samples;
    }

    /// Whether so many samples in a row are a standstill where no others are more than `second`.
    fn stands(&self, most: u64, second: u64) -> bool {
        let changes_else = (self.changes + most) as f64 > CHANGES * self.samples as f64;
        let never_else = self.changes >= ENOUGH_CHANGES && most > LONGER * second;
        most >= FEWEST && (changes_else || never_else)
    }

    /// How often the next sample had another value.
    #[must_use]
    pub fn changes(&self) -> u64 {
        self.changes
    }

    /// The most samples in a row with the very same value, and whether that is a standstill.
    #[must_use]
    pub fn longest(mut self) -> (Standstill, bool) {
        self.interrupt();
        let longest = self.longest;
        (longest, self.stands(longest.samples, self.second))
    }

    /// The standstill; none where nothing stands still for longer than it usually does.
    #[must_use]
    pub fn found(self) -> Option<Standstill> {
        let (longest, stands) = self.longest();
        stands.then_some(longest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(values: impl IntoIterator<Item = f64>) -> Finder {
        let mut finder = Finder::default();
        for (nth, value) in values.into_iter().enumerate() {
            finder.push(nth as f64, value);
        }
        finder
    }

    #[test]
    fn a_fine_series_that_stops_stands_still_from_its_last_change_on() {
        let fine = (0..100).map(|nth| (f64::from(nth) * 0.7).sin());
        assert_eq!(of(fine.clone()).found(), None);
        let found = of(fine.chain([5.0; 30])).found().unwrap();
        assert_eq!((found.samples, found.value), (30, 5.0));
        assert_eq!((found.from_s, found.to_s), (100.0, 129.0));
    }

    #[test]
    fn a_coarse_series_stands_still_when_it_does_so_far_longer_than_else() {
        let coarse = (0..1200).map(|nth| f64::from(nth / 12));
        assert_eq!(of(coarse.clone()).found(), None);
        assert_eq!(of(coarse.clone().chain([500.0; 60])).found(), None);
        let found = of(coarse.chain([500.0; 61])).found().unwrap();
        assert_eq!(found.samples, 61);
    }

    #[test]
    fn a_standstill_is_found_while_it_goes_on_and_again_as_soon_when_it_was_over() {
        let mut finder = of((0..100).map(|nth| (f64::from(nth) * 0.7).sin()));
        for _ in 0..2 {
            for nth in 1..100 {
                finder.push(0.0, 5.0);
                assert_eq!(finder.goes_on().is_some(), nth >= 20, "{nth}");
            }
            finder.forget();
            for nth in 0..100 {
                finder.push(0.0, f64::from(nth));
                assert_eq!(finder.goes_on(), None);
            }
        }
        assert_eq!(of([21.5; 1000]).goes_on(), None, "it may be a setpoint");
    }

    #[test]
    fn what_changes_now_and_then_like_a_setpoint_does_not_stand_still() {
        let setpoint = (0..1000).map(|nth| if nth < 300 { 20.0 } else { 40.0 });
        assert_eq!(of(setpoint).found(), None);
        assert_eq!(
            of([21.5; 1000]).found().map(|found| found.samples),
            Some(1000)
        );
    }
}
