//! When an alarm is raised, and when it is gone.

use std::time::{Duration as Wait, Instant as Clock};

use athermal_core::time::{Duration, Instant};
use serde::{Deserialize, Serialize};

/// What is looked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Limit {
    /// A value above this.
    Above(f64),
    /// A value below this.
    Below(f64),
    /// No value.
    Absent,
}

/// What became of an alarm.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Became {
    /// What is looked for has lasted long enough.
    Raised,
    /// Somebody knows of it.
    Acknowledged,
    /// It is no longer so.
    Gone,
}

/// What an alarm goes by, and what it has seen.
#[derive(Debug, Clone)]
pub(crate) struct Judge {
    pub(crate) limit: Limit,
    /// How long it must have lasted.
    pub(crate) lasts: Duration,
    /// How far back from the limit a value must be.
    pub(crate) hysteresis: f64,
    pub(crate) is_raised: bool,
    /// Since when a value is beyond the limit.
    since: Option<Instant>,
    /// When there was a value last.
    present: Clock,
}

impl Judge {
    pub(crate) fn new(limit: Limit, lasts: Duration, hysteresis: f64, is_raised: bool) -> Self {
        Self {
            limit,
            lasts,
            hysteresis,
            is_raised,
            since: None,
            present: Clock::now(),
        }
    }

    /// The same with another limit, as another graph has it.
    pub(crate) fn going_on(&self, limit: Limit, hysteresis: f64) -> Self {
        Self {
            limit,
            hysteresis,
            ..self.clone()
        }
    }

    /// Looks at the value of a tick. One that is absent neither raises nor clears, unless that is what is looked for.
    pub(crate) fn tick(&mut self, value: f64, at: Instant, now: Clock) -> Option<Became> {
        if value.is_nan() {
            return self.look(now);
        }
        self.present = now;
        let (is_beyond, is_back) = match self.limit {
            Limit::Above(limit) => (value > limit, value <= limit - self.hysteresis),
            Limit::Below(limit) => (value < limit, value >= limit + self.hysteresis),
            Limit::Absent => (false, true),
        };
        if self.is_raised {
            self.is_raised = !is_back;
            self.since = None;
            return is_back.then_some(Became::Gone);
        }
        // What lies before a new segment has not lasted in it.
        let since = self.since.filter(|since| *since <= at);
        self.since = is_beyond.then(|| since.unwrap_or(at));
        let has_lasted = self.since.is_some_and(|since| at - since >= self.lasts);
        self.is_raised = has_lasted;
        has_lasted.then_some(Became::Raised)
    }

    /// Looks without a tick: nothing may come at all.
    pub(crate) fn look(&mut self, now: Clock) -> Option<Became> {
        let lasts = Wait::from_nanos(self.lasts.as_ns().max(0).unsigned_abs());
        let is_absent = now.saturating_duration_since(self.present) >= lasts;
        let raises = self.limit == Limit::Absent && is_absent && !self.is_raised;
        self.is_raised |= raises;
        raises.then_some(Became::Raised)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn s(seconds: i64) -> Instant {
        Instant::from_ns(seconds * 1_000_000_000)
    }

    fn course(limit: Limit, hysteresis: f64, values: &[f64]) -> Vec<(usize, Became)> {
        let mut judge = Judge::new(limit, Duration::from_ns(20_000_000_000), hysteresis, false);
        let begin = Clock::now();
        let ticks = values.iter().enumerate();
        let became = ticks.filter_map(|(nth, value)| {
            let now = begin + Wait::from_secs(10 * nth as u64);
            Some((nth, judge.tick(*value, s(10 * nth as i64), now)?))
        });
        became.collect()
    }

    #[test]
    fn what_lasts_raises_what_is_back_by_the_hysteresis_is_gone_and_no_value_changes_nothing() {
        use Became::{Gone, Raised};
        let nan = f64::NAN;
        let above = Limit::Above(80.0);
        for (limit, hysteresis, values, expected) in [
            (
                above,
                5.0,
                &[81.0, 82.0, 83.0, 78.0, 75.0, 90.0][..],
                vec![(2, Raised), (4, Gone)],
            ),
            // It does not last.
            (above, 0.0, &[81.0, 82.0, 79.0, 81.0, 82.0], vec![]),
            (
                above,
                0.0,
                &[81.0, nan, nan, 81.0, nan, nan, 80.0],
                vec![(3, Raised), (6, Gone)],
            ),
            (
                Limit::Below(-1.0),
                1.0,
                &[-2.0, -2.0, -2.0, -0.5, 0.0],
                vec![(2, Raised), (4, Gone)],
            ),
            (
                Limit::Absent,
                0.0,
                &[1.0, nan, nan, nan, 1.0],
                vec![(2, Raised), (4, Gone)],
            ),
        ] {
            assert_eq!(
                course(limit, hysteresis, values),
                expected,
                "{limit:?} {values:?}"
            );
        }
    }

    #[test]
    fn a_clock_that_goes_back_begins_the_wait_anew() {
        let lasts = Duration::from_ns(20_000_000_000);
        let mut judge = Judge::new(Limit::Above(1.0), lasts, 0.0, false);
        let now = Clock::now();
        let mut at = |second| judge.tick(2.0, s(second), now);
        assert_eq!([at(100), at(110), at(0), at(10)], [None; 4]);
        assert_eq!(at(20), Some(Became::Raised));
    }
}
