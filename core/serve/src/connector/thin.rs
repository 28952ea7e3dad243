//! A source that is thinned: of what it gives of an interval one sample a channel goes on, and all of it is safe once that is.

use std::collections::VecDeque;
use std::time::Instant as Clock;

use athermal_run::recording::{Thinner, Thinning};

use crate::time::{Duration, Instant};

/// So many stamps in a row that are too far ahead are where the source goes on.
const GOES_ON: u32 = 3;

/// What is thinned of a source.
#[derive(Debug)]
pub(super) struct Thin {
    pub(super) thinner: Thinner,
    /// How far a stamp may be ahead; as far as it likes where stamps come in order.
    future: Option<Duration>,
    /// When the newest stamp came, and how many have been too far ahead since.
    came: Clock,
    strays: u32,
    /// How many samples came.
    pub(super) came_in: u64,
    /// Once so many of those that were handed on are safe, so many of those that came are.
    due: VecDeque<(u64, u64)>,
    safe: u64,
    /// How often time began again, as far as that is known here.
    pub(super) turns: u64,
}

impl Thin {
    pub(super) fn new(
        thinning: Thinning,
        after: impl ExactSizeIterator<Item = Instant>,
        (grace, future): (Duration, Option<Duration>),
    ) -> Self {
        let mut thinner = Thinner::new(thinning, after.len(), grace);
        for (nth, stamp) in after.enumerate() {
            thinner.begin_after(nth, stamp);
        }
        Self {
            thinner,
            future,
            came: Clock::now(),
            strays: 0,
            came_in: 0,
            due: VecDeque::new(),
            safe: 0,
            turns: 0,
        }
    }

    /// Takes a sample; false where it is to go on as it is, and to be judged like any other.
    pub(super) fn take(&mut self, channel: usize, stamp: Instant, value: f64) -> bool {
        let before = self.came_in;
        self.came_in += 1;
        let newest = self.thinner.newest();
        let since = Duration::from_ns(self.came.elapsed().as_nanos() as i64);
        let is_ahead = |future| newest > Instant::MIN && stamp - (newest + since) > future;
        self.strays = match self.future.is_some_and(is_ahead) {
            true => self.strays + 1,
            false => 0,
        };
        // One wrong stamp ends no interval.
        let is_stray = (1..GOES_ON).contains(&self.strays);
        let is_taken = !is_stray && self.thinner.take(channel, stamp, value, before);
        if is_taken && self.thinner.newest() > newest {
            (self.came, self.strays) = (Clock::now(), 0);
        }
        is_taken
    }

    /// So many samples have been handed on.
    pub(super) fn handed_on(&mut self, given: u64) {
        let before = self.thinner.before().unwrap_or(self.came_in);
        self.due.push_back((given, before));
    }

    /// How many of the samples that came are safe, where so many of those that were handed on are.
    pub(super) fn safe(&mut self, given: u64) -> u64 {
        while let Some((_, came)) = self.due.front().filter(|(of, _)| *of <= given) {
            self.safe = *came;
            self.due.pop_front();
        }
        if self.due.is_empty() && self.thinner.first().is_none() {
            self.safe = self.came_in;
        }
        self.safe
    }
}

#[cfg(test)]
mod tests {
    use athermal_run::recording::Left;

    use super::*;

    fn ms(ms: i64) -> Instant {
        Instant::from_ns(ms * 1_000_000)
    }

    fn thin(grace: i64, future: Option<i64>) -> Thin {
        let every = Duration::from_ns(1_000_000_000);
        let thinning = Thinning {
            left: Left::Mean,
            every,
        };
        let ns = |ms: i64| Duration::from_ns(ms * 1_000_000);
        let after = vec![Instant::MIN; 2];
        Thin::new(thinning, after.into_iter(), (ns(grace), future.map(ns)))
    }

    /// Takes out what is over: the ends, and what is left.
    fn over(thin: &mut Thin, given: &mut u64) -> Vec<(Instant, Vec<(usize, f64)>)> {
        let mut all = Vec::new();
        while thin.thinner.is_over() {
            let mut left = Vec::new();
            let (end, _) = thin
                .thinner
                .pop(|nth, value| left.push((nth, value)))
                .unwrap();
            *given += left.len() as u64;
            thin.handed_on(*given);
            all.push((end, left));
        }
        all
    }

    #[test]
    fn what_came_is_safe_once_what_is_left_of_it_is() {
        let (mut thin, mut given) = (thin(200, None), 0);
        for nth in 1..=10 {
            assert!(thin.take(0, ms(100 * nth), nth as f64));
        }
        // Of the next second, and not over yet: a slower channel may have its last of the first.
        assert!(thin.take(0, ms(1_100), 7.0));
        assert_eq!(over(&mut thin, &mut given), []);
        assert!(thin.take(1, ms(950), 5.0));
        assert_eq!(thin.safe(u64::MAX), 0, "nothing was handed on");
        assert!(thin.take(0, ms(1_201), 8.0));
        let left = over(&mut thin, &mut given);
        assert_eq!(left, [(ms(1_000), vec![(0, 5.5), (1, 5.0)])]);
        assert_eq!(thin.safe(1), 0, "half of the row is written");
        // The eleventh to come is in an interval that is open, and holds those back that came after it.
        assert_eq!(thin.safe(2), 10);
    }

    #[test]
    fn what_comes_again_goes_on_as_it_is_and_is_safe_with_it() {
        let (mut thin, mut given) = (thin(0, None), 0);
        assert!(thin.take(0, ms(500), 1.0));
        assert!(!thin.take(0, ms(500), 1.0), "it is not counted twice");
        given += 1;
        thin.handed_on(given);
        assert_eq!(thin.safe(1), 0);
        assert!(thin.take(0, ms(1_001), 1.0));
        assert_eq!(over(&mut thin, &mut given), [(ms(1_000), vec![(0, 1.0)])]);
        assert!(
            !thin.take(1, ms(900), 1.0),
            "it is too late for its interval"
        );
        assert_eq!(thin.safe(2), 2);
    }

    #[test]
    fn one_stamp_of_the_future_ends_no_interval_and_three_are_where_it_goes_on() {
        let (mut thin, mut given) = (thin(0, Some(5_000)), 0);
        assert!(thin.take(0, ms(100), 1.0));
        assert!(!thin.take(0, ms(60_000), 9.0));
        assert!(thin.take(0, ms(200), 2.0), "the others go on");
        assert_eq!(over(&mut thin, &mut given), []);
        assert!(!thin.take(0, ms(60_100), 9.0));
        assert!(!thin.take(0, ms(60_200), 9.0));
        assert!(thin.take(0, ms(60_300), 9.0));
        assert_eq!(over(&mut thin, &mut given), [(ms(1_000), vec![(0, 1.5)])]);
    }
}
