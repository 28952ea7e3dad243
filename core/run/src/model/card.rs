//! A model's card: where it comes from, and how its fit went.

use std::collections::BTreeMap;
use std::fs::{File, Metadata};
use std::hash::Hasher as _;
use std::io::{self, BufRead as _, BufReader};
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::engine::{Fnv1a, SampleRange};
use crate::fit::{Dropped, EstimatorFit, FitReport, Outcome};
use crate::node::TrainingReport;
use crate::score::Levels;

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
    /// The usual time between two samples of each signal, in seconds.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub rates: BTreeMap<String, f64>,
    /// The means of truths that are levels, such as positions.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub levels: Levels,
    /// How the fit of each estimator went.
    pub estimators: Vec<EstimatorCard>,
}

/// A file that was read, or rows that came from elsewhere.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct DataCard {
    /// Its path as given; empty where rows did not come from a file.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub path: String,
    /// Rows in it.
    pub rows: u64,
    /// Its length in bytes; of rows alone that of what the checksum is of.
    pub bytes: u64,
    /// A checksum of its content, by which files are known again, or of the values of the rows (FNV-1a, 64 bits).
    pub hash: String,
    /// Rows from this time on alone were taken, as it was given. The checksum is of the rows then.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub from: Option<String>,
    /// The same of rows before a time.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub to: Option<String>,
}

impl DataCard {
    /// The card of a file with so many rows.
    ///
    /// # Errors
    /// When it cannot be read.
    pub fn of(path: &Path, rows: u64) -> io::Result<Self> {
        let (bytes, hash) = content_of(path)?;
        Ok(Self {
            path: path.display().to_string(),
            rows,
            bytes,
            hash,
            ..Self::default()
        })
    }

    /// Whether rows of a stretch of time alone were taken.
    #[must_use]
    pub fn is_part(&self) -> bool {
        self.from.is_some() || self.to.is_some()
    }

    /// Whether a file has the content of this one. Only a file of the same length is read for its checksum.
    #[must_use]
    pub fn is_of(&self, path: &Path) -> bool {
        let has_length = |of: Metadata| of.is_file() && of.len() == self.bytes;
        std::fs::metadata(path).is_ok_and(has_length)
            && content_of(path).is_ok_and(|(bytes, hash)| bytes == self.bytes && hash == self.hash)
    }
}

/// The length of a file in bytes and the checksum of its content as text: [`Fnv1a`] in hexadecimal digits.
///
/// # Errors
/// When it cannot be read.
pub fn content_of(path: &Path) -> io::Result<(u64, String)> {
    let mut file = BufReader::with_capacity(1 << 16, File::open(path)?);
    let (mut bytes, mut hash) = (0, Fnv1a::default());
    loop {
        let piece = file.fill_buf()?;
        if piece.is_empty() {
            return Ok((bytes, format!("{:016x}", hash.finish())));
        }
        hash.write(piece);
        let read = piece.len();
        bytes += read as u64;
        file.consume(read);
    }
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

/// How many candidates of each step a model keeps: the one taken, and the next best.
const CANDIDATES_KEPT: usize = 2;

impl Card {
    /// The card of a model that was fitted, by a program of this version at this time, on these data.
    #[must_use]
    pub fn of(report: &FitReport, data: Vec<DataCard>, created: Option<String>) -> Self {
        let mut estimators: Vec<_> = report
            .estimators
            .iter()
            .filter_map(EstimatorCard::of)
            .collect();
        for EstimatorCard { report, .. } in &mut estimators {
            for step in report.selection.iter_mut().chain(&mut report.refused) {
                step.candidates.truncate(CANDIDATES_KEPT);
            }
        }
        Self {
            athermal: env!("CARGO_PKG_VERSION").to_owned(),
            created,
            data,
            period: report.period.map(|(from, to)| Period {
                from_s: from.as_ns() as f64 / 1e9,
                to_s: to.as_ns() as f64 / 1e9,
            }),
            ticks: report.ticks,
            ranges: report.ranges.clone(),
            rates: report.rates.clone(),
            levels: report.levels.clone(),
            estimators,
        }
    }
}

impl EstimatorCard {
    /// The card of a node with all of its candidates; none of one that could not be fitted.
    #[must_use]
    pub fn of(fit: &EstimatorFit) -> Option<Self> {
        let Outcome::Fitted(report) = &fit.outcome else {
            return None;
        };
        Some(Self {
            node: fit.node.clone(),
            kind: fit.kind.to_owned(),
            truth: fit.truth.clone(),
            unit: fit.unit.clone(),
            rows: fit.rows,
            dropped: fit.dropped,
            dropped_candidates: fit.dropped_candidates.clone(),
            report: report.clone(),
        })
    }
}
