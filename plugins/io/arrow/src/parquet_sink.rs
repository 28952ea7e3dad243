//! Rows written as Parquet.

use std::fs::File;
use std::io;
use std::sync::Arc;

use arrow_array::{ArrayRef, Float64Array, RecordBatch, StringArray, TimestampNanosecondArray};
use arrow_schema::{DataType, Field, Schema, TimeUnit};
use athermal_files::{DATED_NS, TypedSink};
use parquet::arrow::ArrowWriter;
use parquet::basic::Compression;
use parquet::file::properties::WriterProperties;

/// So many rows are handed on at a time, and so many are a group that can be read by itself.
const BATCH: usize = 4096;
const GROUP: usize = 32 * BATCH;

/// A file of Parquet that is being written: a column of the time, of 64-bit floats, and of texts where the last column is one. What
/// is dated has instants of UTC; other times are seconds.
struct ParquetRows {
    output: Option<File>,
    names: Vec<String>,
    times: Vec<i64>,
    values: Vec<Vec<f64>>,
    labels: Vec<String>,
    /// Known from the first row on.
    has_labels: bool,
    is_dated: bool,
    writer: Option<ArrowWriter<File>>,
}

/// Begins a file.
pub(crate) fn create(output: File, time_column: &str, columns: &[String]) -> Box<dyn TypedSink> {
    let time = [time_column.to_owned()];
    Box::new(ParquetRows {
        output: Some(output),
        names: [&time, columns].concat(),
        times: Vec::with_capacity(BATCH),
        values: vec![Vec::with_capacity(BATCH); columns.len()],
        labels: Vec::new(),
        has_labels: false,
        is_dated: false,
        writer: None,
    })
}

impl ParquetRows {
    fn writer(&mut self) -> io::Result<Option<&mut ArrowWriter<File>>> {
        if let Some(output) = self.output.take() {
            let properties = WriterProperties::builder()
                .set_compression(Compression::SNAPPY)
                .set_dictionary_enabled(false)
                .set_max_row_group_row_count(Some(GROUP))
                .build();
            let schema = Arc::new(self.schema());
            let writer = ArrowWriter::try_new(output, schema, Some(properties))?;
            self.writer = Some(writer);
        }
        Ok(self.writer.as_mut())
    }

    fn schema(&self) -> Schema {
        let last = self.names.len() - 1;
        let names = self.names.iter().enumerate();
        let fields = names.map(|(at, name)| match at {
            0 if self.is_dated => {
                let utc = DataType::Timestamp(TimeUnit::Nanosecond, Some("UTC".into()));
                Field::new(name, utc, false)
            }
            0 => Field::new(name, DataType::Float64, false),
            at if at == last && self.has_labels => Field::new(name, DataType::Utf8, false),
            _ => Field::new(name, DataType::Float64, true),
        });
        Schema::new(fields.collect::<Vec<_>>())
    }

    /// Hands on what is held back.
    fn hand_on(&mut self) -> io::Result<()> {
        let times = std::mem::replace(&mut self.times, Vec::with_capacity(BATCH));
        let time: ArrayRef = match self.is_dated {
            true => Arc::new(TimestampNanosecondArray::from(times).with_timezone("UTC")),
            false => {
                let seconds = times.iter().map(|ns| *ns as f64 / 1e9);
                Arc::new(Float64Array::from_iter_values(seconds))
            }
        };
        let mut arrays = vec![time];
        let columns = self.values.len() - usize::from(self.has_labels);
        for values in &mut self.values[..columns] {
            let cells = values
                .drain(..)
                .map(|value| (!value.is_nan()).then_some(value));
            arrays.push(Arc::new(cells.collect::<Float64Array>()));
        }
        if self.has_labels {
            let labels = std::mem::take(&mut self.labels);
            arrays.push(Arc::new(StringArray::from(labels)));
        }
        let schema = Arc::new(self.schema());
        let batch = RecordBatch::try_new(schema, arrays).map_err(io::Error::other)?;
        match self.writer()? {
            Some(writer) => Ok(writer.write(&batch)?),
            None => Ok(()),
        }
    }
}

impl TypedSink for ParquetRows {
    fn write(&mut self, time_ns: i64, values: &[f64], label: Option<&str>) -> io::Result<()> {
        if self.output.is_some() && self.times.is_empty() {
            self.is_dated = time_ns >= DATED_NS;
            self.has_labels = label.is_some();
        }
        self.times.push(time_ns);
        for (column, value) in self.values.iter_mut().zip(values) {
            column.push(*value);
        }
        self.labels.extend(label.map(str::to_owned));
        match self.times.len() >= BATCH {
            true => self.hand_on(),
            false => Ok(()),
        }
    }

    fn finish(&mut self) -> io::Result<()> {
        if self.output.is_none() && self.writer.is_none() {
            return Ok(());
        }
        self.hand_on()?;
        match self.writer.take() {
            Some(writer) => Ok(writer.close().map(|_| ())?),
            None => Ok(()),
        }
    }
}

impl Drop for ParquetRows {
    fn drop(&mut self) {
        // Whoever wants to know of a failure has ended it before.
        let _ = self.finish();
    }
}
