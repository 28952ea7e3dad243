//! Intervals about a prediction that hold as often as they say.

use std::collections::VecDeque;

use athermal_core::node::{Combine, Combiner, Evidence, InputPort, Restored, State, Votes};
use athermal_core::time::{Duration, Instant};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::mean::mean;

/// Adaptive conformal inference: intervals about any prediction, calibrated by its recent errors.
///
/// The interval is `ŷ ± q`, with `q` the `⌈(n + 1)(1 − α)⌉`-th smallest of the `n` absolute errors in memory (Vovk,
/// Gammerman and Shafer 2005). `α` starts at `1 − coverage`, and moves with every truth by
/// `gain · (1 − coverage − miss)` (Gibbs and Candès 2021, equation 2). `miss` is 1 where the truth lay outside of the
/// interval that was given for it, and 0 where not. As there, `α` may fall below 0 and rise above 1, the farther the
/// more intervals were given before a truth comes: what was missed is made up for. So the share of truths within
/// comes to `coverage` also when a machine changes, as long as its errors do not keep outgrowing all that are in
/// memory. It is a share over time, not at each instant. Only truths that the embargo lets through count.
///
/// The prediction is passed on as it is; of several, it is their mean. The ports `lower` and `upper` have the ends.
/// They have no value until there are `1/(1 − coverage) − 1` errors, 9 for nine tenths. Where more is asked for than
/// any error in memory, the interval reaches as far as the largest, and not to infinity as in the source. What is
/// missed then is not all made up for. A miss of an interval that reaches as far as that takes `α` no lower than
/// `min(α, −gain)`. A truth on an interval that is only the prediction takes it no higher than `max(α, 1 + gain)`.
/// `athermal evaluate` shows how often intervals held.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Conformal {
    /// The share of truths that the intervals are to cover, above 0 and below 1.
    #[serde(default = "nine_tenths")]
    #[schemars(extend("exclusiveMinimum" = 0.0, "exclusiveMaximum" = 1.0))]
    pub coverage: f64,
    /// How long an error is remembered, counted from when the embargo lets its truth through: a duration, such as "2d", and no
    /// number of truths. One in which a few hundred truths come makes a steady interval.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub memory: Duration,
    /// How much a miss widens the next intervals, 0 (not at all) to 1; small is steady, large adapts fast.
    #[serde(default = "one_in_two_hundred")]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub gain: f64,
}

fn nine_tenths() -> f64 {
    0.9
}

fn one_in_two_hundred() -> f64 {
    0.005
}

impl Combiner for Conformal {
    fn inputs() -> &'static [InputPort] {
        const {
            &[
                InputPort::held("prediction", "what the intervals are about"),
                InputPort::truth("what is predicted, for the errors"),
            ]
        }
    }

    fn coverage(&self) -> Option<f64> {
        Some(self.coverage)
    }

    fn memory(&self) -> Duration {
        self.memory
    }

    fn is_endless(&self) -> bool {
        // The miscoverage sums up all misses.
        self.gain > 0.0
    }

    fn build(&self, _voters: usize) -> Box<dyn Combine> {
        Box::new(Calibrating {
            parameters: self.clone(),
            known: Known {
                coverage: self.coverage,
                miscoverage: 1.0 - self.coverage,
                errors: VecDeque::new(),
            },
            sorted: Vec::new(),
        })
    }
}

/// Keeps errors in the order of arrival and of size.
struct Calibrating {
    parameters: Conformal,
    known: Known,
    sorted: Vec<f64>,
}

/// What was learned of the errors of a prediction.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Known {
    /// The share of truths that was to be covered.
    coverage: f64,
    /// The share of misses that the next interval allows for, `α`.
    miscoverage: f64,
    /// When truths arrived, and the absolute errors, oldest first.
    errors: VecDeque<(Instant, f64)>,
}

athermal_core::state!(Known, "conformal/1");

/// The extent of an interval that no error in memory makes as wide as is asked for, and of one that is asked to hold nothing.
const WIDEST: f64 = 1.0;
const POINT: f64 = -1.0;

/// A share such as 1 − 0.9 is not what it looks like in binary; a rank must not hang on its last bit.
const ROUNDING: f64 = 1e-9;

impl Calibrating {
    /// The fewest errors `n` of which the `⌈(n + 1) · coverage⌉`-th smallest is one.
    fn needed(&self) -> f64 {
        let coverage = self.parameters.coverage;
        ((coverage - ROUNDING) / (1.0 - coverage)).ceil()
    }

    /// Which of the errors the interval reaches to, from 1; 0 or less of a point, and more than there are where none is enough.
    fn rank(&self) -> f64 {
        let count = self.sorted.len() as f64;
        ((count + 1.0) * (1.0 - self.known.miscoverage) - ROUNDING).ceil()
    }

    /// How far the interval reaches to either side; none while there are too few errors.
    fn reach(&self) -> Option<f64> {
        let count = self.sorted.len() as f64;
        if count < self.needed() {
            return None;
        }
        let rank = self.rank().clamp(0.0, count) as usize;
        Some(rank.checked_sub(1).map_or(0.0, |nth| self.sorted[nth]))
    }

    fn forget_first(&mut self) {
        if let Some((_, error)) = self.known.errors.pop_front() {
            let place = self.sorted.partition_point(|&other| other < error);
            self.sorted.remove(place);
        }
    }
}

impl Combine for Calibrating {
    fn combine(&self, votes: Votes<'_>) -> f64 {
        mean(votes)
    }

    fn interval(&self, votes: Votes<'_>) -> [f64; 2] {
        let prediction = self.combine(votes);
        let ends = self
            .reach()
            .map(|reach| [prediction - reach, prediction + reach]);
        ends.filter(|ends| ends.iter().all(|end| end.is_finite()))
            .unwrap_or([f64::NAN; 2])
    }

    fn extent(&self) -> f64 {
        let rank = self.rank();
        if rank > self.sorted.len() as f64 {
            WIDEST
        } else if rank < 1.0 {
            POINT
        } else {
            0.0
        }
    }

    fn judge(&mut self, [lower, upper]: [f64; 2], extent: f64, truth: f64) {
        if lower.is_nan() || upper.is_nan() {
            return;
        }
        let missed = !(lower <= truth && truth <= upper);
        let Conformal { coverage, gain, .. } = self.parameters;
        let miss = if missed { 1.0 } else { 0.0 };
        let before = self.known.miscoverage;
        let moved = before + gain * (1.0 - coverage - miss);
        // In the source nothing is missed by an interval without ends and everything by an empty one, so that α goes no farther than
        // this where truths come at once (lemma 4.1). Here the largest error in memory stands for infinity and a point for nothing:
        // what lies beyond the one or on the other must not wind α up.
        self.known.miscoverage = if missed && extent == WIDEST {
            moved.max(before.min(-gain))
        } else if !missed && extent == POINT {
            moved.min(before.max(1.0 + gain))
        } else {
            moved
        };
    }

    fn observe(&mut self, votes: Votes<'_>, truth: f64, arrived: Instant) {
        let error = (truth - self.combine(votes)).abs();
        if error.is_finite() {
            self.known.errors.push_back((arrived, error));
            let place = self.sorted.partition_point(|&other| other < error);
            self.sorted.insert(place, error);
        }
    }

    fn advance(&mut self, newest: Instant) {
        let forgotten = newest - self.parameters.memory;
        while matches!(self.known.errors.front(), Some(&(arrived, _)) if arrived <= forgotten) {
            self.forget_first();
        }
    }

    fn segment(&mut self, shift: Duration) {
        for (arrived, _) in &mut self.known.errors {
            *arrived = *arrived + shift;
        }
    }

    fn evidence(&self) -> Option<Evidence> {
        Some(Evidence {
            truths: self.sorted.len() as f64,
            needed: self.needed(),
            remedy: "a longer `memory`",
        })
    }

    fn snapshot(&self) -> Option<Box<dyn State>> {
        Some(Box::new(self.known.clone()))
    }

    fn restore(&mut self, state: Box<dyn State>) -> Restored {
        match state.known::<Known>() {
            Ok(mut known) => {
                let coverage = self.parameters.coverage;
                // What was right for another share would be wrong for this one, and small gains hardly move it.
                if known.coverage != coverage {
                    (known.coverage, known.miscoverage) = (coverage, 1.0 - coverage);
                }
                self.known = known;
                let errors = self.known.errors.iter().map(|&(_, error)| error);
                self.sorted = errors.collect();
                self.sorted.sort_unstable_by(f64::total_cmp);
                // Whoever steps from here on must not have to make room.
                let room = self.sorted.len().max(32);
                self.known.errors.reserve(room);
                self.sorted.reserve(room);
                Restored::Accepted
            }
            Err(cold) => cold,
        }
    }
}

athermal_core::register!(Conformal, Combiner, "conformal");

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    fn s(seconds: i64) -> Instant {
        Instant::from_ns(seconds * 1_000_000_000)
    }

    fn conformal(coverage: f64, gain: f64) -> Box<dyn Combine> {
        let memory = Duration::from_ns(60_000_000_000);
        Conformal {
            coverage,
            memory,
            gain,
        }
        .build(1)
    }

    #[test]
    fn nothing_is_said_before_there_are_enough_errors() {
        let mut node = conformal(0.9, 0.0);
        for second in 0..9 {
            assert!(node.interval(Votes(&[1.0]))[0].is_nan());
            node.observe(Votes(&[0.0]), second as f64, s(second));
        }
        assert_eq!(node.interval(Votes(&[1.0])), [-7.0, 9.0]);
        assert!(node.interval(Votes(&[f64::NAN]))[0].is_nan());
    }

    #[test]
    fn errors_are_forgotten_in_the_order_of_arrival() {
        let mut node = conformal(0.5, 0.0);
        for (second, error) in [5.0, 1.0, 3.0, 2.0].into_iter().enumerate() {
            node.observe(Votes(&[0.0]), error, s(second as i64));
        }
        assert_eq!(node.interval(Votes(&[0.0])), [-3.0, 3.0]);
        node.advance(s(61));
        assert_eq!(
            node.interval(Votes(&[0.0])),
            [-3.0, 3.0],
            "3 and 2 are left"
        );
        node.advance(s(62));
        assert_eq!(node.interval(Votes(&[0.0])), [-2.0, 2.0]);
    }

    #[test]
    fn errors_are_carried_to_another_share_and_what_it_allows_for_is_not() {
        let mut half = conformal(0.5, 0.0);
        for second in 0..19 {
            half.observe(Votes(&[0.0]), second as f64, s(second));
        }
        assert_eq!(half.interval(Votes(&[0.0])), [-9.0, 9.0]);
        let mut more = conformal(0.8, 0.0);
        let answer = more.restore(half.snapshot().unwrap());
        assert_eq!(answer, Restored::Accepted);
        assert_eq!(
            more.interval(Votes(&[0.0])),
            [-15.0, 15.0],
            "0.8 · 20 is 16"
        );
    }

    #[test]
    fn misses_widen_and_hits_narrow() {
        let mut node = conformal(0.5, 0.2);
        for second in 0..19 {
            node.observe(Votes(&[0.0]), second as f64, s(second));
        }
        let reach = |node: &dyn Combine| node.interval(Votes(&[0.0]))[1];
        assert_eq!(reach(&*node), 9.0);
        node.judge([-1.0, 1.0], 0.0, 5.0);
        assert_eq!(reach(&*node), 11.0, "α is 0.4");
        node.judge([-1.0, 1.0], 0.0, 0.0);
        node.judge([-1.0, 1.0], 0.0, 0.0);
        assert_eq!(reach(&*node), 7.0, "α is 0.6");
        node.judge([f64::NAN; 2], 0.0, 5.0);
        assert_eq!(reach(&*node), 7.0, "nothing was said");
        for _ in 0..100 {
            node.judge([-1.0, 1.0], node.extent(), 5.0);
        }
        assert_eq!(reach(&*node), 18.0, "the largest there is");
    }

    #[test]
    fn misses_beyond_what_can_be_allowed_for_are_made_up_for_by_one_gain() {
        let mut node = conformal(0.5, 0.25);
        for second in 0..19 {
            node.observe(Votes(&[0.0]), second as f64, s(second));
        }
        let mut reach_after = |truth: f64| {
            node.judge([-1.0, 1.0], node.extent(), truth);
            node.interval(Votes(&[0.0]))[1]
        };
        // α moves by 1/8 from 1/2: to −1/4 and no farther, and stays below 1/20 for two hits more.
        (0..20).for_each(|_| {
            reach_after(5.0);
        });
        let reached: Vec<f64> = (0..4).map(|_| reach_after(0.0)).collect();
        assert_eq!(reached, [18.0, 18.0, 17.0, 14.0]);
        // And to 5/4, where the interval is a point, for as long.
        (0..20).for_each(|_| {
            reach_after(0.0);
        });
        let reached: Vec<f64> = (0..4).map(|_| reach_after(5.0)).collect();
        assert_eq!(reached, [0.0, 0.0, 2.0, 4.0]);
    }

    /// Truths come after 60 more intervals have been given, and errors are three times as large in every other hour.
    #[test]
    fn intervals_hold_as_often_as_they_say_however_late_truths_come() {
        use athermal_core::prng::Prng;
        for gain in [0.005, 0.05, 0.2] {
            let mut node = Conformal {
                coverage: 0.9,
                memory: Duration::from_ns(7_200_000_000_000),
                gain,
            }
            .build(1);
            let mut prng = Prng::stream(3, "late truths");
            let mut given = VecDeque::new();
            let (mut held, mut all) = (0.0, 0.0);
            for nth in 0..30_000_i64 {
                node.advance(s(10 * nth));
                given.push_back((node.interval(Votes(&[0.0])), node.extent()));
                if given.len() <= 60 {
                    continue;
                }
                let (ends, extent) = given.pop_front().unwrap();
                let size = if nth / 360 % 2 == 0 { 1.0 } else { 3.0 };
                let truth = size * prng.normal();
                node.judge(ends, extent, truth);
                node.observe(Votes(&[0.0]), truth, s(10 * nth));
                if !ends[0].is_nan() {
                    all += 1.0;
                    held += f64::from(u8::from(ends[0] <= truth && truth <= ends[1]));
                }
            }
            let share = held / all;
            assert!((share - 0.9).abs() < 0.006, "gain {gain}: {share}");
        }
    }
}
