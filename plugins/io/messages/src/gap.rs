//! What others dropped: holes in the numbers of messages, and in their times after an interruption.

use std::collections::HashMap;

use athermal_core::time::{Duration, Instant};

/// How long after a connection has begun a hole may be found that the interruption before it made.
const WATCH: Duration = Duration::from_ns(60_000_000_000);
/// A hole is as long as so many usual steps.
const STEPS: f64 = 5.0;
/// And so many times as long as steps are now and then.
const NOW_AND_THEN: i64 = 2;
/// From how many steps on there is a usual one; and so many times behind a step show that its end was no wrong time.
const KNOWN: u32 = 3;
/// Steps that are now and then longer are looked for among so many, and those before.
const BLOCK: u32 = 500;
/// Numbers that fall by more have begun again.
const AGAIN: i64 = 1000;

/// Looks for holes: by numbers wherever they are, and by times once for each interruption.
#[derive(Debug)]
pub struct GapWatch {
    newest: Option<Instant>,
    steps: Steps,
    /// When the connection began behind an interruption whose hole has not been found.
    interrupted: Option<Instant>,
    /// A step that may be a hole, and how many times came behind it.
    suspect: Option<(Instant, Instant, u32)>,
    /// How long after its time a message has come at least.
    lag: Option<Duration>,
    /// By topic: the last number.
    numbers: HashMap<String, i64>,
}

/// The steps between times, in nanoseconds.
#[derive(Debug, Default)]
struct Steps {
    /// The usual one, and of how many it is the mean.
    mean: f64,
    count: u32,
    /// The two longest of this block, and of the one before. One that is long is a machine that was silent; two are its way.
    longest: [[i64; 2]; 2],
    in_block: u32,
}

impl Steps {
    fn are_known(&self) -> bool {
        self.count >= KNOWN
    }

    fn is_hole(&self, step: Duration) -> bool {
        let now_and_then = self.longest[0][1].max(self.longest[1][1]);
        step.as_ns() as f64 > STEPS * self.mean && step.as_ns() > NOW_AND_THEN * now_and_then
    }

    fn add(&mut self, step: Duration) {
        let step_ns = step.as_ns();
        if !self.are_known() || step_ns as f64 <= STEPS * self.mean {
            self.count = (self.count + 1).min(50);
            self.mean += (step_ns as f64 - self.mean) / f64::from(self.count);
        }
        let [first, second] = &mut self.longest[0];
        *second = (*second).max(step_ns.min(*first));
        *first = (*first).max(step_ns);
        self.in_block += 1;
        if self.in_block == BLOCK {
            (self.longest, self.in_block) = ([[0; 2], self.longest[0]], 0);
        }
    }
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
            steps: Steps::default(),
            interrupted: None,
            suspect: None,
            lag: None,
            numbers: HashMap::new(),
        }
    }

    /// A connection has begun, at this time of day.
    pub fn connected(&mut self, now: Instant) {
        // What nothing came before was not interrupted.
        self.interrupted = self.newest.map(|_| now);
    }

    /// A message has come, whether its values are of use or not, with its time and its number where it has them.
    pub fn seen(
        &mut self,
        topic: &str,
        stamp: Option<Instant>,
        number: Option<i64>,
        now: Instant,
    ) -> Option<Gap> {
        let from = self.newest;
        let by_time = stamp.and_then(|stamp| self.by_time(stamp, now));
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

    fn by_time(&mut self, stamp: Instant, now: Instant) -> Option<Gap> {
        let mut newest = self.newest.unwrap_or(stamp);
        if let Some((from, to, _)) = self.suspect
            && from < stamp
            && stamp < to
        {
            // That was a wrong time, or not in order.
            (self.suspect, newest) = (None, from);
        }
        self.newest = Some(newest.max(stamp));
        let step = stamp - newest;
        if step <= Duration::ZERO {
            return None;
        }
        let Some((from, to, behind)) = &mut self.suspect else {
            let is_known = self.steps.are_known();
            if self.steps.is_hole(step) && (is_known || self.interrupted.is_some()) {
                self.suspect = Some((newest, stamp, 0));
                return None;
            }
            self.steps.add(step);
            self.came(stamp, now);
            return None;
        };
        *behind += 1;
        let suspect = (*behind >= KNOWN).then_some((*from, *to));
        self.steps.add(step);
        self.came(stamp, now);
        let (from, to) = suspect.filter(|_| self.steps.are_known())?;
        self.suspect = None;
        let is_hole = self.steps.is_hole(to - from);
        // What was measured behind the interruption is missing for another reason: a machine that was silent, or is not on time.
        let is_before = |began: &Instant| from + self.lag.unwrap_or(Duration::ZERO) < *began;
        let is_by_interruption = self.interrupted.as_ref().is_some_and(is_before);
        if !is_hole || !is_by_interruption {
            self.steps.add(to - from);
            return None;
        }
        self.interrupted = None;
        Some(Gap::by_time(from, to))
    }

    /// A message has come with a time that is none of a suspect.
    fn came(&mut self, stamp: Instant, now: Instant) {
        let lag = now - stamp;
        self.lag = Some(self.lag.map_or(lag, |least| least.min(lag)));
        if self.suspect.is_none() && self.interrupted.is_some_and(|began| now - began > WATCH) {
            self.interrupted = None;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(ms: i64) -> Instant {
        Instant::from_ns(ms * 1_000_000)
    }

    /// What is found of times in ms that come as soon as they are measured.
    fn live(watch: &mut GapWatch, times: impl IntoIterator<Item = i64>) -> Vec<Gap> {
        let seen = |ms| watch.seen("a", Some(at(ms)), None, at(ms));
        times.into_iter().filter_map(seen).collect()
    }

    fn gap(from: i64, to: i64) -> Gap {
        Gap::by_time(at(from), at(to))
    }

    #[test]
    fn behaviour_19_a_hole_in_the_numbers_of_a_topic_is_a_gap() {
        let mut watch = GapWatch::after(None);
        let mut seen =
            |topic: &str, ms: i64, number| watch.seen(topic, Some(at(ms)), Some(number), at(ms));
        for (ms, number) in [(0, 7), (10, 8), (10, 8), (20, 9)] {
            assert_eq!(seen("a", ms, number), None);
        }
        assert_eq!(seen("b", 25, 1), None, "another topic counts for itself");
        let gap = Gap {
            from: at(25),
            to: at(60),
            missing: Some(3),
        };
        assert_eq!(seen("a", 60, 13), Some(gap));
        assert_eq!(seen("a", 30, 10), None, "it comes late");
        assert_eq!(seen("a", 70, 14), None);
        assert_eq!(seen("a", 80, i64::MIN), None, "it begins again");
        assert_eq!(seen("a", 90, i64::MIN + 1), None);
    }

    #[test]
    fn behaviour_19_a_hole_in_the_times_after_an_outage_is_a_gap_once_and_otherwise_is_none() {
        let mut watch = GapWatch::after(None);
        watch.connected(at(0));
        let silent = (0..10).chain(100..110).map(|nth| 10 * nth);
        assert_eq!(live(&mut watch, silent), [], "nothing was interrupted");
        watch.connected(at(1_095));
        // What the broker held comes first, and lacks its end.
        assert_eq!(live(&mut watch, [1_100]), []);
        watch.connected(at(1_490));
        let behind = (0..20).map(|nth| 1_500 + 10 * nth);
        assert_eq!(live(&mut watch, behind), [gap(1_100, 1_500)]);
        let later = [2_500, 2_510, 2_520, 2_530, 3_500, 3_510, 3_520, 3_530];
        assert_eq!(live(&mut watch, later), [], "it has been reported");
    }

    #[test]
    fn behaviour_19_a_hole_within_what_the_broker_held_is_a_gap() {
        let mut watch = GapWatch::after(Some(at(990)));
        watch.connected(at(9_000));
        let held = (100..200).chain(800..950);
        let seen = |nth: i64| watch.seen("a", Some(at(10 * nth)), None, at(9_000 + nth / 10));
        let gaps: Vec<_> = held.filter_map(seen).collect();
        assert_eq!(gaps, [gap(1_990, 8_000)]);
    }

    #[test]
    fn behaviour_19_the_time_for_which_a_service_was_down_is_a_gap_and_no_usual_step() {
        let mut watch = GapWatch::after(Some(at(1_000)));
        watch.connected(at(9_000));
        let behind = (0..10).map(|nth| 9_000 + 10 * nth);
        assert_eq!(live(&mut watch, behind), [gap(1_000, 9_000)]);
        let mut watch = GapWatch::after(Some(at(1_000)));
        watch.connected(at(1_005));
        let whole = (1..10).map(|nth| 1_000 + 10 * nth);
        assert_eq!(live(&mut watch, whole), [], "nothing is missing");
    }

    #[test]
    fn a_publisher_that_is_not_on_time_makes_no_gaps_however_often_it_is_interrupted() {
        for seed in 0..20 {
            let mut prng = athermal_core::prng::Prng::stream(seed, "gaps");
            let mut watch = GapWatch::after(Some(at(0)));
            watch.connected(at(0));
            let (mut now_us, mut gaps) = (0_i64, 0);
            for nth in 0..30_000 {
                // A thousand a second, held up for up to 30 ms now and then.
                let is_held_up = prng.uniform() < 0.02;
                let most = if is_held_up { 30e3 } else { 1e3 };
                now_us += prng.between(200.0, most) as i64;
                let now = Instant::from_ns(now_us * 1_000);
                if nth % 5_000 == 2_500 {
                    watch.connected(now);
                }
                gaps += usize::from(watch.seen("a", Some(now), None, now).is_some());
            }
            // The first steps may be no usual ones.
            assert_eq!(gaps, 0, "{seed}");
        }
    }

    #[test]
    fn a_time_that_is_wrong_makes_no_gap_and_hides_none() {
        let mut watch = GapWatch::after(None);
        assert_eq!(live(&mut watch, (0..100).map(|nth| 10 * nth)), []);
        watch.connected(at(995));
        // An hour ahead, and again.
        let wrong = watch.seen("a", Some(at(3_601_000)), None, at(1_000));
        assert_eq!(wrong, None);
        assert_eq!(live(&mut watch, (101..150).map(|nth| 10 * nth)), []);
        watch.connected(at(5_000));
        assert_eq!(watch.seen("a", Some(at(3_605_000)), None, at(5_000)), None);
        let behind = (501..520).map(|nth| 10 * nth);
        assert_eq!(live(&mut watch, behind), [gap(1_490, 5_010)]);
    }

    #[test]
    fn a_message_whose_values_are_left_out_is_not_missing() {
        let mut watch = GapWatch::after(None);
        let seen = |watch: &mut GapWatch, ms: Option<i64>, number| {
            watch.seen("a", ms.map(at), Some(number), at(0))
        };
        assert_eq!(seen(&mut watch, Some(0), 1), None);
        assert_eq!(seen(&mut watch, None, 2), None, "it has no time");
        assert_eq!(seen(&mut watch, Some(20), 3), None);
    }
}
