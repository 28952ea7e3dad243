//! Decides how well the intervals of predictions hold: how often a truth lies within, and how wide they are for that.

use serde::Serialize;

use crate::compile::PlannedNode;
use crate::engine::Engine;
use crate::node::Role;

/// The share of truths in the intervals that are made of standard deviations, and how many of these they reach to either
/// side: the quantile of the normal distribution.
const OF_DEVIATIONS: (f64, f64) = (0.9, 1.644_853_626_951_472_2);

/// Where the intervals of a node's predictions come from.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Intervals {
    from: From,
    stated: f64,
}

#[derive(Debug, Clone, Copy)]
enum From {
    /// The slots of both ends.
    Bounds { lower: usize, upper: usize },
    /// The slot of the standard deviation.
    StdDev { slot: usize },
}

impl Intervals {
    /// Those of a node, if it gives any.
    pub(crate) fn of(node: &PlannedNode) -> Option<Self> {
        if let Role::Combiner(combiner) = node.spec.role()
            && let (Some(stated), Some((lower, upper))) = (combiner.coverage(), node.role.bounds())
        {
            let from = From::Bounds { lower, upper };
            return Some(Self { from, stated });
        }
        let slot = node.role.std_dev()?;
        Some(Self {
            from: From::StdDev { slot },
            stated: OF_DEVIATIONS.0,
        })
    }

    /// Both ends at the present tick, about a prediction; NaN where there are none.
    pub(crate) fn read(&self, engine: &Engine, prediction: f64) -> [f64; 2] {
        match self.from {
            From::Bounds { lower, upper } => [engine.value(lower), engine.value(upper)],
            From::StdDev { slot } => {
                let reach = OF_DEVIATIONS.1 * engine.value(slot);
                [prediction - reach, prediction + reach]
            }
        }
    }
}

/// How well the intervals of a prediction hold.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct IntervalScore {
    /// What they are: `bounds` that the node gives, or made of the `std_dev` that it gives as if errors were normal.
    pub from: &'static str,
    /// The share of truths that they are to cover.
    pub stated: f64,
    /// Instants with an interval, of those on which the prediction is scored.
    pub n: usize,
    /// The share of truths that they cover.
    pub covered: f64,
    /// Their mean width, in the unit of the truth.
    pub width: f64,
    /// Their mean width, plus `2/(1 − stated)` times the mean distance by which truths lie outside (Gneiting and Raftery
    /// 2007, equation 43): the smaller the better, whatever is covered.
    pub score: f64,
}

impl IntervalScore {
    /// Scores intervals by the truths that they were made for; none where there are none.
    pub(super) fn of(
        intervals: Intervals,
        ends_and_truths: impl Iterator<Item = ([f64; 2], f64)>,
    ) -> Option<Self> {
        let (mut n, mut covered, mut width, mut outside) = (0_usize, 0_usize, 0.0, 0.0);
        for ([lower, upper], truth) in ends_and_truths {
            if lower.is_nan() || upper.is_nan() {
                continue;
            }
            n += 1;
            width += upper - lower;
            covered += usize::from(lower <= truth && truth <= upper);
            outside += (lower - truth).max(truth - upper).max(0.0);
        }
        let count = n as f64;
        let penalty = 2.0 / (1.0 - intervals.stated);
        (n > 0).then(|| Self {
            from: match intervals.from {
                From::Bounds { .. } => "bounds",
                From::StdDev { .. } => "std_dev",
            },
            stated: intervals.stated,
            n,
            covered: covered as f64 / count,
            width: width / count,
            score: (width + penalty * outside) / count,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coverage_width_and_score_are_those_of_the_definition() {
        let intervals = Intervals {
            from: From::Bounds { lower: 0, upper: 1 },
            stated: 0.8,
        };
        let ends = [[0.0, 2.0], [f64::NAN, 1.0], [1.0, 3.0], [-1.0, 3.0]];
        let truths = [2.0, 0.5, 0.0, 3.5];
        let found = IntervalScore::of(intervals, ends.into_iter().zip(truths));
        let expected = IntervalScore {
            from: "bounds",
            stated: 0.8,
            n: 3,
            covered: 1.0 / 3.0,
            width: 8.0 / 3.0,
            // Widths 2, 2 and 4; the truths lie 0, 1 and 0.5 outside, each tenfold.
            score: (8.0 + 10.0 * 1.5) / 3.0,
        };
        let found = found.unwrap();
        assert!((found.score - expected.score).abs() < 1e-12);
        let score = expected.score;
        assert_eq!(IntervalScore { score, ..found }, expected);
        assert_eq!(IntervalScore::of(intervals, std::iter::empty()), None);
    }
}
