//! What others dropped: holes in the numbers of messages, and in their times after an outage.

use std::collections::HashMap;
use std::time::{Duration, Instant as Clock};

use athermal_core::time::Instant;

/// How long after a connection has begun times are looked at.
const WATCH: Duration = Duration::from_secs(60);
/// A hole is as long as so many usual steps.
const STEPS: f64 = 5.0;
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

impl GapWatch {
    /// Goes on behind an instant.
    pub fn after(newest: Option<Instant>) -> Self {
        Self {
            newest,
            step: 0.0,
            steps: 0,
            until: None,
            numbers: HashMap::new(),
        }
    }

    /// A connection has begun.
    pub fn connected(&mut self) {
        self.until = Some(Clock::now() + WATCH);
    }

    /// A message has come, with its time and perhaps its number.
    pub fn seen(&mut self, topic: &str, stamp: Instant, number: Option<i64>) -> Option<Gap> {
        let from = self.newest;
        let by_time = self.by_time(stamp);
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
        (missing > 0).then(|| Gap {
            from: from.unwrap_or(stamp).min(stamp),
            to: stamp,
            missing: Some(missing as u64),
        })
    }

    fn by_time(&mut self, stamp: Instant) -> Option<Gap> {
        let Some(newest) = self.newest else {
            self.newest = Some(stamp);
            return None;
        };
        if stamp <= newest {
            return None;
        }
        self.newest = Some(stamp);
        let step = (stamp - newest).as_ns() as f64;
        let is_watched = self.until.is_some_and(|until| Clock::now() < until);
        let is_hole = self.steps >= 3 && step > STEPS * self.step;
        if is_hole {
            return is_watched.then_some(Gap {
                from: newest,
                to: stamp,
                missing: None,
            });
        }
        self.steps = (self.steps + 1).min(50);
        self.step += (step - self.step) / f64::from(self.steps);
        None
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
            assert_eq!(watch.seen("a", at(ms), Some(number)), None);
        }
        assert_eq!(
            watch.seen("b", at(25), Some(1)),
            None,
            "another topic counts for itself"
        );
        let gap = Gap {
            from: at(25),
            to: at(60),
            missing: Some(3),
        };
        assert_eq!(watch.seen("a", at(60), Some(13)), Some(gap));
        assert_eq!(watch.seen("a", at(30), Some(10)), None, "it comes late");
        assert_eq!(watch.seen("a", at(70), Some(14)), None);
        assert_eq!(
            watch.seen("a", at(80), Some(i64::MIN)),
            None,
            "it begins again"
        );
        assert_eq!(watch.seen("a", at(90), Some(i64::MIN + 1)), None);
    }

    #[test]
    fn behaviour_19_a_hole_in_the_times_after_an_outage_is_a_gap_and_otherwise_is_none() {
        let mut watch = GapWatch::after(None);
        for nth in 0..10 {
            assert_eq!(watch.seen("a", at(10 * nth), None), None);
        }
        assert_eq!(
            watch.seen("a", at(1000), None),
            None,
            "nothing was interrupted"
        );
        watch.connected();
        assert_eq!(watch.seen("a", at(1010), None), None);
        let gap = Gap {
            from: at(1010),
            to: at(1500),
            missing: None,
        };
        assert_eq!(watch.seen("a", at(1500), None), Some(gap));
        assert_eq!(watch.seen("a", at(1510), None), None);
    }
}
