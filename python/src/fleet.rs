//! One machine of a fleet, fitted on rows that come as a stream of Arrow, of which only one batch is held at a time.

use arrow_array::RecordBatchReader as _;
use arrow_array::ffi_stream::RecordBatchStreamReader;
use arrow_pyarrow::FromPyArrow as _;
use athermal_fleet::batches;
use pyo3::prelude::*;
use serde_json::json;

use crate::failure::{guarded, request};
use crate::graph::Graph;
use crate::json::to_python;

/// Fits a graph on the rows of a machine. Gives the model as text, its rows, scores and doubts, as the manifest of a fleet has them.
#[pyfunction]
pub fn fit_machine<'py>(
    py: Python<'py>,
    graph: &Bound<'py, Graph>,
    name: &str,
    rows: &Bound<'py, PyAny>,
    created: Option<String>,
    memory: usize,
) -> PyResult<Bound<'py, PyAny>> {
    let reader = RecordBatchStreamReader::from_pyarrow_bound(rows)?;
    let graph = &graph.get().inner;
    // Whoever makes the stream needs Python for it.
    let fit = guarded(py, || {
        py.detach(move || {
            let fit = batches::fitted(graph, name, reader.schema(), reader, memory, created);
            fit.map_err(|error| error.to_string())
        })
    });
    let fit = fit?.map_err(|text| request(py, &text))?;
    to_python(py, &json!(fit))
}

/// Refuses a table that lacks what a graph reads, or has it in a form that cannot be that.
#[pyfunction]
pub fn check_columns(
    py: Python<'_>,
    graph: &Bound<'_, Graph>,
    name: &str,
    rows: &Bound<'_, PyAny>,
) -> PyResult<()> {
    let reader = RecordBatchStreamReader::from_pyarrow_bound(rows)?;
    let read = batches::rows_of(&graph.get().inner, name, reader.schema(), reader);
    read.map(drop)
        .map_err(|error| request(py, &error.to_string()))
}
