//! How what numbers do not allow becomes an error of training.

use athermal_core::node::TrainingError;
use athermal_numerics::NumericsError;

/// Why the numbers allow no fit, as the framework tells it.
pub(crate) fn unsolved(error: NumericsError) -> TrainingError {
    match error {
        NumericsError::TooFewRows { needed, found } => TrainingError::TooFewRows {
            rows: usize::try_from(found).unwrap_or(usize::MAX),
            needed: usize::try_from(needed).unwrap_or(usize::MAX),
        },
        error @ NumericsError::FoldsOfBlocks { .. } => TrainingError::Unsolvable {
            reason: format!("{error}; a larger `--memory` keeps the rows, or take fewer folds"),
        },
        error => TrainingError::Unsolvable {
            reason: error.to_string(),
        },
    }
}
