//! What the linear estimators share: how coefficients are found and regressors chosen; which regressors there are is theirs.

use athermal_core::model::{number, numbers};
use athermal_core::node::{
    Mistake, Predictor, SelectionStep, Trained, Trainer, TrainingError, TrainingReport,
    TrainingSetup,
};
use athermal_core::time::Duration;
use athermal_numerics::{
    ForwardSelection, GramBlocks, LearningRate, LeastSquares, LinearFit, Method, NumericsError,
    SelectionScore, Sgd, SgdOptions, Standardization,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How coefficients are found, on standardised regressors.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
pub enum Solver {
    /// Minimises the sum of squares plus `alpha · ‖w‖²`, the intercept free (Hoerl and Kennard 1970).
    Ridge {
        /// The penalty, at least 0.
        #[serde(default = "one")]
        #[schemars(range(min = 0.0))]
        alpha: f64,
    },
    /// Minimises the sum of squares. Above a condition number of 10⁶ it turns to singular values and says so.
    Ols {},
    /// Stochastic gradients with L2 penalty over the rows in their order (Bottou 2010): the step size of row `t` is
    /// `eta0 / t^power`.
    Sgd {
        /// The penalty per row, at least 0.
        #[serde(default = "small_penalty")]
        #[schemars(range(min = 0.0))]
        alpha: f64,
        /// The first step size, above 0.
        #[serde(default = "first_step")]
        #[schemars(extend("exclusiveMinimum" = 0.0))]
        eta0: f64,
        /// How fast the step size falls, 0 (not at all) to 1.
        #[serde(default = "quarter")]
        #[schemars(range(min = 0.0, max = 1.0))]
        power: f64,
        /// How often the rows are gone through, at least once.
        #[serde(default = "five")]
        #[schemars(range(min = 1))]
        epochs: usize,
    },
}

fn one() -> f64 {
    1.0
}

fn small_penalty() -> f64 {
    1e-4
}

fn first_step() -> f64 {
    0.01
}

fn quarter() -> f64 {
    0.25
}

fn five() -> usize {
    5
}

impl Default for Solver {
    fn default() -> Self {
        Self::Ridge { alpha: 1.0 }
    }
}

/// How regressors are chosen.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "method", rename_all = "snake_case", deny_unknown_fields)]
pub enum Selection {
    /// Sequential forward selection: the regressor that raises the mean R² over the folds most is added, the first of
    /// several equal ones, until the gain is below the tolerance.
    Forward {
        /// Into how many contiguous folds the rows are cut, 2 or more.
        #[serde(default = "three")]
        #[schemars(range(min = 2))]
        folds: usize,
        /// The smallest gain that is worth another regressor.
        #[serde(default = "thousandth")]
        tolerance: f64,
        /// The most regressors to choose; without it there is no limit.
        #[serde(default)]
        #[schemars(range(min = 1))]
        most: Option<usize>,
    },
}

fn three() -> usize {
    3
}

fn thousandth() -> f64 {
    1e-3
}

impl Solver {
    /// Parameters out of their range.
    pub(crate) fn mistakes(&self) -> Vec<Mistake> {
        let mut mistakes = Vec::new();
        let mut check = |name: &str, value: f64, fits: bool, allowed: &str| {
            if !fits {
                mistakes.push(Mistake::at(
                    format!("solver.{name}"),
                    format!("`{name}` is {value} and must be {allowed}"),
                ));
            }
        };
        match *self {
            Self::Ridge { alpha } => check(
                "alpha",
                alpha,
                alpha >= 0.0 && alpha.is_finite(),
                "0 or more",
            ),
            Self::Ols {} => {}
            Self::Sgd {
                alpha,
                eta0,
                power,
                epochs,
            } => {
                check(
                    "alpha",
                    alpha,
                    alpha >= 0.0 && alpha.is_finite(),
                    "0 or more",
                );
                check("eta0", eta0, eta0 > 0.0 && eta0.is_finite(), "above 0");
                check("power", power, (0.0..=1.0).contains(&power), "from 0 to 1");
                check("epochs", epochs as f64, epochs >= 1, "1 or more");
            }
        }
        mistakes
    }

    /// The penalty that selection works with.
    fn penalty(&self) -> f64 {
        match *self {
            Self::Ridge { alpha } => alpha,
            Self::Ols {} | Self::Sgd { .. } => 0.0,
        }
    }
}

impl Selection {
    /// Parameters out of their range.
    pub(crate) fn mistakes(&self) -> Vec<Mistake> {
        let Self::Forward {
            folds,
            tolerance,
            most,
        } = *self;
        let mut mistakes = Vec::new();
        if folds < 2 {
            mistakes.push(Mistake::at(
                "selection.folds",
                format!("`folds` is {folds} and must be 2 or more"),
            ));
        }
        if !tolerance.is_finite() {
            mistakes.push(Mistake::at(
                "selection.tolerance",
                format!("`tolerance` is {tolerance} and must be a number"),
            ));
        }
        if most == Some(0) {
            mistakes.push(Mistake::at(
                "selection.most",
                "`most` is 0 and must be 1 or more",
            ));
        }
        mistakes
    }
}

/// Lags that repeat or are negative.
pub(crate) fn lag_mistakes(name: &str, lags: &[Duration]) -> Vec<Mistake> {
    let mut mistakes = Vec::new();
    if lags.is_empty() {
        mistakes.push(
            Mistake::at(name, format!("`{name}` is empty"))
                .help("give one lag or more, such as [\"5min\"]"),
        );
    }
    for (i, lag) in lags.iter().enumerate() {
        if lags[..i].contains(lag) {
            mistakes.push(Mistake::at(
                format!("{name}.{i}"),
                format!("the lag {lag} stands twice in `{name}`"),
            ));
        }
    }
    mistakes
}

/// Takes the rows of a linear fit as Gram blocks.
#[derive(Debug)]
pub(crate) struct LinearTrainer {
    names: Vec<String>,
    solver: Solver,
    selection: Option<Selection>,
    blocks: GramBlocks,
}

impl LinearTrainer {
    pub(crate) fn new(setup: &TrainingSetup, solver: Solver, selection: Option<Selection>) -> Self {
        let names: Vec<_> = setup
            .regressors
            .iter()
            .map(|regressor| regressor.name.clone())
            .collect();
        let blocks = GramBlocks::with_row_memory(names.len(), setup.memory);
        Self {
            names,
            solver,
            selection,
            blocks,
        }
    }

    fn chosen(
        &self,
        scales: &[f64],
        report: &mut TrainingReport,
    ) -> Result<Vec<usize>, NumericsError> {
        let Some(Selection::Forward {
            folds,
            tolerance,
            most,
        }) = self.selection
        else {
            return Ok((0..self.names.len()).collect());
        };
        let selection = ForwardSelection {
            alpha: self.solver.penalty(),
            tolerance: Some(tolerance),
            max_features: most,
            score: SelectionScore::R2,
        };
        let selected = selection.run(&self.blocks, folds, scales)?;
        if !self.blocks.exact_folds() {
            let rows = self.blocks.block_rows();
            report.notes.push(format!(
                "the rows did not fit in memory, so folds end at multiples of {rows} rows"
            ));
        }
        report.selection = selected
            .steps
            .iter()
            .map(|step| SelectionStep {
                regressor: self.names[step.column].clone(),
                score: step.mean,
                folds: step.folds.clone(),
            })
            .collect();
        Ok(selected.order())
    }

    fn solve(&self, report: &mut TrainingReport) -> Result<LinearPredictor, NumericsError> {
        let gram = self.blocks.total();
        let standard = Standardization::of(&gram);
        let columns = self.chosen(&standard.scales, report)?;
        let squares = LeastSquares::ridge(self.solver.penalty());
        let fit = squares.solve(&gram, &columns, &standard.scales, self.blocks.rows())?;
        report.condition = Some(fit.condition);
        self.note(&fit, report);
        let names = columns
            .iter()
            .map(|&column| self.names[column].clone())
            .collect();
        let predictor = match self.solver {
            Solver::Ridge { .. } | Solver::Ols {} => LinearPredictor {
                regressors: names,
                coefficients: fit.coefficients.clone(),
                intercept: fit.intercept,
            },
            Solver::Sgd {
                alpha,
                eta0,
                power,
                epochs,
            } => {
                let rate = if power == 0.0 {
                    LearningRate::Constant { eta0 }
                } else {
                    LearningRate::InvScaling { eta0, power }
                };
                self.descend(
                    SgdOptions { alpha, rate },
                    epochs,
                    &columns,
                    names,
                    &standard,
                )?
            }
        };
        report.in_sample_rmse = Some(match self.blocks.rows() {
            Some(rows) if matches!(self.solver, Solver::Sgd { .. }) => {
                let squared = rows.iter().map(|(x, y, _)| {
                    let row: Vec<f64> = columns.iter().map(|&column| x[column]).collect();
                    (predictor.predict(&row) - y).powi(2)
                });
                (squared.sum::<f64>() / rows.count() as f64).sqrt()
            }
            _ => (fit.residual_sum_of_squares / gram.count() as f64).sqrt(),
        });
        Ok(predictor)
    }

    /// Stochastic gradients on standardised regressors and centred truths, told on the scale of the data.
    fn descend(
        &self,
        options: SgdOptions,
        epochs: usize,
        columns: &[usize],
        names: Vec<String>,
        standard: &Standardization,
    ) -> Result<LinearPredictor, NumericsError> {
        let Some(rows) = self.blocks.rows() else {
            return Err(NumericsError::TooFewRows {
                needed: self.blocks.count(),
                found: 0,
            });
        };
        let mean = rows.iter().map(|(_, y, _)| y).sum::<f64>() / rows.count() as f64;
        let scaled: Vec<(Vec<f64>, f64)> = rows
            .iter()
            .map(|(x, y, _)| {
                let scale = |&column: &usize| {
                    (x[column] - standard.means[column]) / standard.scales[column]
                };
                (columns.iter().map(scale).collect(), y - mean)
            })
            .collect();
        let mut sgd = Sgd::new(columns.len(), options)?;
        sgd.epochs(scaled.iter().map(|(x, y)| (x.as_slice(), *y)), epochs);
        let coefficients: Vec<f64> = sgd
            .weights()
            .iter()
            .zip(columns)
            .map(|(w, &column)| w / standard.scales[column])
            .collect();
        let shift: f64 = coefficients
            .iter()
            .zip(columns)
            .map(|(b, &column)| b * standard.means[column])
            .sum();
        Ok(LinearPredictor {
            regressors: names,
            coefficients,
            intercept: sgd.intercept() + mean - shift,
        })
    }

    fn note(&self, fit: &LinearFit, report: &mut TrainingReport) {
        let names = |columns: &[usize]| {
            columns
                .iter()
                .map(|&c| self.names[c].as_str())
                .collect::<Vec<_>>()
                .join(", ")
        };
        if !fit.constant.is_empty() {
            report.notes.push(format!(
                "constant, so without effect: {}",
                names(&fit.constant)
            ));
        }
        if !fit.collinear.is_empty() {
            report.notes.push(format!(
                "nearly a combination of the others: {}",
                names(&fit.collinear)
            ));
        }
        match fit.method {
            Method::Cholesky => {}
            Method::Svd { rank } => report.notes.push(format!(
                "ill-conditioned, so solved by singular values: the rows determine {rank} of {} coefficients",
                fit.columns.len()
            )),
            Method::TinyRidge { alpha } => report.notes.push(format!(
                "ill-conditioned, and the rows did not fit in memory, so solved with a ridge of {alpha:e}"
            )),
        }
    }
}

impl Trainer for LinearTrainer {
    fn row(&mut self, regressors: &[f64], truth: f64) {
        self.blocks.push(regressors, truth);
    }

    fn finish(self: Box<Self>) -> Result<Trained, TrainingError> {
        let mut report = TrainingReport::default();
        match self.solve(&mut report) {
            Ok(predictor) => Ok(Trained {
                predictor: Box::new(predictor),
                report,
            }),
            Err(NumericsError::TooFewRows { needed, found }) => Err(TrainingError::TooFewRows {
                rows: usize::try_from(found).unwrap_or(usize::MAX),
                needed: usize::try_from(needed).unwrap_or(usize::MAX),
            }),
            Err(error) => Err(TrainingError::Unsolvable {
                reason: error.to_string(),
            }),
        }
    }
}

/// A fitted linear model, on the scale of its regressors.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LinearPredictor {
    /// The regressors used.
    regressors: Vec<String>,
    /// Their coefficients, in units of the truth per unit of the regressor.
    #[serde(with = "numbers")]
    coefficients: Vec<f64>,
    /// The intercept, in the unit of the truth.
    #[serde(with = "number")]
    intercept: f64,
}

#[typetag::serde(name = "linear")]
impl Predictor for LinearPredictor {
    fn uses(&self) -> &[String] {
        &self.regressors
    }

    fn predict(&self, regressors: &[f64]) -> f64 {
        let terms = self.coefficients.iter().zip(regressors);
        terms.fold(self.intercept, |sum, (b, x)| sum + b * x)
    }
}
