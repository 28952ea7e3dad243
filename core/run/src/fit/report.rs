//! What a fit reports about itself.

use std::collections::BTreeMap;
use std::fmt;

use serde::{Deserialize, Serialize};

use super::BlockError;
use crate::engine::{EngineError, SampleRange};
use crate::node::{TrainingError, TrainingReport};
use crate::recording::SourceError;
use crate::score::Levels;
use crate::time::Instant;

/// Why a fit could not be run.
#[derive(Debug)]
pub enum FitError {
    /// The recording cannot be read.
    Recording(SourceError),
    /// The engine cannot be built.
    Engine(EngineError),
    /// The fit cannot be made by blocks.
    Blocks(BlockError),
    /// A node panicked.
    Panicked {
        /// Which, when, and what it says.
        text: String,
    },
}

impl fmt::Display for FitError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Recording(error) => write!(f, "{error}"),
            Self::Engine(error) => write!(f, "{error}"),
            Self::Blocks(error) => write!(f, "{error}"),
            Self::Panicked { text } => write!(f, "the fit cannot go on: {text}"),
        }
    }
}

impl std::error::Error for FitError {}

impl From<SourceError> for FitError {
    fn from(error: SourceError) -> Self {
        Self::Recording(error)
    }
}

impl From<EngineError> for FitError {
    fn from(error: EngineError) -> Self {
        Self::Engine(error)
    }
}

/// How a fit went.
#[derive(Debug, Clone, Default)]
pub struct FitReport {
    /// The first and last instant of the data.
    pub period: Option<(Instant, Instant)>,
    /// Ticks in the data.
    pub ticks: u64,
    /// Segments in the data.
    pub segments: u64,
    /// Ticks refused because their time was not after the one before.
    pub refused: u64,
    /// Samples rejected as infinite or out of range, by measured channel.
    pub rejected: Vec<(String, u64)>,
    /// Between which values the samples of each measured channel lay.
    pub ranges: Vec<SampleRange>,
    /// The usual time between two samples of each signal, in seconds; without those of which there are no two.
    pub rates: BTreeMap<String, f64>,
    /// The means of truths that are levels.
    pub levels: Levels,
    /// How the fit of each estimator, and of each feature that is fitted, went; in the order of the plan.
    pub estimators: Vec<EstimatorFit>,
}

impl FitReport {
    /// What could not be fitted, by its node, and why. It gives no predictions.
    pub fn failed(&self) -> impl Iterator<Item = (&str, &TrainingError)> {
        self.estimators.iter().filter_map(|fit| match &fit.outcome {
            Outcome::Failed(error) => Some((fit.node.as_str(), error)),
            Outcome::Fitted(_) => None,
        })
    }
}

fn is_zero(count: &u64) -> bool {
    *count == 0
}

/// Rows that did not take part in a fit, by reason.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Dropped {
    /// Truths before which the estimator had not run at the right time.
    pub without_run: u64,
    /// Truths outside the limits of `train.abs_truth`.
    pub outside_limits: u64,
    /// Truths whose windows hold a leap.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub leapt: u64,
    /// Rows in which a regressor had no value.
    pub incomplete: u64,
}

/// How the fit of one estimator went.
#[derive(Debug, Clone)]
pub struct EstimatorFit {
    /// The instance: `thermal.Z1`.
    pub node: String,
    /// Its kind.
    pub kind: &'static str,
    /// What it predicts.
    pub truth: String,
    /// The unit of its errors: that of the truth, or K where that is a temperature.
    pub unit: String,
    /// Rows that it was fitted on.
    pub rows: u64,
    /// Rows left out.
    pub dropped: Dropped,
    /// Candidates left out because they had no value in too many rows, with the share of rows in which they had one.
    pub dropped_candidates: Vec<(String, f64)>,
    /// Whether rows were streamed in a second pass because they did not fit in the stated memory.
    pub streamed: bool,
    /// The outcome.
    pub outcome: Outcome,
}

/// Whether an estimator could be fitted.
#[derive(Debug, Clone, PartialEq)]
pub enum Outcome {
    /// It could.
    Fitted(TrainingReport),
    /// It could not, and gives nothing.
    Failed(TrainingError),
}
