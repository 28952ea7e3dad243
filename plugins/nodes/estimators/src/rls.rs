//! The estimator that is fitted once and then learns from every truth: recursive least squares.

use athermal_core::node::{
    Estimator, InputPort, Learns, Mistake, Predictor, Regressors, Trained, Trainer, TrainingError,
    TrainingReport, TrainingSetup, TruthLags,
};
use athermal_core::time::Duration;
use athermal_numerics::{RlsOptions, covariance_of};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::features::too_many;
use crate::lags::repeated;
use crate::online::{Frame, OnlinePredictor, Recursion};
use crate::penalty::Penalty;
use crate::regression::LinearTrainer;
use crate::selection::Selection;
use crate::solver::Solver;
use crate::unsolved::unsolved;

/// Recursive least squares: linear regression that goes on learning while it runs, and forgets.
///
/// Predicts `b₀ + Σ b_j x_j` from features and, with `lags`, the past of the truth. The fit is that of `linear` or `arx` with
/// ridge; from then on each truth that the embargo lets through moves the coefficients (Ljung 1999, eq. 11.12), on regressors
/// standardised as in the fit: `e = y − xᵀθ`, `K = Px / (λ + xᵀPx)`, `θ ← θ + Ke`, `P ← (P − KxᵀP) / λ`. It learns unless the
/// graph says `learn = false`; `learn = { outliers = 6.0, margin = 0.0 }` says from what it does not.
///
/// The rows of the fit count as one memory's worth of rows, so that the first truths move the coefficients no more than later
/// ones do. Where nothing excites a regressor for long, its past is not forgotten beyond ten times the uncertainty of the
/// start, so that the next disturbance finds a model that is still sound. A regressor that is the same in all rows of the fit is
/// left out of it and of what is learned later: it comes in with the next fit. A truth that misses by
/// more than a hundred deviations, and is no outlier any more, moves the constant alone, as unsure as that until the next truth.
///
/// The port `learning` tells what became of the newest truth: 0 learned from, 1 frozen on command, 2 frozen by a channel, 3
/// an outlier, 4 a regressor outside the range of the fit, 5 outside `train.abs_truth`, 6 no complete row. The port
/// `std_dev` is the standard deviation of the truth about the prediction, `s √(1 + xᵀPx)`. The port `novelty` is that of `linear`, and
/// less where it has learned since: of what lies beyond the edge of the fit counts `√(xᵀPx / xᵀP₀x)`, `P₀` the `P` of the fit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Rls {
    /// The lags of the truth, such as `["5min", "10min"]`; without them only features are regressors.
    #[serde(default)]
    pub lags: Vec<Duration>,
    /// How fast the past is forgotten.
    #[serde(default)]
    pub forgetting: Forgetting,
    /// The ridge penalty of the fit, at least 0.
    #[serde(default = "one")]
    #[schemars(range(min = 0.0))]
    pub alpha: f64,
    /// How regressors are chosen in the fit; without it, all are used.
    #[serde(default)]
    pub selection: Option<Selection>,
}

/// How fast the past is forgotten.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
pub enum Forgetting {
    /// Each truth counts `factor` times as much as the one after it.
    Constant {
        /// Above 0, at most 1, which forgets nothing; the memory is `1 / (1 − factor)` truths.
        #[serde(default = "slow")]
        #[schemars(range(max = 1.0), extend("exclusiveMinimum" = 0.0))]
        factor: f64,
    },
    /// The more a truth surprises, the more is forgotten (Fortescue, Kershenbaum and Ydstie 1981):
    /// `λ = 1 − e² (1 − xᵀK) / (memory · s²)`, `s` the residual standard deviation of the fit.
    Variable {
        /// Over how many truths of ordinary noise the past counts, above 1.
        #[serde(default = "thousand")]
        #[schemars(extend("exclusiveMinimum" = 1.0))]
        memory: f64,
        /// The smallest factor, above 0, at most 1.
        #[serde(default = "nine_tenths")]
        #[schemars(range(max = 1.0), extend("exclusiveMinimum" = 0.0))]
        lowest: f64,
    },
}

fn one() -> f64 {
    1.0
}

fn slow() -> f64 {
    0.999
}

fn thousand() -> f64 {
    1000.0
}

fn nine_tenths() -> f64 {
    0.9
}

impl Default for Forgetting {
    fn default() -> Self {
        Self::Constant { factor: slow() }
    }
}

impl Forgetting {
    /// Over how many rows the past counts; infinite where nothing is forgotten.
    fn memory(self) -> f64 {
        match self {
            Self::Constant { factor } => (1.0 - factor).recip(),
            Self::Variable { memory, .. } => memory,
        }
    }
}

impl Estimator for Rls {
    fn inputs() -> &'static [InputPort] {
        const {
            &[
                InputPort::held("features", "what the prediction is made of").or_none(),
                InputPort::truth("what is predicted and learned from"),
                InputPort::freeze(),
            ]
        }
    }

    fn regressors(&self) -> Regressors {
        let lagged = !self.lags.is_empty();
        Regressors {
            feature_lags: vec![Duration::ZERO],
            truth_lags: if lagged {
                TruthLags::At(self.lags.clone())
            } else {
                TruthLags::None
            },
            every_tick: lagged,
            ..Regressors::default()
        }
    }

    fn mistakes(&self) -> Vec<Mistake> {
        repeated("lags", &self.lags)
    }

    fn learns(&self) -> Learns {
        Learns::ByDefault
    }

    fn has_std_dev(&self) -> bool {
        true
    }

    fn has_novelty(&self) -> bool {
        true
    }

    fn mistakes_for(&self, features: usize) -> Vec<Mistake> {
        too_many(features, 1)
    }

    fn trainer(&self, setup: &TrainingSetup) -> Box<dyn Trainer> {
        let solver = Solver::ridge(Penalty::Fixed(self.alpha));
        // The range is kept whether it learns or not, so that the same fit serves both.
        let setup = TrainingSetup {
            learns: true,
            ..setup.clone()
        };
        Box::new(RlsTrainer {
            parameters: self.clone(),
            rows: LinearTrainer::new(&setup, solver, self.selection),
        })
    }
}

athermal_core::register!(Rls, Estimator, "rls");

/// Fits as `linear` does, and finds where the recursion starts.
struct RlsTrainer {
    parameters: Rls,
    rows: LinearTrainer,
}

impl RlsTrainer {
    fn start(&self, report: &mut TrainingReport) -> Result<OnlinePredictor, TrainingError> {
        let Rls {
            forgetting, alpha, ..
        } = self.parameters;
        let found = self.rows.find(report)?;
        let (count, used) = (
            found.gram.count() as f64,
            found.fit.columns.len() as f64 + 1.0,
        );
        let squares = found.fit.residual_sum_of_squares;
        // Even a fit without error has truths that are rounded.
        let noise = (squares / (count - used).max(1.0))
            .sqrt()
            .max(f64::MIN_POSITIVE.sqrt());
        let rows = forgetting.memory().min(count);
        let (columns, scales) = (&found.fit.columns, &found.standard.scales);
        let covariance =
            covariance_of(&found.gram, columns, scales, alpha, rows).map_err(unsolved)?;
        let trace: f64 = covariance.iter().step_by(columns.len() + 2).sum();
        let options = RlsOptions {
            forgetting: match forgetting {
                Forgetting::Constant { factor } => {
                    athermal_numerics::Forgetting::Constant { factor }
                }
                Forgetting::Variable { memory, lowest } => {
                    athermal_numerics::Forgetting::Variable {
                        memory,
                        noise,
                        lowest,
                    }
                }
            },
            most_trace: 10.0 * trace,
        };
        let frame = Frame::new(found.names.clone(), columns, &found.standard, 0.0);
        let coefficients = frame.scaled(&found.fit.coefficients, found.fit.intercept);
        let rls = athermal_numerics::Rls::starting_at(coefficients, covariance, options)
            .map_err(unsolved)?;
        let range = self.rows.range_of(columns).unwrap_or_default();
        let novelty = self.rows.novelty_of(&found);
        Ok(OnlinePredictor::new(
            frame,
            Recursion::Rls { rls, noise },
            range,
            None,
            novelty,
        ))
    }
}

impl Trainer for RlsTrainer {
    fn row(&mut self, regressors: &[f64], truth: f64) {
        self.rows.row(regressors, truth);
    }

    fn finish(self: Box<Self>) -> Result<Trained, TrainingError> {
        let mut report = TrainingReport::default();
        let predictor = self.start(&mut report)?;
        let predictor: Box<dyn Predictor> = Box::new(predictor);
        Ok(Trained { predictor, report })
    }
}
