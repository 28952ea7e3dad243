//! Decides which truths a learner is kept from, beside a machine as in the rehearsal of a fit; how it learns is its own.

use super::recent_error::RecentError;
use super::standing::{Speaks, Standing};
use super::{Learner, Predictor};
use crate::time::{Duration, Instant};

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

/// How long after a truth the next one teaches, of truths that each tell of so long a window: at most ten of one do.
#[must_use]
pub fn between_lessons(window: Duration) -> Duration {
    Duration::from_ns(window.as_ns() / 10)
}

/// What keeps a learner from rows that would spoil it.
#[derive(Debug, Clone)]
pub struct LearningGate {
    limits: LearningLimits,
    /// The span of the truth.
    window: Duration,
    pub(crate) recent: RecentError,
    /// How it stands beside its fit, where that is to stand in at times, and after which memory without a truth it does.
    pub(crate) standing: Standing,
    pub(crate) memory: Option<Duration>,
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
    /// It says too little: a level followed it all the same, where there is one.
    SaysLittle,
    /// Its window has taught as often as it may.
    TooMany,
}

impl LearningGate {
    /// Before the first truth of a learner, each of which is about so long a window.
    #[must_use]
    pub fn new(limits: LearningLimits, window: Duration, learner: &mut dyn Learner) -> Self {
        learner.set_window(window);
        Self {
            limits,
            window,
            recent: RecentError::of_fit(learner.usual_error()),
            standing: Standing::new(),
            memory: learner.memory().filter(|_| learner.yields_to_fit()),
        }
    }

    /// Lets a learner learn from a truth that was measured at `at` and the regressors of the run that it belongs to, all of them
    /// there, unless something speaks against it. It began from a fit.
    pub fn offer(
        &mut self,
        learner: &mut dyn Learner,
        fit: &dyn Predictor,
        row: &[f64],
        truth: f64,
        at: Instant,
    ) -> Admission {
        if learner.memory().is_some() {
            let between = between_lessons(self.window);
            let lesson = &mut self.recent.lesson;
            if lesson.is_some_and(|last| at >= last && at - last < between) {
                return Admission::TooMany;
            }
            *lesson = Some(at);
        }
        let range = fit.trained_range();
        let outside = range.is_some_and(|range| !range.contains(row, self.limits.margin));
        if outside && !learner.has_level() {
            return Admission::OutsideRange;
        }
        let error = truth - learner.predict(row, at);
        let std_dev = learner.std_dev(row, at);
        let most = self.limits.outliers;
        // What has yet to find out where it is may be far off.
        let starts_anywhere = learner.extrapolates();
        let (miss, when) = ((error, std_dev), (at, self.window));
        if learner.is_settled() && !self.recent.admits(miss, most, starts_anywhere, when) {
            return Admission::Outlier;
        }
        if outside {
            learner.follow_level(row, truth, at);
            return Admission::OutsideRange;
        }
        if self.memory.is_some() {
            let of_fit = match learner.as_fitted() {
                Some(fit) => fit.predict(row, at),
                None => fit.predict(row),
            };
            self.standing
                .observe([error, truth - of_fit], at, self.window);
        }
        if learner.says_little(row) {
            learner.pass_over(row, truth, at);
            return Admission::SaysLittle;
        }
        learner.learn(row, truth, at);
        Admission::Learned
    }

    /// Who speaks at an instant.
    pub(crate) fn speaks(&self, now: Instant) -> Speaks {
        let speaks = |memory| self.standing.speaks(now, memory);
        self.memory.map_or(Speaks::Learner, speaks)
    }

    /// Who predicts at an instant: a learner, or what stands in for it while its fit is to.
    #[must_use]
    pub fn speaker<'a>(&self, learner: &'a dyn Learner, now: Instant) -> &'a dyn Learner {
        let fit = learner.as_fitted();
        fit.filter(|_| self.speaks(now) != Speaks::Learner)
            .unwrap_or(learner)
    }

    /// Moves what is remembered to the clock of another segment.
    pub fn segment(&mut self, shift: Duration) {
        self.recent.shift(shift);
        self.standing.shift(shift);
    }
}
