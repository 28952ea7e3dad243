//! The rules that every node keeps, tried on nodes that are written in Python.

use athermal::core::node::inline_toml;
use athermal_testkit::{Broken, Case, Rule, broken};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::failure::guarded;
use crate::json::read;
use crate::nodes::{PythonEstimator, PythonFeature};

/// What a node is tried with.
#[derive(FromPyObject)]
pub struct Tried {
    /// What stands in the table of the node, as JSON.
    table: String,
    /// Of ports, how many channels of which unit come there, and between which values they are.
    inputs: Vec<(String, usize, String, Option<(f64, f64)>)>,
    ticks: usize,
    every: String,
}

fn case(of: Tried) -> PyResult<Case> {
    let table = read(&of.table)?;
    let entries = table.as_object().into_iter().flatten();
    let lines = entries.map(|(key, value)| format!("{key} = {}\n", inline_toml(value)));
    let mut case = Case::new(lines.collect::<String>())
        .ticks(of.ticks)
        .every(&of.every)
        .except(Rule::Allocation, "each value is an object of Python");
    for (port, channels, unit, between) in of.inputs {
        case = case.input(&port, channels, &unit);
        if let Some((low, high)) = between {
            case = case.between(&port, low, high);
        }
    }
    Ok(case)
}

/// The rules that a node breaks in any of the cases, in words.
#[pyfunction]
pub fn broken_rules(py: Python<'_>, role: &str, cases: Vec<Tried>) -> PyResult<Vec<String>> {
    let cases = guarded(py, || {
        cases.into_iter().map(case).collect::<PyResult<Vec<_>>>()
    })??;
    let tried: fn(&[Case]) -> Vec<Broken> = match role {
        "feature" => broken::<PythonFeature>,
        "estimator" => broken::<PythonEstimator>,
        other => return Err(PyValueError::new_err(format!("there is no role `{other}`"))),
    };
    let broken = py.detach(|| tried(&cases));
    Ok(broken.iter().map(ToString::to_string).collect())
}
