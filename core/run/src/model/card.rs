//! Decides what a model says of its own making.

use serde::{Deserialize, Serialize};

use crate::engine::SampleRange;
use crate::fit::Dropped;
use crate::node::TrainingReport;

/// Where a model comes from and how its fit went.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Card {
    /// The version of the program that made it.
    pub athermal: String,
    /// When it was made, as RFC 3339 writes it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub created: Option<String>,
    /// The data that it was fitted on.
    pub data: Vec<DataCard>,
    /// The first and last instant of the data, in seconds of their clock.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub period: Option<Period>,
    /// The number of ticks.
    pub ticks: u64,
    /// Between which values the samples of each measured channel lay.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub ranges: Vec<SampleRange>,
    /// How the fit of each estimator went.
    pub estimators: Vec<EstimatorCard>,
}

/// A file that was read.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct DataCard {
    /// Its path as given.
    pub path: String,
    /// Rows in it.
    pub rows: u64,
    /// Its length in bytes.
    pub bytes: u64,
    /// A checksum of its content, for telling files apart (FNV-1a, 64 bits).
    pub hash: String,
}

/// A stretch of time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Period {
    /// Its beginning, in seconds.
    pub from_s: f64,
    /// Its end, in seconds.
    pub to_s: f64,
}

/// How the fit of one estimator went.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EstimatorCard {
    /// The instance: `thermal.Z1`.
    pub node: String,
    /// Its kind.
    #[serde(rename = "type")]
    pub kind: String,
    /// What it predicts.
    pub truth: String,
    /// The unit of the truth.
    pub unit: String,
    /// Rows that it was fitted on.
    pub rows: u64,
    /// Rows left out.
    pub dropped: Dropped,
    /// Candidates left out because they had no value in too many rows, with the share of rows in which they had one.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub dropped_candidates: Vec<(String, f64)>,
    /// The outcome.
    #[serde(flatten)]
    pub report: TrainingReport,
}
