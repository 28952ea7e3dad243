//! Decides what a structural model makes of truths while it runs: of level, trend and coefficients, of the level alone, or a leap.

use athermal_core::node::{Learner, Restored, State};
use athermal_core::time::{Duration, Instant};
use athermal_numerics::{Kalman as Filter, Novelty};
use serde::{Deserialize, Serialize};

use super::KalmanPredictor;
use crate::novelty::{after_learning, novelty_at};
use crate::scaling::Scaling;

/// A truth that misses by more than so many deviations is a leap.
const LEAP: f64 = 10.0;
/// How large the variance of a leap is at most, in that of a prediction: beyond, rounding would be more than noise.
const WIDEST: f64 = 1e12;
/// The share of that variance that the mean has of a level that returns: so seldom does it not from where it has leapt.
const OF_MEAN: f64 = 0.01;

/// Follows the level as truths come in.
#[derive(Debug)]
pub(super) struct Following {
    known: Known,
    at_large: Vec<(f64, f64)>,
    every: Duration,
    /// The regressors of the filter.
    row: Vec<f64>,
    /// How far regressors are from those of the fit, and the filter that it ended with.
    of_fit: Option<(Novelty, Filter)>,
}

/// What is known of level, trend and coefficients.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Known {
    /// As of the last truth. Its first coefficient is by how much the mean has leapt since the fit.
    filter: Filter,
    scaling: Scaling,
    /// When that was.
    last: Option<Instant>,
}

athermal_core::state!(Known, "kalman/2");

impl Known {
    fn new(filter: &Filter, scaling: &Scaling, last: Option<Instant>) -> Self {
        Self {
            filter: filter.with_coefficient(),
            scaling: scaling.clone(),
            last,
        }
    }

    /// The time in seconds from the last truth.
    fn since(&self, of: Instant) -> f64 {
        self.last.map_or(0.0, |last| (of - last).secs().max(0.0))
    }

    /// Where the leap of the mean stands among the states; level and trend are before it.
    fn mean(&self) -> usize {
        self.filter.state().len() - self.filter.regressors()
    }

    /// By how much the truth is expected to differ from the mean of the fit.
    fn expected(&self, regressors: &[f64], of: Instant) -> f64 {
        let scaled = self.scaling.of(regressors);
        self.filter.expected(self.since(of), with_one(scaled))
    }
}

/// The values of regressors by their places, after one that is 1.
fn with_one(scaled: impl Fn(usize) -> f64) -> impl Fn(usize) -> f64 {
    move |nth| nth.checked_sub(1).map_or(1.0, &scaled)
}

/// The standard deviation of a truth so many seconds from now.
pub(super) fn std_dev(filter: &Filter, time: f64, regressors: impl Fn(usize) -> f64) -> f64 {
    let forecast = filter.forecast_of(time, regressors);
    forecast.map_or(f64::NAN, |forecast| {
        (forecast.variance + filter.model().observation).sqrt()
    })
}

/// The variance that the last so many states, which are coefficients, bring into a prediction.
fn variance(filter: &Filter, coefficients: usize, scaled: impl Fn(usize) -> f64) -> f64 {
    let order = filter.state().len();
    let first = order - coefficients;
    let rows = filter.covariance().chunks_exact(order).skip(first);
    let sums = rows.enumerate().map(|(i, row)| {
        let row = row[first..].iter().enumerate();
        scaled(i) * row.map(|(j, value)| value * scaled(j)).sum::<f64>()
    });
    sums.sum::<f64>().max(0.0)
}

impl Following {
    pub(super) fn new(predictor: &KalmanPredictor) -> Self {
        Self {
            known: Known::new(&predictor.filter, &predictor.scaling, None),
            at_large: predictor.at_large.clone(),
            every: predictor.every,
            row: vec![1.0; predictor.regressors.len() + 1],
            of_fit: predictor
                .novelty
                .clone()
                .map(|novelty| (novelty, predictor.filter.clone())),
        }
    }

    /// Goes on to a truth, and takes it for what it tells of the first so many states.
    fn take(&mut self, states: usize, regressors: &[f64], truth: f64, at: Instant) {
        let leap = self.leap(regressors, truth, at);
        let (since, mean) = (self.known.since(at), self.known.mean());
        let Known {
            filter,
            scaling,
            last,
        } = &mut self.known;
        let scaled = scaling.of(regressors);
        for (nth, value) in self.row[1..].iter_mut().enumerate() {
            *value = scaled(nth);
        }
        let share = match *last {
            Some(_) if since > 0.0 && since < self.every.secs() => since / self.every.secs(),
            _ => 1.0,
        };
        filter.advance(since);
        let returns = filter.model().returning > 0.0;
        let widen = |filter: &mut Filter| {
            if let Some(variance) = leap {
                filter.widen(0, variance);
                // A level that does not return needs no other mean.
                filter.widen(mean, if returns { OF_MEAN * variance } else { 0.0 });
            }
        };
        widen(filter);
        if let Some(variance) = leap.filter(|_| mean > 1 && since > 0.0) {
            // A ramp since the last truth would have come as far.
            filter.widen(1, variance / (since * since));
        }
        filter.observe_with(states, &self.row, truth - scaling.truth, share);
        // Whether it stays there shows at the next truth.
        widen(filter);
        *last = Some(at);
    }

    /// How uncertain the level is where a truth misses by so much that it has leapt: as much as it misses.
    fn leap(&self, regressors: &[f64], truth: f64, at: Instant) -> Option<f64> {
        let leap = (truth - self.predict(regressors, at)).powi(2);
        let usual = self.std_dev(regressors, at).powi(2);
        // Written so that NaN fails.
        (leap < f64::INFINITY && leap > LEAP * LEAP * usual).then(|| leap.min(WIDEST * usual))
    }
}

impl Learner for Following {
    fn extrapolates(&self) -> bool {
        true
    }

    fn predict(&self, regressors: &[f64], of: Instant) -> f64 {
        self.known.scaling.truth + self.known.expected(regressors, of)
    }

    fn std_dev(&self, regressors: &[f64], of: Instant) -> f64 {
        let Known {
            filter, scaling, ..
        } = &self.known;
        let scaled = with_one(scaling.of(regressors));
        std_dev(filter, self.known.since(of), scaled)
    }

    fn novelty(&self, regressors: &[f64]) -> f64 {
        let Some((novelty, start)) = &self.of_fit else {
            return f64::NAN;
        };
        let Known {
            filter, scaling, ..
        } = &self.known;
        after_learning(novelty_at(Some(novelty), regressors), || {
            [filter, start].map(|filter| variance(filter, regressors.len(), scaling.of(regressors)))
        })
    }

    fn centre(&self, of: Instant) -> f64 {
        let Known {
            filter, scaling, ..
        } = &self.known;
        scaling.truth + filter.expected(self.known.since(of), with_one(|_| 0.0))
    }

    fn learn(&mut self, regressors: &[f64], truth: f64, at: Instant) {
        let all = self.known.filter.state().len();
        self.take(all, regressors, truth, at);
    }

    fn has_level(&self) -> bool {
        true
    }

    fn follow_level(&mut self, regressors: &[f64], truth: f64, at: Instant) {
        self.take(self.known.mean() + 1, regressors, truth, at);
    }

    fn segment(&mut self, _shift: Duration) {
        // How long the machine was not watched is unknown, and so is where the level has gone meanwhile.
        let mean = self.known.mean();
        let leapt = self.known.filter.state()[mean];
        self.known.filter.restart_level(&self.at_large);
        self.known.filter.widen(mean, leapt * leapt);
        self.known.last = None;
    }

    fn snapshot(&self) -> Box<dyn State> {
        Box::new(self.known.clone())
    }

    fn restore(&mut self, state: Box<dyn State>) -> Restored {
        let known = match state.known::<Known>() {
            Ok(known) => known,
            Err(cold) => return cold,
        };
        if known.scaling != self.known.scaling {
            return Restored::cold("its coefficients are for features on another scale");
        }
        if known.filter.is_diffuse() {
            return Restored::cold("it knows nothing of a state");
        }
        if !self.known.filter.resume(&known.filter) {
            return Restored::cold("it has other states: a trend more or less, or other features");
        }
        self.known.last = known.last;
        Restored::Accepted
    }
}

#[cfg(test)]
mod tests {
    use athermal_numerics::{Passage, Structural};

    use super::*;

    fn scaling() -> Scaling {
        Scaling {
            means: vec![10.0],
            scales: vec![2.0],
            truth: 100.0,
        }
    }

    /// A level of 1 and a coefficient of 3 on scaled values.
    fn filter() -> Filter {
        let model = Structural {
            observation: 1.0,
            level: 0.01,
            trend: None,
            returning: 0.001,
            passage: Passage::Continuous,
        };
        Filter::starting_at(model, vec![1.0, 3.0], &[0.5, 0.1, 0.1, 0.2]).unwrap()
    }

    fn following() -> Following {
        Following::new(&KalmanPredictor {
            regressors: vec!["a".to_owned()],
            scaling: scaling(),
            filter: filter(),
            at_large: vec![(0.0, 4.0)],
            every: Duration::ZERO,
            range: None,
            novelty: None,
        })
    }

    fn after(secs: i64) -> Instant {
        Instant::from_ns(secs * 1_000_000_000)
    }

    #[test]
    fn a_leap_is_of_the_level_and_kept_in_mind_until_the_next_truth_confirms_it() {
        let mut following = following();
        let coefficient = |of: &Following| {
            let (state, all) = (of.known.filter.state(), of.known.filter.covariance());
            (state[2], all[8])
        };
        let before = coefficient(&following);
        let from = following.predict(&[14.0], after(0));
        following.learn(&[14.0], from + 500.0, after(0));
        let near = |found: f64, expected: f64, within: f64| {
            let off = (found - expected).abs();
            assert!(off < within * expected.abs(), "{found}, not {expected}");
        };
        near(following.predict(&[14.0], after(0)), from + 500.0, 1e-3);
        near(following.std_dev(&[14.0], after(0)), 500.0, 0.01);
        let now = coefficient(&following);
        near(now.0, before.0, 1e-3);
        near(now.1, before.1, 1e-4);
        following.learn(&[14.0], from + 500.0, after(1));
        assert!(following.std_dev(&[14.0], after(1)) < 2.0);
    }

    #[test]
    fn a_mean_that_has_leapt_is_as_unsure_in_a_new_segment() {
        let mut following = following();
        for secs in 0..20_000 {
            following.learn(&[10.0], 600.0, after(secs));
        }
        following.segment(Duration::ZERO);
        let (mean, deviation) = (
            following.predict(&[10.0], after(0)),
            following.std_dev(&[10.0], after(0)),
        );
        assert!((mean - 600.0).abs() < 20.0, "{mean}");
        assert!((deviation - 500.0).abs() < 20.0, "{deviation}");
    }

    #[test]
    fn what_is_no_number_moves_nothing() {
        let mut following = following();
        let from = following.predict(&[14.0], after(0));
        for truth in [f64::NAN, f64::INFINITY] {
            following.learn(&[14.0], truth, after(0));
            assert_eq!(following.predict(&[14.0], after(0)), from);
        }
    }
}
