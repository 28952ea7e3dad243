//! Failures as Python exceptions, whose texts are those of the command line.

use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

use athermal::core::diagnostic::{
    Diagnostics, NodePanic, Sources, explain, panic_message, panic_text,
};
use athermal::run::model::ModelError;
use athermal_command::Failure;
use pyo3::exceptions::PyException;
use pyo3::prelude::*;
use pyo3::types::PyList;
use serde_json::Value;

use crate::json::to_python;
use crate::nodes::raised;

/// An exception of the package, by the name of its class.
fn exception(py: Python<'_>, class: &str, text: &str) -> PyErr {
    let made = py
        .import("athermal._errors")
        .and_then(|errors| errors.call_method1("made", (class, text)));
    made.map_or_else(|error| error, PyErr::from_value)
}

/// What a function is asked for does not fit.
pub fn request(py: Python<'_>, text: &str) -> PyErr {
    exception(py, "RequestError", text)
}

/// Nothing could be fitted, and why of each node.
pub fn unfitted(py: Python<'_>, reasons: &[String]) -> PyErr {
    let text = format!("nothing could be fitted:\n  {}", reasons.join("\n  "));
    let error = exception(py, "FitError", &text);
    match error.value(py).setattr("reasons", reasons.to_vec()) {
        Ok(()) => error,
        Err(other) => other,
    }
}

/// The mistakes of a graph.
fn graph(py: Python<'_>, diagnostics: &Diagnostics, sources: &Sources) -> PyErr {
    let error = exception(
        py,
        "GraphError",
        diagnostics.render(sources, false, 100).trim_end(),
    );
    let facts = diagnostics.to_json(sources);
    let all = facts["diagnostics"].as_array();
    let all = all.into_iter().flatten().map(|of| {
        let mut of = of.clone();
        let title = of["code"].as_str().and_then(explain);
        of["title"] = title.map_or(Value::Null, |code| code.title.into());
        to_python(py, &of)
    });
    let set = || {
        let all = PyList::new(py, all.collect::<PyResult<Vec<_>>>()?)?;
        error.value(py).call_method1("_take", (all,))
    };
    match set() {
        Ok(_) => error,
        Err(other) => other,
    }
}

/// The exception of a failure.
pub fn of_failure(py: Python<'_>, failure: &Failure) -> PyErr {
    match failure {
        Failure::Request(text) => request(py, text),
        Failure::Outside(text) => exception(py, "OutsideError", text),
        Failure::Graph {
            diagnostics,
            sources,
        } => graph(py, diagnostics, sources),
        Failure::Exit(status) => exception(py, "OutsideError", &format!("exit status {status}")),
    }
}

/// The exception of a graph or model that cannot be used.
pub fn of_model(py: Python<'_>, error: ModelError) -> PyErr {
    of_failure(py, &error.into())
}

/// Does what runs nodes. What one of them raises, and a panic of one, becomes an exception that names it.
pub fn guarded<R>(py: Python<'_>, work: impl FnOnce() -> R) -> PyResult<R> {
    catch_unwind(AssertUnwindSafe(work)).map_err(|panic| {
        let cause = raised(panic_message(&*panic));
        let node = panic.downcast_ref::<NodePanic>();
        let text = match (&cause, node) {
            // An interrupt goes on as it is.
            (Some(cause), _) if !cause.is_instance_of::<PyException>(py) => {
                return cause.clone_ref(py);
            }
            (Some(cause), None) => return cause.clone_ref(py),
            (Some(cause), Some(of)) => {
                format!("the node `{}` failed {}: {cause}", of.node, of.when)
            }
            (None, Some(_)) => panic_text(&*panic),
            (None, None) => resume_unwind(panic),
        };
        let error = exception(py, "NodeError", &text);
        error.set_cause(py, cause);
        error
    })
}
