//! Nodes that are written in Python: how they are asked, and what becomes of what they raise; what they compute is theirs.

mod estimator;
mod feature;

use std::sync::{Mutex, PoisonError};

use pyo3::call::PyCallArgs;
use pyo3::prelude::*;

pub use estimator::PythonEstimator;
pub use feature::PythonFeature;

/// The named arguments of a class or function.
type Parameters = serde_json::Map<String, serde_json::Value>;

/// Calls a function of the Python side of nodes.
fn ask<'py>(
    py: Python<'py>,
    function: &str,
    arguments: impl PyCallArgs<'py>,
) -> PyResult<Bound<'py, PyAny>> {
    let nodes = py.import("athermal._nodes")?;
    nodes.call_method1(function, arguments)
}

/// What a node raised last, by its text.
static RAISED: Mutex<Option<(String, PyErr)>> = Mutex::new(None);

/// Ends the work with what a node raised: as a panic, to which the engine adds the name of the node.
fn raise(error: PyErr) -> ! {
    let text = error.to_string();
    *RAISED.lock().unwrap_or_else(PoisonError::into_inner) = Some((text.clone(), error));
    std::panic::resume_unwind(Box::new(text))
}

/// What a node raised that ended the work with this text.
pub fn raised(text: &str) -> Option<PyErr> {
    let mut raised = RAISED.lock().unwrap_or_else(PoisonError::into_inner);
    let (_, error) = raised.take_if(|(of, _)| of == text)?;
    Some(error)
}
