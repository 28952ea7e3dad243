//! The one function of a fleet: the rows of a machine and a graph to a model. It knows neither clock nor path nor environment.

use athermal_core::watch::Watch;
use athermal_jobs::fit::FitOutcome;
use athermal_jobs::{RowsId, Summed};
use athermal_run::fit::{FitError, FitOptions, FitReport};
use athermal_run::model::{Card, Model};
use athermal_run::recording::Recording;
use thiserror::Error;

/// Why a machine has no model.
#[derive(Debug, Error)]
pub enum MachineError {
    /// The fit could not be run.
    #[error("{0}")]
    Fit(FitError),
    /// The recording gave other rows when it was read again.
    #[error(
        "the rows were not the same when they were read again: fit once nobody writes them any more"
    )]
    Changed,
    /// No node could be fitted.
    #[error("nothing could be fitted: {}", first_of(.0))]
    NothingFitted(Box<FitReport>),
    /// The model cannot be written as JSON.
    #[error("the model cannot be written as JSON: {0}")]
    Unwritable(#[from] serde_json::Error),
}

/// Why the first node could not be fitted, and how many others.
fn first_of(report: &FitReport) -> String {
    let mut failed = report.failed();
    let first = failed.next();
    let first = first.map_or_else(String::new, |(node, why)| format!("{node}: {why}"));
    match failed.count() {
        0 => first,
        more => format!("{first} (and {more} more nodes)"),
    }
}

/// A machine that was fitted.
#[derive(Debug)]
pub struct MachineFit {
    /// The graph with what was fitted, and a card that names rows instead of files.
    pub model: Model,
    /// The rows.
    pub rows: RowsId,
    /// How the fit went, and what may be wrong with the data.
    pub outcome: FitOutcome,
}

impl MachineFit {
    /// What was fitted, as a model.
    pub(crate) fn of(
        graph: &Model,
        outcome: FitOutcome,
        rows: RowsId,
        created: Option<String>,
    ) -> Result<Self, MachineError> {
        if outcome.is_nothing() {
            return Err(MachineError::NothingFitted(Box::new(outcome.report)));
        }
        let card = Card::of(&outcome.report, vec![rows.card()], created);
        let model = Model {
            fitted: outcome.fitted.clone(),
            card: Some(card),
            ..graph.clone()
        };
        Ok(Self {
            model,
            rows,
            outcome,
        })
    }

    /// The bytes of the model: the same for the same rows, graph and date, wherever and in however many batches they were fitted.
    ///
    /// # Errors
    /// When something fitted cannot be written.
    pub fn bytes(&self) -> Result<Vec<u8>, MachineError> {
        Ok(self.model.to_text()?.into_bytes())
    }
}

/// Fits a graph on the rows of one machine.
///
/// `graph` is a graph as [`Model::load_to_fit`] gives it; what was fitted in it before is not looked at. `rows` is read once from its
/// beginning to its end, and again where the fit needs it: where its examples need more than [`FitOptions::memory`], and where
/// estimators learn from the predictions of others. What can be read only once is a `Once` (feature `arrow`). `created` is the date on the card, as RFC 3339
/// writes it. What is in `graph` and `fitted` of the model are the bytes of `athermal fit` on files of the same rows.
///
/// # Errors
/// When the rows cannot be read, a node panics, or nothing could be fitted. What could not be fitted beside others stands in the
/// report.
pub fn fit_machine(
    graph: &Model,
    rows: &dyn Recording,
    options: &FitOptions,
    created: Option<String>,
    host: &dyn Watch,
) -> Result<MachineFit, MachineError> {
    let rows = Summed::new(rows);
    let outcome = FitOutcome::of(&graph.plan, &rows, options, host).map_err(MachineError::Fit)?;
    let rows = rows.id().ok_or(MachineError::Changed)?;
    MachineFit::of(graph, outcome, rows, created)
}
