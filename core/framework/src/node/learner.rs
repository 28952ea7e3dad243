//! Decides what the author of a learning estimator implements: going on from a fit; when there is something to learn from is
//! decided by the engine.

use std::fmt::Debug;

use serde::{Deserialize, Serialize};

use super::{LinearForm, Mistake, Restored, State};
use crate::node::numbers;
use crate::time::{Duration, Instant};

/// Whether an estimator goes on learning while it runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Learns {
    /// It stays as it was fitted.
    Never {
        /// What to write instead, where something else of the kind learns.
        help: Option<&'static str>,
    },
    /// With `learn = true`.
    OnRequest,
    /// Unless the graph says `learn = false`.
    ByDefault,
}

/// A fitted estimator that goes on learning; a [`Predictor`](super::Predictor) makes it.
///
/// The predictor stays as it was fitted and may be shared; what is learned since is the learner's own. The engine hands over
/// each run's regressors with the truth that belongs to them, once the embargo lets it through, and asks for a prediction
/// first: learning is test-then-train. It hands over nothing while learning is frozen. A whole learner, which predicts the
/// last truth that it learned:
///
/// ```
/// use athermal_core::node::prelude::*;
///
/// #[derive(Debug, Clone, Serialize, Deserialize)]
/// struct Start {
///     value: f64,
/// }
///
/// impl Predictor for Start {
///     fn uses(&self) -> &[String] {
///         &[]
///     }
///
///     fn predict(&self, _regressors: &[f64]) -> f64 {
///         self.value
///     }
///
///     fn learner(&self) -> Option<Box<dyn Learner>> {
///         Some(Box::new(Last { value: self.value }))
///     }
/// }
///
/// athermal_core::predictor!(Start, "start");
///
/// #[derive(Debug, Clone, Serialize, Deserialize)]
/// struct Last {
///     value: f64,
/// }
///
/// impl Learner for Last {
///     fn extrapolates(&self) -> bool {
///         true
///     }
///
///     fn predict(&self, _regressors: &[f64], _of: Instant) -> f64 {
///         self.value
///     }
///
///     fn learn(&mut self, _regressors: &[f64], truth: f64, _at: Instant) {
///         self.value = truth;
///     }
///
///     fn snapshot(&self) -> Box<dyn State> {
///         Box::new(self.clone())
///     }
///
///     fn restore(&mut self, state: Box<dyn State>) -> Restored {
///         state.replace(self)
///     }
/// }
///
/// athermal_core::state!(Last, "last/1");
/// # fn main() {}
/// ```
pub trait Learner: Debug + Send {
    /// The prediction of the truth that will be measured at `of`, from present values of the used regressors.
    fn predict(&self, regressors: &[f64], of: Instant) -> f64;

    /// What it predicts now, where that is a [`LinearForm`] whatever the instant, to the bit, and a run changes nothing: the engine then
    /// sums those of several estimators that read the same values at once, and neither asks each for its prediction nor
    /// calls [`run`](Learner::run).
    fn linear(&self) -> Option<LinearForm<'_>> {
        None
    }

    /// The standard deviation of the truth that will be measured at `of` about its prediction; NaN where it is not known. Truths
    /// that miss by too much in units of it are not handed over. How large misses are is learned anew where it comes or goes: one
    /// that is known should stay so.
    fn std_dev(&self, _regressors: &[f64], _of: Instant) -> f64 {
        f64::NAN
    }

    /// How far these regressors are outside of what it knows, of the rows of the fit and of what it has learned since: 1 at the edge,
    /// more outside, NaN where it is not known. Only asked of kinds that say
    /// [`Estimator::has_novelty`](super::Estimator::has_novelty).
    fn novelty(&self, _regressors: &[f64]) -> f64 {
        f64::NAN
    }

    /// What it predicts of the truth that will be measured at `of` from regressors in the middle of the rows of the fit: where a
    /// prediction goes that is not trusted. Only asked of kinds that say
    /// [`Estimator::has_novelty`](super::Estimator::has_novelty).
    fn centre(&self, _of: Instant) -> f64 {
        0.0
    }

    /// The root mean square by which the truths of the fit missed their predictions, for a kind without a standard deviation; NaN where
    /// it is not known. The first truths that miss by much more are not handed over.
    fn usual_error(&self) -> f64 {
        f64::NAN
    }

    /// Takes the regressors of a run, NaN where one is absent, which predicts the truth that will be measured at `of`; every
    /// truth that arrived up to `arrived` has been handed over, if it was to be. For learners whose state goes on without a
    /// truth; `of` never goes back, and nothing is allocated here once the number of runs within the horizon is known.
    fn run(&mut self, _regressors: &[f64], _of: Instant, _arrived: Instant) {}

    /// Whether truths only move a state, and nothing of the model: they are then handed over while learning is frozen on
    /// command too.
    fn tracks_state(&self) -> bool {
        false
    }

    /// Whether it goes on from where the last truths were, as an autoregression goes on from those among its regressors. It is
    /// then given the truth of a run's own tick before the run, where that would be allowed as a regressor.
    fn extrapolates(&self) -> bool {
        self.tracks_state()
    }

    /// Whether the state is where it should be, after as many truths as that takes. Until it is, truths are handed over in a
    /// free run too.
    fn is_settled(&self) -> bool {
        true
    }

    /// Each truth is about so long a window before it; zero where it is of an instant. Said once, before the first.
    fn set_window(&mut self, _window: Duration) {}

    /// In which time what it learns fades, of kinds that go back to their fit. At most ten truths of one window are then handed over.
    fn memory(&self) -> Option<Duration> {
        None
    }

    /// Whether it speaks only while it errs no more than the fit that it began from: until there have been 20 windows of truth, and one
    /// memory after the last, the fit stands in.
    fn yields_to_fit(&self) -> bool {
        self.memory().is_some()
    }

    /// What stands in for it where its fit is to, of kinds whose fit follows truths too; of others the predictor does, as it was fitted.
    fn as_fitted(&self) -> Option<&dyn Learner> {
        None
    }

    /// Whether a truth that belongs to these regressors would say so little that it is better passed over.
    fn says_little(&self, _regressors: &[f64]) -> bool {
        false
    }

    /// A truth that says little: time goes on without being forgotten in, and a level follows it.
    fn pass_over(&mut self, _regressors: &[f64], _truth: f64, _at: Instant) {}

    /// A truth, measured at `at`, and the regressors of the run that it belongs to. Instants never go back.
    ///
    /// Nothing is allocated here.
    fn learn(&mut self, regressors: &[f64], truth: f64, at: Instant);

    /// Whether it has a level that truths move whatever becomes of its coefficients, by [`follow_level`](Self::follow_level). Where
    /// a regressor lies outside the range of the fit, nothing is learned but the level goes on.
    fn has_level(&self) -> bool {
        false
    }

    /// The same as [`learn`](Self::learn), but for its level alone. Only asked of those that have one.
    fn follow_level(&mut self, _regressors: &[f64], _truth: f64, _at: Instant) {}

    /// The next tick belongs to another segment of the data, whose clock is `shift` ahead of a seamless continuation.
    ///
    /// What was learned stays; instants that are kept move by `shift`.
    fn segment(&mut self, _shift: Duration) {}

    /// All that the next predictions depend on, beside the regressors.
    fn snapshot(&self) -> Box<dyn State>;

    /// Goes on from what a learner of this kind knew, maybe with other parameters, of another fit or in an older form.
    fn restore(&mut self, state: Box<dyn State>) -> Restored;
}

/// The smallest and largest value of each regressor among the rows of a fit.
///
/// Far outside of it a row says more about the shape of the model than about its coefficients, so that nothing is learned
/// there unless the graph allows it.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrainedRange {
    #[serde(with = "numbers")]
    lowest: Vec<f64>,
    #[serde(with = "numbers")]
    highest: Vec<f64>,
}

impl TrainedRange {
    /// Of no rows yet.
    #[must_use]
    pub fn new(width: usize) -> Self {
        Self {
            lowest: vec![f64::INFINITY; width],
            highest: vec![f64::NEG_INFINITY; width],
        }
    }

    /// Widens it to a row.
    pub fn include(&mut self, row: &[f64]) {
        let ends = self.lowest.iter_mut().zip(&mut self.highest);
        for ((lowest, highest), &value) in ends.zip(row) {
            *lowest = lowest.min(value);
            *highest = highest.max(value);
        }
    }

    /// The range of some of the regressors, in this order.
    #[must_use]
    pub fn of(&self, columns: &[usize]) -> Self {
        let some = |ends: &[f64]| columns.iter().map(|&column| ends[column]).collect();
        Self {
            lowest: some(&self.lowest),
            highest: some(&self.highest),
        }
    }

    /// What of it does not fit so many regressors.
    #[must_use]
    pub fn mistakes(&self, width: usize) -> Vec<Mistake> {
        let ends = [
            ("lowest", self.lowest.len()),
            ("highest", self.highest.len()),
        ];
        Mistake::of_lengths(width, &ends)
    }

    /// Whether each value lies within its range, widened on either side by `margin` times its width.
    #[must_use]
    pub fn contains(&self, row: &[f64], margin: f64) -> bool {
        let ends = self.lowest.iter().zip(&self.highest);
        // Without a way out, so that several values are looked at at once.
        ends.zip(row)
            .fold(true, |all, ((&lowest, &highest), &value)| {
                let beyond = margin * (highest - lowest);
                all & (value >= lowest - beyond) & (value <= highest + beyond)
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_range_is_widened_by_its_margin_and_nan_lies_in_none() {
        let mut range = TrainedRange::new(2);
        for row in [[1.0, 5.0], [3.0, 5.0], [2.0, 5.0]] {
            range.include(&row);
        }
        assert!(range.contains(&[1.0, 5.0], 0.0) && range.contains(&[3.0, 5.0], 0.0));
        assert!(!range.contains(&[3.1, 5.0], 0.0) && range.contains(&[3.9, 5.0], 0.5));
        assert!(!range.contains(&[4.1, 5.0], 0.5) && !range.contains(&[-0.1, 5.0], 0.5));
        assert!(!range.contains(&[2.0, 5.1], 0.5), "a constant has no width");
        assert!(!range.contains(&[f64::NAN, 5.0], 0.0));
        assert!(range.of(&[1]).contains(&[5.0], 0.0));
        assert!(!range.of(&[1]).contains(&[2.0], 0.0));
    }
}
