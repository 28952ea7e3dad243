//! What the linear estimators share: how rows become a fitted model and a report; which regressors there are is theirs.

use athermal_core::node::{
    Coefficients, LinearForm, Mistake, Predictor, Regressor, Summed, Trained, TrainedRange,
    Trainer, TrainingError, TrainingReport, TrainingSetup,
};
use athermal_core::node::{number, numbers};
use athermal_core::unit::Unit;
use athermal_numerics::{
    Gram, GramBlocks, LearningRate, LeastSquares, LinearFit, Method, Novelty, PredictionVariance,
    Sgd, SgdOptions, Standardization,
};
use serde::{Deserialize, Serialize};

use crate::conditioning::name_columns;
use crate::jackknife;
use crate::lag_order::LagOrder;
use crate::novelty::{novelty_at, novelty_mistakes, novelty_of};
use crate::online::{Frame, OnlinePredictor, Recursion};
use crate::prior::{Met, Wanted};
use crate::selection::Selection;
use crate::solver::Solver;
use crate::summed::{add_sums, sums_of};
use crate::unsolved::unsolved;

/// Takes the rows of a linear fit as Gram blocks.
#[derive(Debug)]
pub(crate) struct LinearTrainer {
    regressors: Vec<Regressor>,
    solver: Solver,
    /// The prior as these rows meet it, or why it does not.
    prior: Option<Result<Met, String>>,
    selection: Option<Selection>,
    order: Option<LagOrder>,
    blocks: GramBlocks,
    /// The range of the regressors, for an estimator that goes on learning.
    range: Option<TrainedRange>,
}

/// A fit of the chosen columns, and what it stands on.
pub(crate) struct Found {
    pub(crate) names: Vec<String>,
    alpha: f64,
    pub(crate) gram: Gram,
    pub(crate) standard: Standardization,
    pub(crate) squares: LeastSquares,
    pub(crate) fit: LinearFit,
    /// Where the fit is one towards a prior.
    of_prior: Option<OfPrior>,
}

/// What says of a fit towards a prior how far its predictions may be off, and its regressors from those of the fleet.
type OfPrior = (Option<PredictionVariance>, Option<Novelty>);

impl LinearTrainer {
    pub(crate) fn new(setup: &TrainingSetup, solver: Solver, selection: Option<Selection>) -> Self {
        let blocks = GramBlocks::with_row_memory(setup.regressors.len(), setup.memory);
        let prior = solver.prior().map(|(prior, _)| {
            let unit = Unit::parse(&setup.error_unit).map_err(|error| error.to_string())?;
            prior.meet(Wanted {
                instance: &setup.instance,
                regressors: &setup.regressors,
                unit: &unit,
                ahead: setup.ahead,
            })
        });
        let of_selection = selection.as_ref().map_or(1, Selection::parts);
        let parts = of_selection.max(solver.penalty().parts());
        Self {
            regressors: setup.regressors.clone(),
            solver,
            prior,
            selection,
            order: None,
            blocks: blocks.cut_into(parts),
            range: setup
                .learns
                .then(|| TrainedRange::new(setup.regressors.len())),
        }
    }

    /// The same with the number of lags left open.
    pub(crate) fn with_order(self, order: Option<LagOrder>) -> Self {
        Self { order, ..self }
    }

    /// The columns that are used, and the penalty with which they are.
    fn chosen(
        &self,
        scales: &[f64],
        report: &mut TrainingReport,
    ) -> Result<(Vec<usize>, f64), TrainingError> {
        let all: Vec<usize> = (0..self.regressors.len()).collect();
        let penalty = self.solver.penalty();
        let columns = match (&self.selection, &self.order) {
            (Some(by), _) => {
                let settled = penalty
                    .settle(&self.blocks, &all, scales)
                    .map_err(unsolved)?;
                by.run(
                    &self.regressors,
                    &self.blocks,
                    scales,
                    settled.alpha,
                    report,
                )
                .map_err(unsolved)?
            }
            (None, Some(by)) => {
                let columns = by.run(&self.regressors, &self.blocks, scales, report)?;
                report.notes.extend(self.solver.beside_least_squares());
                columns
            }
            (None, None) => all,
        };
        // What was best for all candidates need not be so for those chosen.
        let settled = penalty
            .settle(&self.blocks, &columns, scales)
            .map_err(unsolved)?;
        settled.tell(&self.blocks, report);
        Ok((columns, settled.alpha))
    }

    /// Chooses the columns and solves for their coefficients; what there is to tell goes into the report.
    pub(crate) fn find(&self, report: &mut TrainingReport) -> Result<Found, TrainingError> {
        let gram = self.blocks.total();
        let standard = Standardization::of(&gram);
        let (chosen, alpha) = self.chosen(&standard.scales, report)?;
        let squares = LeastSquares::ridge(alpha);
        let solved = squares.solve(&gram, &chosen, &standard.scales, self.blocks.rows());
        let mut fit = solved.map_err(unsolved)?;
        let of_prior = self.towards_prior(&gram, &standard.scales, alpha, &mut fit, report)?;
        report.condition = Some(fit.condition);
        report.in_sample_rmse = Some((fit.residual_sum_of_squares / gram.count() as f64).sqrt());
        let of_all = self.selection.as_ref().and_then(|_| {
            let all: Vec<usize> = (0..self.regressors.len()).collect();
            squares.solve(&gram, &all, &standard.scales, None).ok()
        });
        self.note(&fit, of_all.as_ref().unwrap_or(&fit), report);
        let names = fit
            .columns
            .iter()
            .map(|&column| self.regressors[column].name.clone())
            .collect();
        Ok(Found {
            names,
            alpha,
            gram,
            standard,
            squares,
            fit,
            of_prior,
        })
    }

    /// Pulls a fit towards the prior, where there is one; gives what says how far its predictions may be off.
    fn towards_prior(
        &self,
        gram: &Gram,
        scales: &[f64],
        alpha: f64,
        fit: &mut LinearFit,
        report: &mut TrainingReport,
    ) -> Result<Option<OfPrior>, TrainingError> {
        let (Some(prior), Some((_, weight))) = (&self.prior, self.solver.prior()) else {
            return Ok(None);
        };
        let prior = prior.as_ref().map_err(|reason| TrainingError::Unsolvable {
            reason: reason.clone(),
        })?;
        let pull = prior.pull(weight, alpha);
        let columns = prior.columns(&fit.columns);
        let solved = prior.coefficients.fit(gram, &columns, scales, pull);
        let solved = solved.map_err(unsolved)?;
        fit.coefficients = solved.coefficients;
        fit.intercept = solved.intercept;
        fit.residual_sum_of_squares = solved.residual_sum_of_squares;
        // What is said of how least squares were solved is not of this fit.
        fit.method = Method::Cholesky;
        prior.tell(pull, &self.regressors, &fit.columns, report);
        let variance = solved
            .variance
            .map(|of| prior.variance(of, pull, gram.count()));
        Ok(Some((variance, prior.novelty(&fit.columns))))
    }

    /// The range of some of the regressors, where it was kept.
    pub(crate) fn range_of(&self, columns: &[usize]) -> Option<TrainedRange> {
        Some(self.range.as_ref()?.of(columns))
    }

    /// How far rows are from those of a fit.
    pub(crate) fn novelty_of(&self, found: &Found) -> Option<Novelty> {
        novelty_of(&self.blocks, &found.standard, &found.fit.columns)
    }

    /// The median over its rows of a measure of some of their columns; none where they were not kept.
    pub(crate) fn median(&self, columns: &[usize], of: impl Fn(&[f64]) -> f64) -> Option<f64> {
        let row = |x: &[f64]| -> Vec<f64> { columns.iter().map(|&column| x[column]).collect() };
        let rows = self.blocks.rows()?;
        let mut all: Vec<f64> = rows.iter().map(|(x, ..)| of(&row(x))).collect();
        all.sort_by(f64::total_cmp);
        all.get(all.len() / 2).copied()
    }

    /// How many rows it was given.
    pub(crate) fn rows(&self) -> u64 {
        self.blocks.count()
    }

    /// The fitted model; what there is to tell goes into the report.
    pub(crate) fn solve(
        &self,
        report: &mut TrainingReport,
    ) -> Result<LinearPredictor, TrainingError> {
        self.fitted(report, false).map(|(model, _)| model)
    }

    /// The fitted model, and the same as one that goes on learning, where it is to.
    fn fitted(
        &self,
        report: &mut TrainingReport,
        tells_errors: bool,
    ) -> Result<(LinearPredictor, Option<OnlinePredictor>), TrainingError> {
        let mut found = self.find(report)?;
        if tells_errors && !matches!(self.solver, Solver::Sgd { .. }) {
            jackknife::tell(
                &self.blocks,
                &found.names,
                |gram| self.again(&found, gram),
                report,
            );
        }
        if let Some((variance, novelty)) = found.of_prior.take() {
            let model = LinearPredictor {
                variance,
                regressors: found.names,
                coefficients: found.fit.coefficients,
                intercept: found.fit.intercept,
                novelty,
            };
            return Ok((model, None));
        }
        let novelty = self.novelty_of(&found);
        match self.solver {
            Solver::Ridge { .. } | Solver::Ols {} => {
                let model = LinearPredictor {
                    // Without more rows than coefficients there is a prediction, and nothing to say about its error.
                    variance: found
                        .squares
                        .prediction_variance(&found.gram, &found.standard.scales, &found.fit)
                        .ok(),
                    regressors: found.names,
                    coefficients: found.fit.coefficients.clone(),
                    intercept: found.fit.intercept,
                    novelty,
                };
                Ok((model, None))
            }
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
                self.descend(SgdOptions { alpha, rate }, epochs, (found, novelty), report)
            }
        }
    }

    /// Coefficients and the sum of the squared residuals of a fit of the same columns to other rows.
    fn again(&self, found: &Found, gram: &Gram) -> Option<(Vec<f64>, f64)> {
        let (columns, scales) = (&found.fit.columns, &found.standard.scales);
        if let (Some(Ok(prior)), Some((_, weight))) = (&self.prior, self.solver.prior()) {
            let (known, pull) = (prior.columns(columns), prior.pull(weight, found.alpha));
            let fit = prior.coefficients.fit(gram, &known, scales, pull).ok()?;
            return Some((fit.coefficients, fit.residual_sum_of_squares));
        }
        let fit = found.squares.solve(gram, columns, scales, None).ok()?;
        Some((fit.coefficients, fit.residual_sum_of_squares))
    }

    /// Stochastic gradients on standardised regressors and centred truths, given on the scale of the data.
    fn descend(
        &self,
        options: SgdOptions,
        epochs: usize,
        (found, novelty): (Found, Option<Novelty>),
        report: &mut TrainingReport,
    ) -> Result<(LinearPredictor, Option<OnlinePredictor>), TrainingError> {
        let Found {
            names,
            standard,
            fit: LinearFit { columns, .. },
            ..
        } = found;
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
        let mut sgd = Sgd::new(columns.len(), options).map_err(unsolved)?;
        sgd.epochs(scaled.iter().map(|(x, y)| (x.as_slice(), *y)), epochs);
        let coefficients: Vec<f64> = sgd
            .weights()
            .iter()
            .zip(&columns)
            .map(|(w, &column)| w / standard.scales[column])
            .collect();
        let shift: f64 = coefficients
            .iter()
            .zip(&columns)
            .map(|(b, &column)| b * standard.means[column])
            .sum();
        let model = LinearPredictor {
            regressors: names.clone(),
            coefficients,
            intercept: sgd.intercept() + mean - shift,
            variance: None,
            novelty: novelty.clone(),
        };
        let squared = rows.iter().map(|(x, y, _)| {
            let row: Vec<f64> = columns.iter().map(|&column| x[column]).collect();
            (model.predict(&row) - y).powi(2)
        });
        let rmse = (squared.sum::<f64>() / rows.count() as f64).sqrt();
        if !rmse.is_finite() {
            return Err(diverged(&model, options.rate));
        }
        report.in_sample_rmse = Some(rmse);
        let online = self.range_of(&columns).map(|range| {
            let frame = Frame::new(names, &columns, &standard, mean);
            OnlinePredictor::new(frame, Recursion::Sgd(sgd), range, Some(rmse), novelty)
        });
        Ok((model, online))
    }

    /// Tells of the columns of all candidates, and of how those chosen were solved.
    fn note(&self, fit: &LinearFit, of_all: &LinearFit, report: &mut TrainingReport) {
        name_columns(of_all, |column| &self.regressors[column].name, report);
        match fit.method {
            Method::Cholesky => {}
            // The least squares only looked at the regressors; the coefficients are found in another way.
            _ if matches!(self.solver, Solver::Sgd { .. }) => {}
            // Every coefficient is determined, so there is nothing to worry about.
            Method::Svd { rank } if rank == fit.columns.len() => {}
            Method::Svd { rank } => {
                report.figure("rank", rank);
                report.figure("coefficients", fit.columns.len());
                report.notes.push(format!(
                    "ill-conditioned, so solved by singular values: the rows determine {rank} of {} coefficients",
                    fit.columns.len()
                ));
            }
            Method::TinyRidge { alpha } => {
                report.figure("tiny_ridge", alpha);
                report.notes.push(format!(
                    "ill-conditioned, and the rows are not kept, so solved with a ridge of {alpha:e}"
                ));
            }
        }
    }
}

impl Trainer for LinearTrainer {
    fn row(&mut self, regressors: &[f64], truth: f64) {
        if let Some(range) = &mut self.range {
            range.include(regressors);
        }
        self.blocks.push(regressors, truth);
    }

    fn segment(&mut self) {
        self.blocks.segment();
    }

    fn summed(&mut self) -> Option<&mut dyn Summed> {
        // Gradients go over the rows several times.
        let by_rows = matches!(self.solver, Solver::Sgd { .. });
        if !by_rows && !self.blocks.is_in_stretches() {
            self.blocks = self.blocks.clone().in_stretches();
        }
        (!by_rows).then_some(self)
    }

    fn finish(self: Box<Self>) -> Result<Trained, TrainingError> {
        let mut report = TrainingReport::default();
        let predictor: Box<dyn Predictor> = match self.fitted(&mut report, true)? {
            (_, Some(online)) => Box::new(online),
            (model, None) => Box::new(model),
        };
        Ok(Trained { predictor, report })
    }
}

impl Summed for LinearTrainer {
    fn sums(&mut self) -> Result<String, TrainingError> {
        sums_of(&self.blocks)
    }

    fn add_sums(&mut self, sums: &str, places: &[usize]) -> Result<(), TrainingError> {
        add_sums(&mut self.blocks, sums, places)
    }

    fn end_stretch(&mut self) {
        self.blocks.end_stretch();
    }
}

/// Why stochastic gradients gave no model: their steps grew without bound.
fn diverged(model: &LinearPredictor, rate: LearningRate) -> TrainingError {
    let (LearningRate::Constant { eta0 } | LearningRate::InvScaling { eta0, .. }) = rate;
    let named = model.regressors.iter().zip(&model.coefficients);
    let named = named.map(|(name, value)| (format!("the coefficient of {name}"), *value));
    let mut all = named.chain([("the intercept".to_owned(), model.intercept)]);
    let what = all.find(|(_, value)| !value.is_finite());
    let what = what.map_or(
        "the error on the rows of the fit".to_owned(),
        |(what, _)| what,
    );
    TrainingError::Unsolvable {
        reason: format!(
            "the stochastic gradients diverged: {what} is not finite with `eta0` = {eta0:?}; a smaller `eta0` takes smaller steps"
        ),
    }
}

/// Why a fit that goes over its rows several times cannot be made once they are gone.
pub(crate) fn rows_gone(blocks: &GramBlocks) -> TrainingError {
    let bytes = blocks.count() as f64 * (blocks.width() + 1) as f64 * size_of::<f64>() as f64;
    TrainingError::Unsolvable {
        reason: format!(
            "it goes over its rows several times, and they did not fit in memory: they take {:.0} MB of the `--memory` that all \
             estimators share",
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
    /// How far a truth may be from its prediction, where theory says so.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) variance: Option<PredictionVariance>,
    /// How far regressors are from those of the fit, where its rows say so.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) novelty: Option<Novelty>,
}

impl LinearPredictor {
    fn form(&self) -> LinearForm<'_> {
        LinearForm {
            constant: self.intercept,
            coefficients: &self.coefficients,
        }
    }
}

impl Predictor for LinearPredictor {
    fn uses(&self) -> &[String] {
        &self.regressors
    }

    fn mistakes(&self) -> Vec<Mistake> {
        let width = self.regressors.len();
        let lists = [("coefficients", self.coefficients.len())];
        let mut mistakes = Mistake::of_lengths(width, &lists);
        if let Some(variance) = &self.variance {
            let PredictionVariance {
                noise,
                rows,
                centre,
                root,
            } = variance;
            mistakes.extend(Mistake::of_lengths(width, &[("centre", centre.len())]));
            let triangle = width * (width + 1) / 2;
            mistakes.extend(Mistake::of_lengths(triangle, &[("root", root.len())]));
            if *noise < 0.0 || noise.is_infinite() {
                let message = format!("`noise` is {noise} and must be from 0 on");
                mistakes.push(Mistake::at("noise", message));
            }
            if *rows == 0 {
                let message = "`rows` is 0 and must be from 1 on";
                mistakes.push(Mistake::at("rows", message));
            }
        }
        mistakes.extend(novelty_mistakes(self.novelty.as_ref(), width));
        mistakes
    }

    fn predict(&self, regressors: &[f64]) -> f64 {
        self.form().at(regressors)
    }

    fn linear(&self) -> Option<LinearForm<'_>> {
        Some(self.form())
    }

    fn novelty(&self, regressors: &[f64]) -> f64 {
        novelty_at(self.novelty.as_ref(), regressors)
    }

    fn centre(&self) -> f64 {
        let novelty = self.novelty.as_ref();
        novelty.map_or(self.intercept, |of| {
            of.centre(self.intercept, &self.coefficients)
        })
    }

    fn std_dev(&self, regressors: &[f64]) -> f64 {
        let variance = self.variance.as_ref();
        variance.map_or(f64::NAN, |variance| variance.at(regressors).sqrt())
    }

    fn coefficients(&self) -> Option<Coefficients> {
        let errors = self.variance.as_ref();
        let errors = errors.map(PredictionVariance::standard_errors);
        let (constant, values) = (self.intercept, &self.coefficients);
        Some(Coefficients::linear(constant, values, errors.as_deref()))
    }
}

athermal_core::predictor!(LinearPredictor, "linear");
