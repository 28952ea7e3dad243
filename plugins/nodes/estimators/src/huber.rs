//! The estimator that outliers cannot pull.

use athermal_core::diagnostic::digits;
use athermal_core::node::{
    Estimator, InputPort, Mistake, Regressor, Regressors, Trained, Trainer, TrainingError,
    TrainingReport, TrainingSetup,
};
use athermal_numerics::{GramBlocks, Standardization};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::conditioning::tell_columns;
use crate::features::{FEATURES_AND_TRUTH, present_features, too_many};
use crate::novelty::novelty_of;
use crate::regression::{LinearPredictor, rows_gone};
use crate::unsolved::unsolved;

/// Linear regression of the truth on features in which large errors count by their size, not by their square.
///
/// Minimises `Σ(σ + H((y − ŷ)/σ) σ) + α Σ w_j²` over the coefficients `w`, the intercept and the scale `σ`, with features and truth
/// standardised and `H(z) = z²` up to `|z| = ε`, `2ε|z| − ε²` beyond (Huber 1981, section 7.7). It goes over its rows several
/// times, so they must fit in memory (`fit --memory`).
///
/// The port `novelty` shows how far the features are outside of those of the fit, as that of `linear` does.
///
/// A fit reports how many rows are outliers: those with errors beyond three standard deviations, 0.3 % of
/// normal errors. A standard deviation is 1.4826 times the median of the sizes of the errors (Hampel 1974).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Huber {
    /// From how many scales on an error counts by its size, 1 or more. The scale is below the standard deviation, of normal errors 0.68
    /// of it at 1.35: 36 % of them count by their size, which costs 11 % of the precision. At 1.6 it is 18 % and 5 %.
    /// Towards 1 the scale falls to that of the smallest errors, so that all others count by their size. These are the least absolute
    /// deviations, and the scale says nothing of the errors any more.
    #[serde(default = "usual")]
    #[schemars(range(min = 1.0))]
    pub epsilon: f64,
    /// The penalty, at least 0.
    #[serde(default = "small")]
    #[schemars(range(min = 0.0))]
    pub alpha: f64,
}

fn usual() -> f64 {
    1.35
}

fn small() -> f64 {
    1e-4
}

impl Estimator for Huber {
    fn inputs() -> &'static [InputPort] {
        FEATURES_AND_TRUTH
    }

    fn regressors(&self) -> Regressors {
        present_features()
    }

    fn has_novelty(&self) -> bool {
        true
    }

    fn mistakes_for(&self, features: usize) -> Vec<Mistake> {
        too_many(features, 1)
    }

    fn trainer(&self, setup: &TrainingSetup) -> Box<dyn Trainer> {
        Box::new(RobustTrainer {
            regressors: setup.regressors.clone(),
            unit: setup.error_unit.clone(),
            how: athermal_numerics::Huber {
                epsilon: self.epsilon,
                alpha: self.alpha,
            },
            blocks: GramBlocks::with_row_memory(setup.regressors.len(), setup.memory),
        })
    }
}

athermal_core::register!(Huber, Estimator, "huber");

struct RobustTrainer {
    regressors: Vec<Regressor>,
    unit: String,
    how: athermal_numerics::Huber,
    blocks: GramBlocks,
}

impl Trainer for RobustTrainer {
    fn row(&mut self, regressors: &[f64], truth: f64) {
        self.blocks.push(regressors, truth);
    }

    fn finish(self: Box<Self>) -> Result<Trained, TrainingError> {
        let rows = self.blocks.rows().ok_or_else(|| rows_gone(&self.blocks))?;
        let gram = self.blocks.total();
        let standard = Standardization::of(&gram);
        let deviation = gram.variances()[gram.width()].sqrt();
        // The penalty is against coefficients of a standardised truth.
        let how = athermal_numerics::Huber {
            alpha: if deviation > 0.0 {
                self.how.alpha / deviation
            } else {
                self.how.alpha
            },
            ..self.how
        };
        let all: Vec<usize> = (0..self.regressors.len()).collect();
        let solved = how.solve(rows, &all, &standard.means, &standard.scales);
        let fit = solved.map_err(unsolved)?;
        let count = rows.count();
        let mut report = TrainingReport {
            in_sample_rmse: Some((fit.residual_sum_of_squares / count as f64).sqrt()),
            robust_error: Some(fit.deviation / fit.target_deviation),
            ..TrainingReport::default()
        };
        tell_columns(&gram, |column| &self.regressors[column].name, &mut report);
        report.figure("outliers", fit.outliers);
        report.figure("deviation", fit.deviation);
        report.figure("scale", fit.scale);
        report.figure("beyond_epsilon", fit.beyond);
        report.figure("converged", fit.converged);
        report.notes.push(format!(
            "{} of {count} rows are outliers; the standard deviation of the others is about {} {}",
            fit.outliers,
            digits(fit.deviation, 4),
            self.unit
        ));
        if !fit.converged {
            report
                .notes
                .push("the minimum was not reached to the last digit".to_owned());
        }
        let names = self.regressors.into_iter().map(|regressor| regressor.name);
        let predictor = LinearPredictor {
            regressors: names.collect(),
            coefficients: fit.coefficients,
            intercept: fit.intercept,
            variance: None,
            novelty: novelty_of(&self.blocks, &standard, &all),
        };
        Ok(Trained {
            predictor: Box::new(predictor),
            report,
        })
    }
}
