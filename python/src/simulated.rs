//! The recording of a simulated machine, as a table.

use std::sync::Arc;

use arrow_array::{ArrayRef, Float64Array};
use athermal::jobs::simulate::Simulate;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::table::Table;
use crate::work::{Call, work};

/// Simulates a machine, with the options of `athermal simulate`.
#[pyfunction]
pub fn simulate(py: Python<'_>, call: Call) -> PyResult<Table> {
    let mut columns: Vec<Vec<f64>> = Vec::new();
    let (names, columns) = work(py, &call, move |job: &Simulate, host| {
        let mut put = |time_ns: i64, values: &[f64]| {
            columns.resize(values.len() + 1, Vec::new());
            for (column, value) in columns
                .iter_mut()
                .zip(std::iter::once(time_ns as f64 / 1e9).chain(values.iter().copied()))
            {
                column.push(value);
            }
            Ok(())
        };
        let machine = job.machine()?;
        job.rows(&*machine, host, &mut put)?;
        Ok((job.columns(&*machine), columns))
    })?;
    let names = std::iter::once("time_s".to_owned()).chain(names);
    let columns = columns.into_iter().map(|values| -> ArrayRef {
        let has_gaps = values.iter().any(|value| value.is_nan());
        match has_gaps {
            false => Arc::new(Float64Array::from(values)),
            true => {
                let values = values.into_iter();
                let values = values.map(|value| (!value.is_nan()).then_some(value));
                Arc::new(values.collect::<Float64Array>())
            }
        }
    });
    Table::of(names.zip(columns).collect())
        .map_err(|error| PyValueError::new_err(error.to_string()))
}
