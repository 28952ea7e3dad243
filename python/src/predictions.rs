//! What a model puts out at each row, as a table.

use std::sync::Arc;

use arrow_array::{ArrayRef, Float64Array};
use arrow_schema::{ArrowError, DataType};
use athermal::core::watch::Progress;
use athermal::run::live::{Frame, Sink, SinkError};

use crate::stamps::Stamps;
use crate::table::Table;

/// So many rows are put out between two looks at how far it is.
const BETWEEN_LOOKS: u64 = 256;

/// Takes what a model puts out.
pub struct Predictions {
    rows: u64,
    progress: Option<Box<dyn Progress>>,
    time: String,
    stamps: Stamps,
    names: Vec<String>,
    outputs: Vec<Vec<f64>>,
}

impl Predictions {
    /// None yet; of these outputs, with the times in a column of this name and like one of this type.
    pub fn new(time: String, like: Option<&DataType>, names: Vec<String>) -> Self {
        Self {
            rows: 0,
            progress: None,
            time,
            stamps: Stamps::like(like),
            outputs: vec![Vec::new(); names.len()],
            names,
        }
    }

    /// The same, which says how many rows it has.
    pub fn followed(mut self, progress: Box<dyn Progress>) -> Self {
        self.progress = Some(progress);
        self
    }

    /// The table: the times, then the outputs, null where there is none.
    pub fn table(self) -> Result<Table, ArrowError> {
        let outputs = self.outputs.into_iter().map(|values| -> ArrayRef {
            let values = values.into_iter();
            let values = values.map(|value| (!value.is_nan()).then_some(value));
            Arc::new(values.collect::<Float64Array>())
        });
        let times = std::iter::once((self.time, self.stamps.finish()));
        Table::of(times.chain(self.names.into_iter().zip(outputs)).collect())
    }
}

impl Sink for Predictions {
    fn put(&mut self, frame: &Frame<'_>) -> Result<(), SinkError> {
        self.rows += 1;
        if let Some(progress) = &mut self.progress
            && self.rows.is_multiple_of(BETWEEN_LOOKS)
        {
            progress.set(self.rows);
        }
        self.stamps.push(frame.time_text, frame.time);
        for (values, value) in self.outputs.iter_mut().zip(frame.outputs) {
            values.push(*value);
        }
        Ok(())
    }
}
