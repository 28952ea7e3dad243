//! Decides how the estimators of a plan are trained on a recording: which rows they see, in which passes; not how an
//! estimator learns.

mod bare;
mod between;
mod block;
mod blocks;
mod candidates;
mod collect;
mod cut;
mod doubt;
mod levels;
mod progress;
mod rates;
mod report;
mod train;

use std::collections::BTreeSet;
use std::sync::Arc;

pub use bare::BareOutput;
pub use block::Block;
pub use blocks::{BlockError, Blocks, check as check_blocks, fit_from_blocks, rows_identity};
pub use cut::blocks_of;
pub use progress::FitProgress;
pub use report::{Dropped, EstimatorFit, FitError, FitReport, Outcome};

use crate::compile::Plan;
use crate::engine::Fitted;
use crate::recording::Recording;

/// How a fit is run.
#[derive(Debug, Clone)]
pub struct FitOptions {
    /// How many bytes of rows may be kept; beyond it, rows are read a second time and streamed.
    pub memory: usize,
    /// How many threads train estimators. The result does not depend on it.
    pub threads: usize,
    /// Into how many parts the data is cut for the out-of-fold predictions that estimators fed by estimators learn from.
    pub folds: usize,
    /// The estimators that are fitted, where not all are: of no use where some feed others.
    pub only: Option<BTreeSet<String>>,
}

impl Default for FitOptions {
    fn default() -> Self {
        let threads = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
        Self {
            memory: 64 << 20,
            threads,
            folds: 3,
            only: None,
        }
    }
}

impl FitOptions {
    fn folds(&self) -> usize {
        self.folds.max(2)
    }
}

/// Trains every estimator of a plan that needs it.
///
/// The plan is stepped over the recording; at every new truth each estimator's row is the one that it saw at its last run
/// at or before `τ − ahead`. `progress` is called from time to time with how far it has come.
///
/// # Errors
/// When the recording cannot be read. An estimator that cannot be fitted stands in the report.
pub fn fit(
    plan: &Arc<Plan>,
    recording: &dyn Recording,
    options: &FitOptions,
    progress: &mut (dyn FnMut(FitProgress<'_>) + Send),
) -> Result<(Fitted, FitReport), FitError> {
    levels::Fitting::new(plan, recording, options, progress::Listener::new(progress)).run()
}
