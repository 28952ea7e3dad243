//! Stepwise regression by F-tests. Decides which regressors enter and leave; cross-validated searches are elsewhere.

use super::{CandidateScore, Change};
use crate::checks::{check_parameter, check_scale};
use crate::{Gram, NumericsError};
use faer::Mat;
use serde::{Deserialize, Serialize};

/// A column whose variance, given the chosen ones, is below this share of its own does not enter.
const COLLINEAR_SHARE: f64 = 1e-10;

/// Adds the regressor whose coefficient is most significant, and after each addition takes out those that have lost their
/// significance (Efroymson 1960, "Multiple regression analysis"). It works on the rows of the fit, without folds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stepwise {
    /// The least F with which a regressor enters.
    pub enter: f64,
    /// A regressor whose F is below leaves; not above `enter`, or one would come and go for ever.
    pub remove: f64,
    /// Take at most so many; without it, any number.
    pub most: Option<usize>,
}

/// One step of a stepwise regression.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StepwiseStep {
    /// The column.
    pub column: usize,
    /// Whether it entered or left.
    pub change: Change,
    /// Its F, with 1 degree of freedom against those of the residuals of the larger of the two models.
    pub f: f64,
    /// `R²` over the rows of the fit, after the step.
    pub r2: f64,
    /// The F of all columns that were tried, as `mean`; NaN for a combination of the chosen ones.
    pub candidates: Vec<CandidateScore>,
}

/// What a stepwise regression did.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StepwiseSelection {
    /// The steps, in order.
    pub steps: Vec<StepwiseStep>,
    /// The step that was not taken since its F was too small.
    pub refused: Option<StepwiseStep>,
    /// The columns chosen by all steps, in the order in which they came.
    pub columns: Vec<usize>,
}

impl Stepwise {
    /// Selects among all columns. Each model has an intercept and no penalty.
    ///
    /// # Errors
    /// [`NumericsError::Parameter`] for thresholds that are negative or in the wrong order, [`NumericsError::Scale`],
    /// [`NumericsError::NotFinite`], [`NumericsError::TooFewRows`] for fewer than three rows.
    pub fn run(&self, gram: &Gram, scales: &[f64]) -> Result<StepwiseSelection, NumericsError> {
        let fine = self.enter > 0.0 && self.enter.is_finite();
        check_parameter("enter", self.enter, fine, "above 0")?;
        let fine = (0.0..=self.enter).contains(&self.remove);
        check_parameter("remove", self.remove, fine, "from 0 to `enter`")?;
        if scales.len() != gram.width() {
            return Err(NumericsError::Width {
                expected: gram.width(),
                found: scales.len(),
            });
        }
        for (column, &scale) in scales.iter().enumerate() {
            check_scale(column, scale)?;
        }
        if !gram.is_finite() {
            return Err(NumericsError::NotFinite);
        }
        if gram.count() < 3 {
            return Err(NumericsError::TooFewRows {
                needed: 3,
                found: gram.count(),
            });
        }
        Ok(Swept::new(gram, scales).run(self))
    }
}

/// The share of the target's spread that is rounding: what is left of data without noise says nothing of further columns.
const ROUNDING: f64 = 1e-12;

/// Moments swept by the chosen columns (Goodnight 1979).
struct Swept {
    moments: Mat<f64>,
    own: Vec<f64>,
    columns: Vec<usize>,
    rows: f64,
    spread: f64,
    steps: Vec<StepwiseStep>,
}

impl Swept {
    fn new(gram: &Gram, scales: &[f64]) -> Self {
        let moments = gram.moments();
        let varies = gram.variances();
        let inverse: Vec<f64> = scales.iter().map(|s| 1.0 / s).chain([1.0]).collect();
        let scaled = Mat::from_fn(moments.nrows(), moments.ncols(), |i, j| {
            moments[(i, j)] * inverse[i] * inverse[j]
        });
        let own = (0..gram.width()).map(|j| if varies[j] > 0.0 { scaled[(j, j)] } else { 0.0 });
        let target = gram.width();
        Self {
            own: own.collect(),
            spread: scaled[(target, target)],
            moments: scaled,
            columns: Vec::new(),
            rows: gram.count() as f64,
            steps: Vec::new(),
        }
    }

    fn run(mut self, how: &Stepwise) -> StepwiseSelection {
        let most = how.most.unwrap_or(usize::MAX);
        let mut refused = None;
        while self.columns.len() < most && self.unexplained() > ROUNDING * self.spread {
            let candidates = self.entering();
            let best = candidates.iter().copied().filter(|c| !c.mean.is_nan());
            let Some(best) = best.reduce(|a, b| if b.mean > a.mean { b } else { a }) else {
                break;
            };
            if best.mean < how.enter {
                let left = self.unexplained() - self.explained(best.candidate);
                refused = Some(self.step(best, Change::Added, left, candidates));
                break;
            }
            self.sweep(best.candidate);
            self.columns.push(best.candidate);
            self.note(best, Change::Added, candidates);
            loop {
                let candidates = self.leaving(best.candidate);
                let worst = candidates.iter().copied().filter(|c| c.mean < how.remove);
                let Some(worst) = worst.reduce(|a, b| if b.mean < a.mean { b } else { a }) else {
                    break;
                };
                self.sweep(worst.candidate);
                self.columns.retain(|&column| column != worst.candidate);
                self.note(worst, Change::Removed, candidates);
            }
        }
        StepwiseSelection {
            steps: self.steps,
            refused,
            columns: self.columns,
        }
    }

    fn target(&self) -> usize {
        self.own.len()
    }

    fn unexplained(&self) -> f64 {
        self.moments[(self.target(), self.target())]
    }

    /// What a column that is not chosen would explain.
    fn explained(&self, column: usize) -> f64 {
        self.moments[(column, self.target())].powi(2) / self.moments[(column, column)]
    }

    fn entering(&self) -> Vec<CandidateScore> {
        let target = self.target();
        let degrees = self.rows - self.columns.len() as f64 - 2.0;
        let f = |column: usize| {
            let pivot = self.moments[(column, column)];
            if degrees < 1.0 || pivot <= COLLINEAR_SHARE * self.own[column] {
                return f64::NAN;
            }
            let explained = self.explained(column);
            explained / ((self.unexplained() - explained).max(0.0) / degrees)
        };
        (0..target)
            .filter(|column| !self.columns.contains(column))
            .map(|candidate| CandidateScore {
                candidate,
                mean: f(candidate),
            })
            .collect()
    }

    fn leaving(&self, new: usize) -> Vec<CandidateScore> {
        let target = self.target();
        let degrees = self.rows - self.columns.len() as f64 - 1.0;
        let variance = self.unexplained().max(0.0) / degrees;
        let old = self.columns.iter().filter(|&&column| column != new);
        old.map(|&candidate| {
            let explained =
                self.moments[(candidate, target)].powi(2) / -self.moments[(candidate, candidate)];
            CandidateScore {
                candidate,
                mean: explained / variance,
            }
        })
        .collect()
    }

    fn note(&mut self, tried: CandidateScore, change: Change, candidates: Vec<CandidateScore>) {
        let step = self.step(tried, change, self.unexplained(), candidates);
        self.steps.push(step);
    }

    /// A step that leaves so much unexplained.
    fn step(
        &self,
        tried: CandidateScore,
        change: Change,
        left: f64,
        candidates: Vec<CandidateScore>,
    ) -> StepwiseStep {
        StepwiseStep {
            column: tried.candidate,
            change,
            f: tried.mean,
            r2: 1.0 - left.max(0.0) / self.spread,
            candidates,
        }
    }

    fn sweep(&mut self, column: usize) {
        let order = self.moments.nrows();
        let pivot = self.moments[(column, column)];
        let line: Vec<f64> = (0..order).map(|i| self.moments[(i, column)]).collect();
        for j in 0..order {
            let factor = line[j] / pivot;
            for (i, value) in line.iter().enumerate() {
                self.moments[(i, j)] -= value * factor;
            }
        }
        for (i, value) in line.iter().enumerate() {
            self.moments[(i, column)] = value / pivot.abs();
            self.moments[(column, i)] = value / pivot.abs();
        }
        self.moments[(column, column)] = -1.0 / pivot;
    }
}
