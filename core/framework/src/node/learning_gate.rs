//! Decides which truths a learner is kept from, beside a machine as in the rehearsal of a fit; how it learns is its own.

use super::recent_error::RecentError;
use super::{Learner, TrainedRange};
use crate::time::Instant;

/// What a learner does not learn from: the key `learn` of an estimator.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LearningLimits {
    /// A truth that misses its prediction by more than this multiple of the recent error is not learned from; both in units of
    /// the learner's deviation, where it has one.
    pub outliers: f64,
    /// By which multiple of its width a regressor may lie outside its range in the fit.
    pub margin: f64,
}

impl LearningLimits {
    /// Everything is learned from.
    pub const NONE: Self = Self {
        outliers: f64::INFINITY,
        margin: f64::INFINITY,
    };
}

/// What keeps a learner from rows that would spoil it.
#[derive(Debug, Clone)]
pub struct LearningGate {
    limits: LearningLimits,
    pub(crate) recent: RecentError,
}

/// What became of a row that was offered.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Admission {
    /// It was learned from.
    Learned,
    /// The truth missed its prediction by too much.
    Outlier,
    /// A regressor lay outside the range of the fit: a level followed it all the same, where there is one.
    OutsideRange,
}

impl LearningGate {
    /// Before the first truth of a learner.
    #[must_use]
    pub fn new(limits: LearningLimits, learner: &dyn Learner) -> Self {
        Self {
            limits,
            recent: RecentError::of_fit(learner.usual_error()),
        }
    }

    /// Lets a learner learn from a truth that was measured at `at` and the regressors of the run that it belongs to, all of them
    /// there, unless something speaks against it. `range` is that of the regressors in the fit, where it was kept.
    pub fn offer(
        &mut self,
        learner: &mut dyn Learner,
        range: Option<&TrainedRange>,
        row: &[f64],
        truth: f64,
        at: Instant,
    ) -> Admission {
        let outside = range.is_some_and(|range| !range.contains(row, self.limits.margin));
        if outside && !learner.has_level() {
            return Admission::OutsideRange;
        }
        let error = truth - learner.predict(row, at);
        let std_dev = learner.std_dev(row, at);
        let most = self.limits.outliers;
        // What has yet to find out where it is may be far off.
        let starts_anywhere = learner.extrapolates();
        if learner.is_settled() && !self.recent.admits(error, std_dev, most, starts_anywhere) {
            return Admission::Outlier;
        }
        if outside {
            learner.follow_level(row, truth, at);
            return Admission::OutsideRange;
        }
        learner.learn(row, truth, at);
        Admission::Learned
    }
}
