//! The rows of a machine as batches of Arrow, one after the other: as Spark, Dask and data frames hand them over.

use std::path::Path;

use arrow_array::RecordBatch;
use arrow_schema::{ArrowError, SchemaRef};
use athermal_files::{FileError, Options, Reader, layout};
use athermal_run::fit::{FitOptions, FitProgress};
use athermal_run::model::Model;

use crate::machine::{MachineError, MachineFit, fit_machine};
use crate::once::Once;

/// Reads batches of a schema as the rows of a graph; `name` stands for them in messages.
///
/// # Errors
/// When a column of the graph is not among them, or cannot be what the graph says.
pub fn rows_of(
    graph: &Model,
    name: &str,
    schema: SchemaRef,
    batches: impl Iterator<Item = Result<RecordBatch, ArrowError>> + Send + 'static,
) -> Result<Reader, FileError> {
    let options = Options {
        joins: true,
        ..Options::default()
    };
    let file = athermal_arrow::batches(schema, Box::new(batches));
    Reader::from_typed(Path::new(name), file, layout(&graph.plan), options)
}

/// [`fit_machine`] on batches that come once. Those that the fit has seen are let go; where it reads them again, they come from what
/// was kept of them: in memory up to [`FitOptions::memory`], beyond that in a file without a name.
///
/// # Errors
/// As of [`fit_machine`].
pub fn fit_batches(
    graph: &Model,
    name: &str,
    schema: SchemaRef,
    batches: impl Iterator<Item = Result<RecordBatch, ArrowError>> + Send + 'static,
    options: &FitOptions,
    created: Option<String>,
    progress: &mut (dyn FnMut(FitProgress<'_>) + Send),
) -> Result<MachineFit, MachineError> {
    let rows = rows_of(graph, name, schema, batches);
    let rows = rows
        .map_err(|error| MachineError::Fit(athermal_run::fit::FitError::Recording(error.into())))?;
    let once = Once::new(Box::new(rows), options.memory);
    fit_machine(graph, &once, options, created, progress)
}
