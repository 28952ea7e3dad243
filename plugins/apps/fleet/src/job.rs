//! What a worker is asked, and what it answers: a line of JSON each.

use std::path::PathBuf;

use athermal_core::quantity::Quantity;
use athermal_jobs::RowsId;
use athermal_jobs::blocks::BlockOptions;
use athermal_jobs::data::Reading;
use athermal_run::model::Model;
use serde::{Deserialize, Serialize};

use crate::doubts::Doubt;
use crate::figure::Figure;

/// The first line: what all jobs of a worker have in common.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct Setup {
    /// The graph that is fitted, and the checksum of its content.
    pub graph: Option<(PathBuf, String)>,
    /// How files are read.
    pub reading: Reading,
    /// Whether a fit is one on blocks.
    #[serde(default)]
    pub blocks: BlockOptions,
    /// How many bytes of rows a fit may keep.
    pub memory: usize,
    /// Only truths whose absolute value is below count in scores.
    pub abs_truth_below: Option<Quantity>,
}

/// What is to be done for a machine.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Job {
    /// The machine.
    pub machine: String,
    /// Its files.
    pub files: Vec<PathBuf>,
    /// What.
    pub task: Task,
}

/// What is to be done.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Task {
    /// Fit the graph, unless the rows are those that are known.
    Fit {
        /// The date of the model.
        created: Option<String>,
        /// The rows that it was fitted on before.
        known: Option<RowsId>,
    },
    /// Score a model.
    Evaluate {
        /// The model.
        model: PathBuf,
    },
}

/// What came of it.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Reply {
    /// The rows are those that are known.
    Same,
    /// A model.
    Fitted(Box<Fitted>),
    /// Scores.
    Evaluated(Box<Evaluated>),
    /// Nothing.
    Failed {
        /// Why, as a user reads it.
        error: String,
    },
}

/// A machine that was fitted.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Fitted {
    /// The model as text.
    pub model: String,
    /// The rows.
    pub rows: RowsId,
    /// How well it fits.
    pub scores: Vec<Figure>,
    /// The nodes that could not be fitted.
    pub unfitted: Vec<Unfitted>,
    /// Outputs that are constant, since no voter has a regressor left.
    pub constant: Vec<String>,
    /// What may be wrong with the data.
    pub doubts: Vec<Doubt>,
}

/// A machine that was scored.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Evaluated {
    /// The rows.
    pub rows: RowsId,
    /// Whether these are the rows of the fit.
    pub fitted_on: bool,
    /// How well it predicts.
    pub scores: Vec<Figure>,
    /// What may be wrong with the data.
    pub doubts: Vec<Doubt>,
}

/// A node that could not be fitted.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Unfitted {
    /// The node.
    pub node: String,
    /// Why.
    pub error: String,
}

/// The checksum of a graph's content, by which it is known again: FNV-1a of 64 bits of the graph as a model has it.
///
/// # Errors
/// When it cannot be written as JSON.
pub fn graph_hash(graph: &Model) -> Result<String, serde_json::Error> {
    let bare = Model {
        fitted: athermal_core::engine::Fitted::new(),
        card: None,
        ..graph.clone()
    };
    let text = bare.to_text()?;
    Ok(format!(
        "{:016x}",
        athermal_core::engine::fnv_1a(text.as_bytes())
    ))
}
