//! What the errors of this crate are to whoever asked for the work.

use athermal_core::failure::{Failure, outside};

use crate::fit::FitError;
use crate::live::{RunError, StateError};
use crate::model::ModelError;

impl From<ModelError> for Failure {
    fn from(error: ModelError) -> Self {
        match error {
            ModelError::Graph {
                diagnostics,
                sources,
            } => Self::Graph {
                diagnostics,
                sources,
            },
            ModelError::Unreadable { .. } => Self::Outside(error.to_string()),
            other => Self::Request(other.to_string()),
        }
    }
}

impl From<RunError> for Failure {
    fn from(error: RunError) -> Self {
        match error {
            RunError::Source(error) | RunError::Sink(error) => outside(error),
            RunError::State(error) => error.into(),
            RunError::Engine(_) | RunError::Stage(_) | RunError::Copy(_) => {
                Self::Request(error.to_string())
            }
        }
    }
}

impl From<StateError> for Failure {
    fn from(error: StateError) -> Self {
        match error {
            StateError::Foreign { .. } => Self::Request(error.to_string()),
            StateError::Held { path } => Self::Outside(format!(
                "{}: another run keeps its state there: end that one first, or name another file with `--state`",
                path.display()
            )),
            other => Self::Outside(other.to_string()),
        }
    }
}

impl From<FitError> for Failure {
    fn from(error: FitError) -> Self {
        match error {
            FitError::Recording(error) => outside(error),
            FitError::Engine(_) | FitError::Blocks(_) => Self::Request(error.to_string()),
            FitError::Panicked { .. } => Self::Outside(error.to_string()),
        }
    }
}
