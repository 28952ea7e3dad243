//! Decides what a structural model makes of truths while it runs: of level, trend and coefficients, of the level alone, or a leap.

use athermal_core::node::{Learner, Restored, State};
use athermal_core::time::{Duration, Instant};
use athermal_numerics::{Kalman as Filter, Novelty, Resetting};
use serde::{Deserialize, Serialize};

use super::KalmanPredictor;
use crate::novelty::{after_learning, novelty_at};
use crate::rls::SHARE;
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
    novelty: Option<Novelty>,
    start: Filter,
    memory: Duration,
    /// What coefficients go back to, and how little a truth may say of them.
    fading: Option<Resetting>,
    little: f64,
    /// The same with the coefficients of the fit, where there are any: it follows the level alone.
    of_fit: Option<Box<Self>>,
}

/// What is known of level, trend and coefficients.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Known {
    /// As of the last truth. Its first coefficient is by how much the mean has leapt since the fit.
    filter: Filter,
    scaling: Scaling,
    /// When that was.
    last: Option<Instant>,
    /// Up to when what is known of the coefficients has faded.
    #[serde(default)]
    faded: Option<Instant>,
    /// Whether the level alone has followed the last truth, from outside of the fit: it has made up for what is new there.
    #[serde(default)]
    made_up: bool,
    /// What is known with the coefficients of the fit, as it is kept.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    of_fit: Option<Box<Self>>,
}

athermal_core::state!(Known, "kalman/2");

impl Known {
    fn new(filter: &Filter, scaling: &Scaling, last: Option<Instant>) -> Self {
        Self {
            filter: filter.with_coefficient(),
            scaling: scaling.clone(),
            last,
            faded: None,
            made_up: false,
            of_fit: None,
        }
    }

    /// The coefficients.
    fn coefficients(&self) -> &[f64] {
        &self.filter.state()[self.mean() + 1..]
    }

    /// Goes on from what was known of the same states; whether that can be.
    fn resume(&mut self, known: &Self) -> bool {
        let same = !known.filter.is_diffuse() && self.filter.resume(&known.filter);
        if same {
            (self.last, self.faded, self.made_up) = (known.last, known.faded, known.made_up);
        }
        same
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
pub(super) fn variance(filter: &Filter, coefficients: usize, scaled: impl Fn(usize) -> f64) -> f64 {
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
        let of_fit = Box::new(Self::of_level(predictor));
        Self {
            of_fit: Some(of_fit).filter(|_| !predictor.regressors.is_empty()),
            ..Self::of_level(predictor)
        }
    }

    fn of_level(predictor: &KalmanPredictor) -> Self {
        Self {
            known: Known::new(&predictor.filter, &predictor.scaling, None),
            at_large: predictor.at_large.clone(),
            every: predictor.every,
            row: vec![1.0; predictor.regressors.len() + 1],
            novelty: predictor.novelty.clone(),
            start: predictor.filter.clone(),
            memory: predictor.memory,
            fading: Resetting::to(&predictor.filter, predictor.regressors.len(), SHARE),
            little: predictor.little,
            of_fit: None,
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
            ..
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

    /// A truth has been learned from, or said little: up to it the coefficients have faded.
    fn has_passed(&mut self, at: Instant) {
        (self.known.faded, self.known.made_up) = (Some(at), false);
        if let Some(of_fit) = &mut self.of_fit {
            of_fit.has_passed(at);
        }
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
        let Known {
            filter, scaling, ..
        } = &self.known;
        let novelty = novelty_at(self.novelty.as_ref(), regressors);
        if self.known.made_up && novelty > 1.0 {
            return 1.0;
        }
        after_learning(novelty, || {
            [filter, &self.start]
                .map(|filter| variance(filter, regressors.len(), scaling.of(regressors)))
        })
    }

    fn centre(&self, of: Instant) -> f64 {
        let Known {
            filter, scaling, ..
        } = &self.known;
        scaling.truth + filter.expected(self.known.since(of), with_one(|_| 0.0))
    }

    fn memory(&self) -> Option<Duration> {
        Some(self.memory)
    }

    /// Not where it has nothing but the level.
    fn yields_to_fit(&self) -> bool {
        self.of_fit.is_some()
    }

    fn as_fitted(&self) -> Option<&dyn Learner> {
        self.of_fit.as_deref().map(|of_fit| of_fit as &dyn Learner)
    }

    fn says_little(&self, regressors: &[f64]) -> bool {
        let scaled = self.known.scaling.of(regressors);
        variance(&self.start, regressors.len(), scaled) < self.little
    }

    fn pass_over(&mut self, regressors: &[f64], truth: f64, at: Instant) {
        self.follow_level(regressors, truth, at);
        self.has_passed(at);
    }

    fn learn(&mut self, regressors: &[f64], truth: f64, at: Instant) {
        let known = &mut self.known;
        if let (Some(fading), Some(last)) = (&mut self.fading, known.faded) {
            let after_s = (at - last).secs().max(0.0);
            fading.fade(&mut known.filter, after_s / self.memory.secs());
        }
        let all = known.filter.state().len();
        self.take(all, regressors, truth, at);
        if let Some(of_fit) = &mut self.of_fit {
            of_fit.follow_level(regressors, truth, at);
        }
        self.has_passed(at);
    }

    fn has_level(&self) -> bool {
        true
    }

    fn follow_level(&mut self, regressors: &[f64], truth: f64, at: Instant) {
        self.take(self.known.mean() + 1, regressors, truth, at);
        self.known.made_up = true;
        if let Some(of_fit) = &mut self.of_fit {
            of_fit.follow_level(regressors, truth, at);
        }
    }

    fn segment(&mut self, shift: Duration) {
        self.known.faded = self.known.faded.map(|faded| faded + shift);
        // How long the machine was not watched is unknown, and so is where the level has gone meanwhile.
        let mean = self.known.mean();
        let leapt = self.known.filter.state()[mean];
        self.known.filter.restart_level(&self.at_large);
        self.known.filter.widen(mean, leapt * leapt);
        (self.known.last, self.known.made_up) = (None, false);
        if let Some(of_fit) = &mut self.of_fit {
            of_fit.segment(shift);
        }
    }

    fn snapshot(&self) -> Box<dyn State> {
        let of_fit = self.of_fit.as_ref();
        Box::new(Known {
            of_fit: of_fit.map(|of_fit| Box::new(of_fit.known.clone())),
            ..self.known.clone()
        })
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
        let own = self.of_fit.as_deref_mut().zip(known.of_fit.as_deref());
        if let Some((own, kept)) = &own
            && own.known.coefficients() != kept.coefficients()
        {
            return Restored::cold("another fit begins from what it knows itself");
        }
        if !self.known.resume(&known) {
            return Restored::cold("it has other states: a trend more or less, or other features");
        }
        // In an older form the fit has none: its level is found at the next truths.
        if let Some((own, kept)) = own {
            own.known.resume(kept);
        }
        Restored::Accepted
    }
}

#[cfg(test)]
mod tests {
    use athermal_numerics::{Passage, Structural};

    use super::*;
    use crate::rls::day;

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
        Following::new(&predictor())
    }

    fn predictor() -> KalmanPredictor {
        KalmanPredictor {
            regressors: vec!["a".to_owned()],
            scaling: scaling(),
            filter: filter(),
            at_large: vec![(0.0, 4.0)],
            every: Duration::ZERO,
            range: None,
            novelty: None,
            memory: day(),
            little: 0.0,
        }
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
    fn what_was_learned_of_a_coefficient_fades_and_goes_back_to_the_fit() {
        let mut following = following();
        for secs in 0..3000 {
            let x = (0.3 * secs as f64).sin();
            following.learn(&[10.0 + 2.0 * x], 101.0 + 5.0 * x, after(secs));
        }
        let coefficient = |of: &Following| of.known.filter.state()[2];
        assert!((coefficient(&following) - 5.0).abs() < 0.1);
        let kept = following.snapshot();
        let mut other = super::tests::following();
        assert_eq!(other.restore(kept), Restored::Accepted);
        for of in [&mut following, &mut other] {
            // In the middle of the fit it says nothing of the coefficient.
            of.learn(&[10.0], 101.0, after(30 * 86_400));
            let found = coefficient(of);
            assert!((found - 3.0).abs() < 0.05, "{found}");
        }
        let variance = following.known.filter.covariance()[8];
        assert!(variance <= 0.2 / SHARE * 1.001, "{variance}");
    }

    #[test]
    fn what_stands_in_follows_the_level_with_the_coefficients_of_the_fit() {
        let mut following = following();
        for secs in 0..3000 {
            let x = (0.3 * secs as f64).sin();
            following.learn(&[10.0 + 2.0 * x], 121.0 + 5.0 * x, after(secs));
        }
        let of_fit = following.as_fitted().unwrap();
        let at = |value: f64| of_fit.predict(&[value], after(2999));
        assert!((at(10.0) - 121.0).abs() < 2.0, "{}", at(10.0));
        let per_scale = at(12.0) - at(10.0);
        assert!((per_scale - 3.0).abs() < 1e-9, "{per_scale}");
        let mut other = super::tests::following();
        assert_eq!(other.restore(following.snapshot()), Restored::Accepted);
        let other = other.as_fitted().unwrap();
        assert_eq!(other.predict(&[12.0], after(2999)), at(12.0));
    }

    #[test]
    fn what_was_learned_from_another_fit_is_not_gone_on_from() {
        let model = filter().model();
        let other = Filter::starting_at(model, vec![1.0, 4.0], &[0.5, 0.1, 0.1, 0.2]);
        let mut other = Following::new(&KalmanPredictor {
            filter: other.unwrap(),
            ..predictor()
        });
        let kept = following().snapshot();
        assert!(matches!(other.restore(kept), Restored::Cold { .. }));
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
