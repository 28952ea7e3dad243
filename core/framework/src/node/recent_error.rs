//! Decides which errors of a learner are too large to learn from; not what becomes of the others.

use serde::{Deserialize, Serialize};

use crate::time::{Duration, Instant};

/// The mean square of the recent errors: the arithmetic mean of the first, an exponentially weighted one later. It begins as if
/// there had been a few as large as those of the fit.
///
/// Errors of a learner that tells how unsure a prediction is are weighed by that: after a gap in which a process has moved, or
/// far from what is known, it may be off by more than it usually is.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize)]
pub(crate) struct RecentError {
    seen: u32,
    mean_square: f64,
    /// How many in a row have been too large, and since when.
    #[serde(default)]
    refused: u32,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    since: Option<Instant>,
    /// Whether errors are in units of the standard deviation of what was predicted; once none was.
    #[serde(default)]
    weighed: bool,
    /// When the last truth of those that count was offered.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) lesson: Option<Instant>,
}

impl RecentError {
    /// How many errors weigh in.
    const MEMORY: u32 = 50;
    /// How many there must have been before one can be called too large.
    const FIRST: u32 = 10;
    /// How many in a row can be too large, and in how many windows: after a long rest all of a machine that moves again would be for much
    /// longer, and one position that leaps spoils all truths of a window.
    const PATIENCE: u32 = 20;
    const WINDOWS: i64 = 4;
    /// One that is too large counts as so many times the recent one at most.
    const OF_REFUSED: f64 = 2.0;

    /// None yet, with the root mean square of those of the fit; NaN where it is not known.
    pub(crate) fn of_fit(usual: f64) -> Self {
        let square = usual * usual;
        if square > 0.0 && square.is_finite() {
            Self {
                seen: Self::FIRST,
                mean_square: square,
                ..Self::default()
            }
        } else {
            Self::default()
        }
    }

    /// Whether an error is below so many times the recent root mean square, both in units of the standard deviation of what was
    /// predicted where there is one, which is finite and above 0. What was kept in other units is forgotten. The truth was measured at `at`,
    /// and is about a `window` before.
    ///
    /// One that is not below counts as twice the recent one, so that what has changed for good is learned after a while; when
    /// there have been as many as there is patience for, and for as long, what was before is forgotten. A deviation says how large the
    /// first errors are, but for a learner that goes on from the last truths, and `starts_anywhere`.
    pub fn admits(
        &mut self,
        (error, std_dev): (f64, f64),
        multiple: f64,
        starts_anywhere: bool,
        (at, window): (Instant, Duration),
    ) -> bool {
        let weighed = std_dev > 0.0 && std_dev < f64::INFINITY;
        let error = if weighed { error / std_dev } else { error };
        let square = error * error;
        if !square.is_finite() {
            return false;
        }
        let waited = self.since.is_none_or(|since| {
            let most = window.as_ns().saturating_mul(Self::WINDOWS);
            at < since || (at - since).as_ns() >= most
        });
        if (self.refused >= Self::PATIENCE && waited) || weighed != self.weighed {
            let known = weighed && !self.weighed && !starts_anywhere;
            *self = Self {
                weighed,
                lesson: self.lesson,
                ..Self::of_fit(if known { 1.0 } else { f64::NAN })
            };
        }
        // Errors that were all 0, as of a machine at rest, say nothing of how large one may be.
        let judged = self.seen >= Self::FIRST && self.mean_square > 0.0;
        let most = if judged && multiple < f64::INFINITY {
            multiple * multiple * self.mean_square
        } else {
            f64::INFINITY
        };
        let admitted = square <= most;
        let counted = if admitted {
            square
        } else {
            square.min(Self::OF_REFUSED * Self::OF_REFUSED * self.mean_square)
        };
        self.seen = (self.seen + 1).min(Self::MEMORY);
        self.mean_square += (counted - self.mean_square) / f64::from(self.seen);
        if admitted {
            (self.refused, self.since) = (0, None);
        } else {
            self.refused += 1;
            self.since = self.since.or(Some(at));
        }
        admitted
    }

    /// Moves what is remembered to the clock of another segment.
    pub(crate) fn shift(&mut self, shift: Duration) {
        self.since = self.since.map(|since| since + shift);
        self.lesson = self.lesson.map(|lesson| lesson + shift);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    impl RecentError {
        /// Of truths without a window.
        fn admits_one(&mut self, error: f64, std_dev: f64, multiple: f64, anywhere: bool) -> bool {
            let when = (Instant::from_ns(0), Duration::ZERO);
            self.admits((error, std_dev), multiple, anywhere, when)
        }
    }

    #[test]
    fn a_spike_is_held_off_and_a_lasting_change_is_let_in_after_a_few() {
        let mut recent = RecentError::default();
        for i in 0..200 {
            assert!(recent.admits_one(if i % 2 == 0 { 1.0 } else { -1.0 }, f64::NAN, 6.0, false));
        }
        assert!(!recent.admits_one(20.0, f64::NAN, 6.0, false), "a spike");
        assert!(recent.admits_one(1.0, f64::NAN, 6.0, false));
        assert!(
            !recent.admits_one(f64::NAN, f64::NAN, 6.0, false)
                && !recent.admits_one(f64::INFINITY, f64::NAN, 6.0, false)
        );
        let refused = |error: f64, mut recent: RecentError| {
            (0..100)
                .take_while(|_| !recent.admits_one(error, f64::NAN, 6.0, false))
                .count()
        };
        // Each that is refused counts as twice the recent one: 0.94 + 0.06 · 2² of it is left.
        assert!((2..8).contains(&refused(7.5, recent)));
        assert_eq!(refused(20.0, recent), RecentError::PATIENCE as usize);
    }

    #[test]
    fn patience_is_four_windows_and_at_least_twenty_truths() {
        let window = Duration::from_ns(300_000_000_000);
        for (every_s, expected) in [(30, 40), (75, 20), (2, 20)] {
            let mut recent = RecentError::default();
            let mut at = |nth: i64, error: f64| {
                // Large enough that no growth of what is recent lets it in.
                let when = (Instant::from_ns(nth * every_s * 1_000_000_000), window);
                recent.admits((error, f64::NAN), 6.0, false, when)
            };
            assert!((0..100).all(|nth| at(nth, 1.0)));
            let refused = (100..).take_while(|&nth| !at(nth, 1e9)).count();
            let expected = expected.max(1_200 / every_s as usize);
            assert_eq!(refused, expected, "{every_s}");
        }
    }

    #[test]
    fn the_first_errors_are_let_in_where_nothing_says_how_large_they_may_be() {
        let mut recent = RecentError::default();
        for error in [1e-3, 1e3, 0.0, 5.0] {
            assert!(recent.admits_one(error, f64::NAN, 6.0, false));
        }
    }

    #[test]
    fn a_long_rest_does_not_make_outliers_of_what_follows_for_longer_than_a_few() {
        let mut recent = RecentError::default();
        for _ in 0..100 {
            assert!(recent.admits_one(1.0, f64::NAN, 6.0, false));
        }
        for _ in 0..5000 {
            assert!(recent.admits_one(0.0, f64::NAN, 6.0, false));
        }
        let refused = (0..1000)
            .take_while(|_| !recent.admits_one(1.0, f64::NAN, 6.0, false))
            .count();
        assert_eq!(refused, RecentError::PATIENCE as usize);
        assert!((0..100).all(|_| recent.admits_one(1.0, f64::NAN, 6.0, false)));
        assert!(
            !recent.admits_one(20.0, f64::NAN, 6.0, false),
            "a spike after that"
        );
    }

    #[test]
    fn errors_that_were_all_zero_do_not_end_learning() {
        let mut recent = RecentError::default();
        for _ in 0..100 {
            assert!(recent.admits_one(0.0, f64::NAN, 6.0, false));
        }
        assert!(recent.admits_one(1.0, f64::NAN, 6.0, false));
    }

    #[test]
    fn an_error_is_as_large_as_the_prediction_was_unsure() {
        let mut recent = RecentError::default();
        for _ in 0..100 {
            assert!(recent.admits_one(1.0, 0.5, 6.0, false));
        }
        assert!(!recent.admits_one(20.0, 0.5, 6.0, false), "a spike");
        assert!(recent.admits_one(20.0, 10.0, 6.0, false), "after a gap");
        assert!(!recent.admits_one(f64::INFINITY, 10.0, 6.0, false));
    }

    #[test]
    fn what_was_kept_in_other_units_says_nothing_of_an_error() {
        for (before, now) in [(f64::NAN, 1e-3), (1e-3, 0.0), (1e-3, f64::INFINITY)] {
            let mut recent = RecentError::default();
            for _ in 0..100 {
                assert!(recent.admits_one(1e-3, before, 6.0, false));
            }
            let error = if now == 1e-3 { 2e-3 } else { 1.0 };
            assert!(recent.admits_one(error, now, 6.0, false), "{before}, {now}");
        }
        // As it was written when no error was weighed.
        let written = r#"{"seen":50,"mean_square":1e-6,"refused":0}"#;
        let mut recent: RecentError = serde_json::from_str(written).unwrap();
        assert!(!recent.admits_one(1.0, f64::NAN, 6.0, false));
        assert!(recent.admits_one(2e-3, 1e-3, 6.0, false));
    }

    #[test]
    fn the_first_errors_are_measured_by_those_of_the_fit() {
        let mut recent = RecentError::of_fit(2.0);
        assert!(
            !recent.admits_one(1e3, f64::NAN, 6.0, false)
                && recent.admits_one(5.0, f64::NAN, 6.0, false)
        );
        let mut weighed = RecentError::of_fit(f64::NAN);
        assert!(
            !weighed.admits_one(1e3, 2.0, 6.0, false) && weighed.admits_one(5.0, 2.0, 6.0, false)
        );
        let mut following = RecentError::of_fit(f64::NAN);
        assert!(following.admits_one(1e3, 2.0, 6.0, true));
    }

    #[test]
    fn a_fit_that_was_too_good_does_not_end_learning() {
        let mut recent = RecentError::of_fit(1e-9);
        let refused = (0..1000)
            .take_while(|_| !recent.admits_one(1.0, f64::NAN, 6.0, false))
            .count();
        assert!(refused <= RecentError::PATIENCE as usize, "{refused}");
        assert!((0..100).all(|_| recent.admits_one(1.0, f64::NAN, 6.0, false)));
    }
}
