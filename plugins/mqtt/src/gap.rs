//! What others dropped: holes in the numbers of messages, and in their times after an outage.

use std::collections::HashMap;
use std::time::{Duration, Instant as Clock};

use athermal_core::time::Instant;

/// How long after a connection has begun times are looked at.
const WATCH: Duration = Duration::from_secs(60);
/// A hole is as long as so many usual steps.
const STEPS: f64 = 5.0;
/// From how many steps on there is a usual one.
const KNOWN: u32 = 3;
/// Numbers that fall by more have begun again.
const AGAIN: i64 = 1000;

/// Looks for holes.
#[derive(Debug)]
pub struct GapWatch {
    newest: Option<Instant>,
    /// The usual step between times, in nanoseconds, and of how many it is the mean.
    step: f64,
    steps: u32,
    until: Option<Clock>,
    /// Whether nothing new has come on this connection.
    is_first: bool,
    /// The step across the time without a connection, until there is a usual one that it can be judged by.
    across: Option<(Instant, Instant)>,
    /// By topic: the last number.
    numbers: HashMap<String, i64>,
}

/// A hole.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Gap {
    /// The last time before it.
    pub from: Instant,
    /// The first time behind it.
    pub to: Instant,
    /// How many messages it had, where that is known.
    pub missing: Option<u64>,
}

impl Gap {
    fn by_time(from: Instant, to: Instant) -> Self {
        let missing = None;
        Self { from, to, missing }
    }
}

impl GapWatch {
    /// Goes on behind an instant.
    pub fn after(newest: Option<Instant>) -> Self {
        Self {
            newest,
            step: 0.0,
            steps: 0,
            until: None,
            is_first: false,
            across: None,
            numbers: HashMap::new(),
        }
    }

    /// A connection has begun.
    pub fn connected(&mut self) {
        self.until = Some(Clock::now() + WATCH);
        self.is_first = true;
    }

    /// A message has come, whether its values are of use or not, with its time and its number where it has them.
    pub fn seen(
        &mut self,
        topic: &str,
        stamp: Option<Instant>,
        number: Option<i64>,
    ) -> Option<Gap> {
        let from = self.newest;
        let by_time = stamp.and_then(|stamp| self.by_time(stamp));
        let Some(number) = number else {
            return by_time;
        };
        let last = match self.numbers.get_mut(topic) {
            Some(last) => last,
            None => {
                self.numbers.insert(topic.to_owned(), number);
                return by_time;
            }
        };
        let missing = number.saturating_sub(*last).saturating_sub(1);
        if !(-AGAIN..0).contains(&missing) {
            *last = number;
        }
        let to = stamp.or(from).filter(|_| missing > 0)?;
        Some(Gap {
            from: from.unwrap_or(to).min(to),
            to,
            missing: Some(missing as u64),
        })
    }

    fn by_time(&mut self, stamp: Instant) -> Option<Gap> {
        let Some(newest) = self.newest else {
            (self.newest, self.is_first) = (Some(stamp), false);
            return None;
        };
        if stamp <= newest {
            return None;
        }
        self.newest = Some(stamp);
        let is_known = self.steps >= KNOWN;
        if std::mem::take(&mut self.is_first) && !is_known {
            // A time without a connection is no usual step.
            self.across = Some((newest, stamp));
            return None;
        }
        if is_known && self.is_hole(newest, stamp) {
            // Where nothing was interrupted it is a machine that was silent.
            let is_watched = self.until.is_some_and(|until| Clock::now() < until);
            return is_watched.then(|| Gap::by_time(newest, stamp));
        }
        self.steps = (self.steps + 1).min(50);
        self.step += ((stamp - newest).as_ns() as f64 - self.step) / f64::from(self.steps);
        let (from, to) = self.across.filter(|_| self.steps >= KNOWN)?;
        self.across = None;
        self.is_hole(from, to).then(|| Gap::by_time(from, to))
    }

    fn is_hole(&self, from: Instant, to: Instant) -> bool {
        (to - from).as_ns() as f64 > STEPS * self.step
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(ms: i64) -> Instant {
        Instant::from_ns(ms * 1_000_000)
    }

    #[test]
    fn behaviour_19_a_hole_in_the_numbers_of_a_topic_is_a_gap() {
        let mut watch = GapWatch::after(None);
        for (ms, number) in [(0, 7), (10, 8), (10, 8), (20, 9)] {
            assert_eq!(watch.seen("a", Some(at(ms)), Some(number)), None);
        }
        assert_eq!(
            watch.seen("b", Some(at(25)), Some(1)),
            None,
            "another topic counts for itself"
        );
        let gap = Gap {
            from: at(25),
            to: at(60),
            missing: Some(3),
        };
        assert_eq!(watch.seen("a", Some(at(60)), Some(13)), Some(gap));
        assert_eq!(
            watch.seen("a", Some(at(30)), Some(10)),
            None,
            "it comes late"
        );
        assert_eq!(watch.seen("a", Some(at(70)), Some(14)), None);
        assert_eq!(
            watch.seen("a", Some(at(80)), Some(i64::MIN)),
            None,
            "it begins again"
        );
        assert_eq!(watch.seen("a", Some(at(90)), Some(i64::MIN + 1)), None);
    }

    #[test]
    fn behaviour_19_a_hole_in_the_times_after_an_outage_is_a_gap_and_otherwise_is_none() {
        let mut watch = GapWatch::after(None);
        for nth in 0..10 {
            assert_eq!(watch.seen("a", Some(at(10 * nth)), None), None);
        }
        assert_eq!(
            watch.seen("a", Some(at(1000)), None),
            None,
            "nothing was interrupted"
        );
        watch.connected();
        assert_eq!(watch.seen("a", Some(at(1010)), None), None);
        let gap = Gap {
            from: at(1010),
            to: at(1500),
            missing: None,
        };
        assert_eq!(watch.seen("a", Some(at(1500)), None), Some(gap));
        assert_eq!(watch.seen("a", Some(at(1510)), None), None);
    }

    #[test]
    fn behaviour_19_the_time_for_which_a_service_was_down_is_a_gap_and_no_usual_step() {
        let mut watch = GapWatch::after(Some(at(1_000)));
        watch.connected();
        let mut gaps = Vec::new();
        for nth in 0..10 {
            gaps.extend(watch.seen("a", Some(at(9_000 + 10 * nth)), None));
        }
        let gap = |from, to| Gap {
            from: at(from),
            to: at(to),
            missing: None,
        };
        assert_eq!(gaps, [gap(1_000, 9_000)]);
        let hole = watch.seen("a", Some(at(9_200)), None);
        assert_eq!(hole, Some(gap(9_090, 9_200)), "the usual step is 10 ms");
        let mut watch = GapWatch::after(Some(at(1_000)));
        watch.connected();
        for nth in 1..10 {
            let gap = watch.seen("a", Some(at(1_000 + 10 * nth)), None);
            assert_eq!(gap, None, "nothing is missing");
        }
    }

    #[test]
    fn a_message_whose_values_are_left_out_is_not_missing() {
        let mut watch = GapWatch::after(None);
        assert_eq!(watch.seen("a", Some(at(0)), Some(1)), None);
        assert_eq!(watch.seen("a", None, Some(2)), None, "it has no time");
        assert_eq!(watch.seen("a", Some(at(20)), Some(3)), None);
    }
}
