//! The native part of the Python package: graphs, models and engines as Python objects. What users see stands in `athermal/*.py`.

mod conformance;
mod engine;
mod failure;
mod fleet;
mod graph;
mod json;
mod model;
mod nodes;
mod predictions;
mod simulated;
mod stamps;
mod table;
mod work;

use std::ffi::OsString;

use athermal_fleet::pool::started_by;
use pyo3::prelude::*;

use engine::Engine;
use graph::Graph;
use model::Model;
use table::Table;

/// Runs the command line with these words, of which the first is the name of the program; gives the exit status. `itself` is how the
/// program is started.
#[pyfunction]
fn main(py: Python<'_>, words: Vec<OsString>, itself: Vec<OsString>) -> u8 {
    started_by(itself);
    py.detach(|| athermal::command_line_of(words))
}

/// The options of every job as JSON Schema, by its name, as JSON.
#[pyfunction]
fn options() -> String {
    let schemas = athermal::jobs::asked::schemas().into_iter();
    let all = schemas.map(|(job, schema)| (job.to_owned(), schema));
    serde_json::Value::Object(all.collect()).to_string()
}

/// Functions and classes; `athermal` wraps each.
#[pymodule]
fn _athermal(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<Table>()?;
    module.add_class::<Graph>()?;
    module.add_class::<Model>()?;
    module.add_class::<Engine>()?;
    module.add_function(wrap_pyfunction!(main, module)?)?;
    module.add_function(wrap_pyfunction!(options, module)?)?;
    module.add_function(wrap_pyfunction!(conformance::broken_rules, module)?)?;
    module.add_function(wrap_pyfunction!(fleet::check_columns, module)?)?;
    module.add_function(wrap_pyfunction!(fleet::fit_machine, module)?)?;
    module.add_function(wrap_pyfunction!(graph::init, module)?)?;
    module.add_function(wrap_pyfunction!(model::compare, module)?)?;
    module.add_function(wrap_pyfunction!(simulated::simulate, module)?)?;
    Ok(())
}
