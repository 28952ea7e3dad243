//! Decides what the author of an estimator implements: learning from rows, and predicting from a row.

use std::collections::BTreeMap;
use std::fmt::Debug;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{
    Figure, Figures, InputPort, KindFacts, LearningLimits, Learns, Mistake, Predictor,
    TrainingError,
};
use crate::time::{Duration, Instant};
use crate::unit::Unit;

/// A node that predicts the value which its `truth` will have, `ahead` of now.
///
/// The author says which regressors are wanted, and trains on rows. The framework pairs rows with truths at the right
/// instants, keeps horizons and embargo, drops rows without a value and scores the outcome.
///
/// A whole estimator, which predicts the mean of the truths that it was fitted on:
///
/// ```
/// use athermal_core::node::prelude::*;
///
/// /// Predicts the mean of the truths of the fit.
/// #[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
/// #[serde(deny_unknown_fields)]
/// pub struct Mean {}
///
/// impl Estimator for Mean {
///     fn inputs() -> &'static [InputPort] {
///         const { &[InputPort::truth("what is predicted")] }
///     }
///
///     fn regressors(&self) -> Regressors {
///         Regressors { every_tick: true, ..Regressors::default() }
///     }
///
///     fn trainer(&self, _setup: &TrainingSetup) -> Box<dyn Trainer> {
///         Box::new(Averaging { sum: 0.0, rows: 0 })
///     }
/// }
///
/// struct Averaging {
///     sum: f64,
///     rows: usize,
/// }
///
/// impl Trainer for Averaging {
///     fn row(&mut self, _regressors: &[f64], truth: f64) {
///         self.sum += truth;
///         self.rows += 1;
///     }
///
///     fn finish(self: Box<Self>) -> Result<Trained, TrainingError> {
///         let mean = MeanOfFit { mean: self.sum / self.rows as f64 };
///         Ok(Trained { predictor: Box::new(mean), report: TrainingReport::default() })
///     }
/// }
///
/// #[derive(Debug, Clone, Serialize, Deserialize)]
/// struct MeanOfFit {
///     mean: f64,
/// }
///
/// impl Predictor for MeanOfFit {
///     fn uses(&self) -> &[String] {
///         &[]
///     }
///
///     fn predict(&self, _regressors: &[f64]) -> f64 {
///         self.mean
///     }
/// }
///
/// athermal_core::predictor!(MeanOfFit, "mean_of_fit");
/// athermal_core::register!(Mean, Estimator, "mean_of_fit");
/// # fn main() {}
/// ```
#[diagnostic::on_unimplemented(
    message = "`{Self}` is no estimator",
    label = "implement `athermal_core::node::Estimator` for it, or register it in the role that it has"
)]
pub trait Estimator: Debug + Send + Sync {
    /// The input ports: `truth`, and where features are taken, `features`.
    fn inputs() -> &'static [InputPort]
    where
        Self: Sized;

    /// What reports ask of the kind.
    fn facts() -> KindFacts
    where
        Self: Sized,
    {
        KindFacts::default()
    }

    /// Which regressors make up a row.
    fn regressors(&self) -> Regressors;

    /// Mistakes between parameters. The compiler has checked the ranges of the schema.
    fn mistakes(&self) -> Vec<Mistake> {
        Vec::new()
    }

    /// Mistakes that show only beside the truth: quantities in units that do not measure the same as this one.
    fn mistakes_beside(&self, _truth: &Unit) -> Vec<Mistake> {
        Vec::new()
    }

    /// Mistakes that show only beside so many features: more of them than it takes, or parameters for another number.
    fn mistakes_for(&self, _features: usize) -> Vec<Mistake> {
        Vec::new()
    }

    /// Mistakes that show only beside all that makes up a row: parameters that are for other regressors, or another truth.
    fn mistakes_of_row(&self, _row: &PlannedRow<'_>) -> Vec<Mistake> {
        Vec::new()
    }

    /// The predictor of a kind that needs no fit, given the names of its regressors.
    fn fixed(&self, _regressors: &[String]) -> Option<Box<dyn Predictor>> {
        None
    }

    /// Whether it goes on learning while it runs. What it starts from is its fit: see [`Predictor::learner`].
    fn learns(&self) -> Learns {
        Learns::Never { help: None }
    }

    /// Whether a fit keeps the range of its regressors ([`Predictor::trained_range`]), outside which nothing is learned; without
    /// it, a `margin` about that range is a mistake.
    fn keeps_range(&self) -> bool {
        true
    }

    /// Whether its predictions come with their standard deviation, in the port `std_dev`.
    fn has_std_dev(&self) -> bool {
        false
    }

    /// Whether its fit says how far regressors are outside of its rows, in the port `novelty`: see [`Predictor::novelty`].
    fn has_novelty(&self) -> bool {
        false
    }

    /// Whether a regressor that stays the same in all rows of a fit may say something, as it does in a model without a constant of
    /// its own. From any other it is left out, so that its predictions go on when the sensor behind it is dead.
    fn needs_constants(&self) -> bool {
        false
    }

    /// What learns from the rows.
    fn trainer(&self, setup: &TrainingSetup) -> Box<dyn Trainer>;
}

/// Which regressors an estimator wants.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Regressors {
    /// The lags at which each channel of the `features` port is read; none means no features.
    pub feature_lags: Vec<Duration>,
    /// The lags at which the truth is read.
    pub truth_lags: TruthLags,
    /// Whether the answer changes with time alone, so that the node runs at every tick.
    pub every_tick: bool,
    /// Which runs its trainer gets.
    pub runs: Runs,
}

/// Which runs a trainer gets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Runs {
    /// Those that truths belong to, as rows.
    #[default]
    OfTruths,
    /// Also those between two rows that are further apart than usual, for trainers that follow the regressors where a truth is
    /// missing: see [`Trainer::run_at`].
    BetweenTruths {
        /// How far apart truths are wanted; without it, or where they come more often, the typical distance of the last ones is
        /// usual.
        every: Option<Duration>,
    },
}

/// The lags at which the truth is a regressor.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub enum TruthLags {
    /// It is none.
    #[default]
    None,
    /// At these lags, counted back from the instant of the run.
    At(Vec<Duration>),
    /// At the smallest lag that sees nothing of the answer.
    SmallestLegal,
}

/// A regressor as reports and models name it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Regressor {
    /// The channel and, where it has one, the lag: `gradients.room@150s`, `drift.Z1 lag 5min`.
    pub name: String,
    /// The unit of its values.
    pub unit: String,
    /// The measured channels that it is made from, in the order of the plan: `temperature.room`.
    #[serde(default)]
    pub sensors: Vec<String>,
    /// How far back it is read.
    #[serde(default)]
    pub lag: Duration,
    /// Whether it is a past value of the truth, read as such.
    #[serde(default)]
    pub of_truth: bool,
}

/// What makes up the rows of an instance.
#[derive(Debug, Clone, Copy)]
pub struct PlannedRow<'a> {
    /// The instance, as models name it: `thermal.Z1`.
    pub instance: &'a str,
    /// The regressors.
    pub regressors: &'a [Regressor],
    /// The unit of the truth.
    pub truth: &'a Unit,
    /// How far ahead the truth is predicted.
    pub ahead: Duration,
}

/// What a trainer knows before the first row.
#[derive(Debug, Clone)]
pub struct TrainingSetup {
    /// The instance that is fitted, as models name it: `thermal.Z1`.
    pub instance: String,
    /// The regressors, in the order of a row's values.
    pub regressors: Vec<Regressor>,
    /// Which of the regressors that the estimator asked for these are: those without values in too many rows are left out, and those
    /// that stay the same in all of them, unless it [needs](Estimator::needs_constants) them.
    pub places: Vec<usize>,
    /// The unit of errors, for what is reported of the fit: that of the truth, or K where that is a temperature.
    pub error_unit: String,
    /// How many bytes of rows the trainer may keep.
    pub memory: usize,
    /// How far ahead the truth is predicted.
    pub ahead: Duration,
    /// The span of the truth: the length of past time that one value summarises.
    pub span: Duration,
    /// Whether the estimator will go on learning while it runs, so that its predictor needs what that takes.
    pub learns: bool,
    /// What it will not learn from then.
    pub limits: LearningLimits,
}

/// Takes the rows of one fit, in order.
pub trait Trainer: Send {
    /// One row: the regressors, all of them present, and the truth that they belong to.
    fn row(&mut self, regressors: &[f64], truth: f64);

    /// The same with the instant at which the truth was measured, for trainers to which time matters.
    fn row_at(&mut self, _at: Instant, regressors: &[f64], truth: f64) {
        self.row(regressors, truth);
    }

    /// A run between the last row and the next: its regressors, all of them present, and the instant whose truth it predicts, from
    /// which nothing is learned. That truth has not been measured, lies outside of the limits of the fit, or never comes.
    ///
    /// Only trainers that ask for it are called ([`Runs::BetweenTruths`]), and only where rows are further apart than usual: of the
    /// runs between them, some in each such distance. Not called for the part of the data that a fold leaves out, nor where
    /// rows alone fill the memory of the fit.
    fn run_at(&mut self, _of: Instant, _regressors: &[f64]) {}

    /// The next row belongs to another segment of the data.
    fn segment(&mut self) {}

    /// The same as a fit that sums can take the place of rows in; none where more of the rows is needed than such sums. Called before
    /// the first row, and then for each stretch of the data.
    fn summed(&mut self) -> Option<&mut dyn Summed> {
        None
    }

    /// The result.
    ///
    /// # Errors
    /// When the rows do not allow one.
    fn finish(self: Box<Self>) -> Result<Trained, TrainingError>;

    /// The same for a trainer that compares many orders, and tells before each which of how many it is.
    ///
    /// # Errors
    /// As [`Trainer::finish`].
    fn finish_telling(
        self: Box<Self>,
        _order: &mut dyn FnMut(usize, usize),
    ) -> Result<Trained, TrainingError> {
        self.finish()
    }
}

/// A fit in which sums take the place of rows: those of squares and products, from which least squares are solved. The rows of a
/// stretch of the data are summed once, and many fits are made of the sums.
pub trait Summed {
    /// The sums of all rows so far as JSON, in which every number comes back to the bit.
    ///
    /// # Errors
    /// When a sum is no finite number.
    fn sums(&mut self) -> Result<String, TrainingError>;

    /// Takes the sums of rows that another trainer of the same estimator gave; `places` says which of its regressors these are.
    ///
    /// # Errors
    /// When they are none, or have not these regressors.
    fn add_sums(&mut self, sums: &str, places: &[usize]) -> Result<(), TrainingError>;

    /// Ends a stretch: what was taken since the last one is not cut by folds.
    fn end_stretch(&mut self);
}

/// What a fit gave.
#[derive(Debug)]
pub struct Trained {
    /// What predicts from now on.
    pub predictor: Box<dyn Predictor>,
    /// How the fit went.
    pub report: TrainingReport,
}

/// How a fit went, for people and model cards.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct TrainingReport {
    /// The regressors chosen, in the order in which they were, with the score after each.
    pub selection: Vec<SelectionStep>,
    /// The step at which selection stopped, since it was not worth it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub refused: Option<SelectionStep>,
    /// The orders that were compared, where they were.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub orders: Option<Box<OrderTable>>,
    /// Condition number of the standardised design.
    #[serde(
        with = "super::number_or_none",
        skip_serializing_if = "Option::is_none"
    )]
    pub condition: Option<f64>,
    /// Root mean square error over the rows of the fit, in the unit of the truth.
    #[serde(
        with = "super::number_or_none",
        skip_serializing_if = "Option::is_none"
    )]
    pub in_sample_rmse: Option<f64>,
    /// The median size of the errors over the rows of the fit, over that of predicting the median of the truths; where outliers cannot
    /// pull the fit, which is then not judged by its root mean square error.
    #[serde(
        with = "super::number_or_none",
        skip_serializing_if = "Option::is_none"
    )]
    pub robust_error: Option<f64>,
    /// What the user should know, a sentence each.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<String>,
    /// What else was found, for programs: every figure of a sentence stands here by its name, unrounded.
    #[serde(skip_serializing_if = "Figures::is_empty")]
    pub figures: Figures,
}

impl TrainingReport {
    /// Tells programs a figure by its name, which has the unit at its end where that is not the truth's: `step_s`.
    pub fn figure(&mut self, name: &str, value: impl Into<Figure>) {
        self.figures.insert(name.to_owned(), value.into());
    }
}

/// Orders of a model, compared on the same rows.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct OrderTable {
    /// The figure that chose.
    #[serde(with = "FigureName")]
    pub by: OrderFigure,
    /// The rows on which each was fitted.
    pub rows: usize,
    /// Which one was chosen.
    pub chosen: usize,
    /// All of them.
    pub tried: Vec<TriedOrder>,
}

/// A figure by which orders are compared; the smallest is the best.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum OrderFigure {
    /// Akaike's information criterion.
    Aic,
    /// The same, corrected for few rows.
    #[default]
    Aicc,
    /// The Bayesian information criterion, which takes the fewest coefficients.
    Bic,
    /// The final prediction error.
    Fpe,
}

impl std::fmt::Display for OrderFigure {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Aic => "AIC",
            Self::Aicc => "AICc",
            Self::Bic => "BIC",
            Self::Fpe => "FPE",
        })
    }
}

/// A figure as models name it: as it is displayed.
#[derive(Serialize, Deserialize)]
#[serde(remote = "OrderFigure")]
enum FigureName {
    #[serde(rename = "AIC")]
    Aic,
    #[serde(rename = "AICc")]
    Aicc,
    #[serde(rename = "BIC")]
    Bic,
    #[serde(rename = "FPE")]
    Fpe,
}

impl OrderTable {
    /// The orders by their places in [`tried`](Self::tried): the chosen one, then the others from the best to the worst.
    #[must_use]
    pub fn ranked(&self) -> Vec<usize> {
        let mut ranked: Vec<usize> = (0..self.tried.len()).collect();
        ranked.sort_by(|&a, &b| {
            let chosen = (b == self.chosen).cmp(&(a == self.chosen));
            let figure = |nth: usize| self.tried[nth].figure(self.by);
            chosen.then(figure(a).total_cmp(&figure(b)))
        });
        ranked
    }
}

impl TriedOrder {
    /// What it is worth by one of the figures.
    #[must_use]
    pub fn figure(&self, by: OrderFigure) -> f64 {
        match by {
            OrderFigure::Aic => self.aic,
            OrderFigure::Aicc => self.aicc,
            OrderFigure::Bic => self.bic,
            OrderFigure::Fpe => self.fpe,
        }
    }
}

/// An order of a model, and what it is worth: small is good.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TriedOrder {
    /// What is open of it, for people: `na 2, nb 1`.
    pub order: String,
    /// The same for programs: each letter with its number.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub letters: BTreeMap<String, usize>,
    /// How many coefficients it has. AIC, AICc and BIC count the variance of what is left beside them, FPE does not.
    pub coefficients: usize,
    /// Akaike's information criterion.
    #[serde(with = "crate::node::number")]
    pub aic: f64,
    /// The same, corrected for few rows.
    #[serde(with = "crate::node::number")]
    pub aicc: f64,
    /// The Bayesian information criterion.
    #[serde(with = "crate::node::number")]
    pub bic: f64,
    /// The final prediction error, in the square of the truth's unit.
    #[serde(with = "crate::node::number")]
    pub fpe: f64,
}

/// A regressor, or a sensor with all its regressors, chosen or taken out again by selection.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct SelectionStep {
    /// Its name.
    pub regressor: String,
    /// Whether it was taken out.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub removed: bool,
    /// The cross-validation score after the step: the mean over the folds.
    #[serde(with = "crate::node::number")]
    pub score: f64,
    /// The score of each fold.
    #[serde(default, with = "crate::node::numbers")]
    pub folds: Vec<f64>,
    /// What was tried at this step, the best first; this one is among them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub candidates: Vec<CandidateScore>,
}

impl SelectionStep {
    /// The name, with a minus before one that was taken out.
    #[must_use]
    pub fn label(&self) -> String {
        let sign = if self.removed { "− " } else { "" };
        format!("{sign}{}", self.regressor)
    }
}

/// A candidate of a selection step.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CandidateScore {
    /// Its name.
    pub name: String,
    /// The score that the step would have had with it.
    #[serde(with = "crate::node::number")]
    pub score: f64,
}
