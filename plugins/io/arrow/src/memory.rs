//! Batches in memory as a table that is read by a name, as often as needed and without a copy. Not what a column means.

use std::sync::Arc;

use arrow_array::RecordBatch;
use arrow_schema::{ArrowError, SchemaRef};
use athermal_files::OpenTable;

use crate::file::{BATCH, batches};

/// Batches of one schema as a table of [`athermal_files::Tables`]. Before each few thousand rows `go_on` is asked whether to go
/// on; its error ends the reading.
#[must_use]
pub fn table(
    schema: SchemaRef,
    all: Arc<[RecordBatch]>,
    go_on: Arc<dyn Fn() -> Result<(), String> + Send + Sync>,
) -> OpenTable {
    Arc::new(move || {
        let go_on = Arc::clone(&go_on);
        let slices = Slices {
            batches: Arc::clone(&all),
            batch: 0,
            row: 0,
        };
        let slices = slices.map(move |slice| match go_on() {
            Ok(()) => Ok(slice),
            Err(reason) => Err(ArrowError::ExternalError(reason.into())),
        });
        Ok(batches(Arc::clone(&schema), Box::new(slices)))
    })
}

/// Batches a few rows at a time: what a reader decodes at once stays small, however large a batch is.
struct Slices {
    batches: Arc<[RecordBatch]>,
    batch: usize,
    row: usize,
}

impl Iterator for Slices {
    type Item = RecordBatch;

    fn next(&mut self) -> Option<RecordBatch> {
        let mut batch = self.batches.get(self.batch)?;
        while self.row >= batch.num_rows() {
            (self.batch, self.row) = (self.batch + 1, 0);
            batch = self.batches.get(self.batch)?;
        }
        let length = BATCH.min(batch.num_rows() - self.row);
        let slice = batch.slice(self.row, length);
        self.row += length;
        Some(slice)
    }
}
