//! Batches in memory as a table that is read by a name, as often as needed and without a copy. Not what a column means.

use std::sync::Arc;

use arrow_array::RecordBatch;
use arrow_schema::{ArrowError, SchemaRef};
use athermal_files::OpenTable;

use crate::file::{BATCH, Batched};

/// Batches of one schema as a table for [`athermal_files::with_tables`]. Before each few thousand rows `go_on` is asked whether to go
/// on; its error ends the reading.
#[must_use]
pub fn table(
    schema: SchemaRef,
    batches: Arc<[RecordBatch]>,
    go_on: Arc<dyn Fn() -> Result<(), String> + Send + Sync>,
) -> OpenTable {
    Arc::new(move || {
        let (batches, go_on) = (Arc::clone(&batches), Arc::clone(&go_on));
        Ok(Box::new(Batched {
            schema: Arc::clone(&schema),
            keys: Vec::new(),
            read: Box::new(move |columns| {
                let columns = columns.to_vec();
                let slices = Slices {
                    batches,
                    columns: columns.clone(),
                    batch: 0,
                    row: 0,
                };
                let slices = slices.map(move |slice| {
                    go_on().map_err(|reason| ArrowError::ExternalError(reason.into()))?;
                    slice
                });
                Ok((Box::new(slices), columns))
            }),
        }))
    })
}

/// Some columns of batches, a few rows at a time: what a reader decodes at once stays small, however large a batch is.
struct Slices {
    batches: Arc<[RecordBatch]>,
    columns: Vec<usize>,
    batch: usize,
    row: usize,
}

impl Iterator for Slices {
    type Item = Result<RecordBatch, ArrowError>;

    fn next(&mut self) -> Option<Self::Item> {
        let mut batch = self.batches.get(self.batch)?;
        while self.row >= batch.num_rows() {
            (self.batch, self.row) = (self.batch + 1, 0);
            batch = self.batches.get(self.batch)?;
        }
        let length = BATCH.min(batch.num_rows() - self.row);
        let slice = batch.slice(self.row, length);
        self.row += length;
        Some(slice.project(&self.columns))
    }
}
