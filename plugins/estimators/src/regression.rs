//! What the linear estimators share: how rows become a fitted model and a report; which regressors there are is theirs.

use athermal_core::model::{number, numbers};
use athermal_core::node::{
    Predictor, Regressor, Trained, Trainer, TrainingError, TrainingReport, TrainingSetup,
};
use athermal_numerics::{
    GramBlocks, LearningRate, LeastSquares, LinearFit, Method, NumericsError, Sgd, SgdOptions,
    Standardization,
};
use serde::{Deserialize, Serialize};

use crate::selection::Selection;
use crate::solver::Solver;

/// Takes the rows of a linear fit as Gram blocks.
#[derive(Debug)]
pub(crate) struct LinearTrainer {
    regressors: Vec<Regressor>,
    solver: Solver,
    selection: Option<Selection>,
    blocks: GramBlocks,
}

impl LinearTrainer {
    pub(crate) fn new(setup: &TrainingSetup, solver: Solver, selection: Option<Selection>) -> Self {
        let blocks = GramBlocks::with_row_memory(setup.regressors.len(), setup.memory);
        Self {
            regressors: setup.regressors.clone(),
            solver,
            selection,
            blocks,
        }
    }

    /// The columns that are used, and the penalty with which they are.
    fn chosen(
        &self,
        scales: &[f64],
        report: &mut TrainingReport,
    ) -> Result<(Vec<usize>, f64), NumericsError> {
        let all: Vec<usize> = (0..self.regressors.len()).collect();
        let penalty = self.solver.penalty();
        let mut settled = penalty.settle(&self.blocks, &all, scales)?;
        let mut columns = all;
        if let Some(selection) = &self.selection {
            let alpha = settled.alpha;
            columns = selection.run(&self.regressors, &self.blocks, scales, alpha, report)?;
            // What was best for all candidates need not be so for those chosen.
            settled = penalty.settle(&self.blocks, &columns, scales)?;
        }
        report.notes.extend(settled.note);
        Ok((columns, settled.alpha))
    }

    /// The fitted model; what there is to tell goes into the report.
    pub(crate) fn solve(
        &self,
        report: &mut TrainingReport,
    ) -> Result<LinearPredictor, TrainingError> {
        let gram = self.blocks.total();
        let standard = Standardization::of(&gram);
        let (columns, alpha) = self.chosen(&standard.scales, report).map_err(told)?;
        let squares = LeastSquares::ridge(alpha);
        let solved = squares.solve(&gram, &columns, &standard.scales, self.blocks.rows());
        let fit = solved.map_err(told)?;
        report.condition = Some(fit.condition);
        self.note(&fit, report);
        let names = columns
            .iter()
            .map(|&column| self.regressors[column].name.clone())
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
    ) -> Result<LinearPredictor, TrainingError> {
        let rows = self.blocks.rows().ok_or_else(|| rows_gone(&self.blocks))?;
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
        let mut sgd = Sgd::new(columns.len(), options).map_err(told)?;
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
                .map(|&c| self.regressors[c].name.as_str())
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
            // Every coefficient is determined, so there is nothing to worry about.
            Method::Svd { rank } if rank + fit.constant.len() == fit.columns.len() => {}
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
        let predictor = self.solve(&mut report)?;
        Ok(Trained {
            predictor: Box::new(predictor),
            report,
        })
    }
}

/// Why the numbers allow no fit, as the framework tells it.
pub(crate) fn told(error: NumericsError) -> TrainingError {
    match error {
        NumericsError::TooFewRows { needed, found } => TrainingError::TooFewRows {
            rows: usize::try_from(found).unwrap_or(usize::MAX),
            needed: usize::try_from(needed).unwrap_or(usize::MAX),
        },
        error => TrainingError::Unsolvable {
            reason: error.to_string(),
        },
    }
}

/// Why a fit that goes over its rows several times cannot be made once they are gone.
pub(crate) fn rows_gone(blocks: &GramBlocks) -> TrainingError {
    let bytes = blocks.count() as f64 * (blocks.width() + 1) as f64 * size_of::<f64>() as f64;
    TrainingError::Unsolvable {
        reason: format!(
            "it goes over its rows several times, and they did not fit in memory; `--memory {:.0}` would hold them",
            (bytes / f64::from(1 << 20)).ceil() + 1.0
        ),
    }
}

/// A fitted linear model, on the scale of its regressors.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LinearPredictor {
    /// The regressors used.
    pub(crate) regressors: Vec<String>,
    /// Their coefficients, in units of the truth per unit of the regressor.
    #[serde(with = "numbers")]
    pub(crate) coefficients: Vec<f64>,
    /// The intercept, in the unit of the truth.
    #[serde(with = "number")]
    pub(crate) intercept: f64,
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
