//! Files as batches of columns: Parquet, Arrow, and its stream. Not what a column means.

use std::fmt::Display;
use std::fs::File;
use std::path::{Component, Path};

use arrow_array::RecordBatch;
use arrow_ipc::reader::{FileReader, StreamReader};
use arrow_schema::{ArrowError, SchemaRef};
use athermal_files::{Selection, TypedFile, TypedRows};
use parquet::arrow::ProjectionMask;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;

use crate::rows::{Column, Rows, Wanted};

/// So many rows are decoded at a time: the numbers of a wide table then stay in the second cache.
pub(crate) const BATCH: usize = 2048;

/// Batches, one after the other.
pub type Batches = Box<dyn Iterator<Item = Result<RecordBatch, ArrowError>> + Send>;

/// A file whose batches have a schema.
struct Batched {
    schema: SchemaRef,
    /// What the folders on its path say.
    keys: Vec<(String, String)>,
    /// Its batches, of these columns at least, and where among theirs each of the file's stands.
    #[allow(clippy::type_complexity)] // it is this once
    read: Box<dyn FnOnce(&[usize]) -> Result<(Batches, Vec<usize>), String> + Send>,
}

impl TypedFile for Batched {
    fn names(&self) -> Vec<String> {
        let fields = self.schema.fields().iter();
        let fields = fields.map(|field| field.name().clone());
        let keys = self.keys.iter().map(|(key, _)| key.clone());
        fields.chain(keys).collect()
    }

    fn select(self: Box<Self>, wanted: Selection) -> Result<Box<dyn TypedRows>, String> {
        let fields = self.schema.fields().len();
        let values = wanted.values.iter().flatten();
        let texts = wanted.texts.iter().flatten();
        let all = wanted.time.iter().chain(values).chain(texts).copied();
        let mut read: Vec<usize> = all.filter(|place| *place < fields).collect();
        read.sort_unstable();
        read.dedup();
        let (batches, places) = (self.read)(&read)?;
        let column = |place: usize| match place.checked_sub(fields) {
            Some(key) => Column::Constant(self.keys[key].1.clone()),
            None => Column::At {
                place: places.iter().position(|of| *of == place).unwrap_or(0),
                name: self.schema.field(place).name().clone(),
                data_type: self.schema.field(place).data_type().clone(),
            },
        };
        let some = |places: &[Option<usize>]| {
            let columns = places.iter().map(|place| place.map(column));
            columns.collect::<Vec<_>>()
        };
        let wanted = Wanted {
            time: wanted.time.iter().map(|place| column(*place)).collect(),
            values: some(&wanted.values),
            texts: some(&wanted.texts),
        };
        Ok(Box::new(Rows::new(batches, wanted)?))
    }
}

/// What `key=value` in the folders of a path says, of keys that are no columns.
fn keys(path: &Path, schema: &SchemaRef) -> Vec<(String, String)> {
    let folders = path.parent().into_iter().flat_map(Path::components);
    let names = folders.filter_map(|of| match of {
        Component::Normal(name) => name.to_str()?.split_once('='),
        _ => None,
    });
    let keys = names.filter(|(key, _)| !key.is_empty() && schema.index_of(key).is_err());
    keys.map(|(key, value)| (key.to_owned(), value.to_owned()))
        .collect()
}

fn words(error: impl Display) -> String {
    error.to_string()
}

fn opened(path: &Path) -> Result<File, String> {
    File::open(path).map_err(words)
}

/// Batches of this schema that come from elsewhere, as the columns of a file that is read once
/// ([`athermal_files::Reader::from_typed`]).
#[must_use]
pub fn batches(schema: SchemaRef, batches: Batches) -> Box<dyn TypedFile> {
    let places = (0..schema.fields().len()).collect();
    Box::new(Batched {
        schema,
        keys: Vec::new(),
        read: Box::new(move |_| Ok((batches, places))),
    })
}

pub(crate) fn parquet(path: &Path) -> Result<Box<dyn TypedFile>, String> {
    let builder = ParquetRecordBatchReaderBuilder::try_new(opened(path)?);
    let builder = builder.map_err(|error| {
        format!("{error}; a file of Parquet that was not ended, as when its writer was killed, cannot be read")
    })?;
    let schema = builder.schema().clone();
    Ok(Box::new(Batched {
        keys: keys(path, &schema),
        schema,
        read: Box::new(move |columns| {
            let mask = ProjectionMask::roots(builder.parquet_schema(), columns.iter().copied());
            let reader = builder.with_projection(mask).with_batch_size(BATCH).build();
            let batches: Batches = Box::new(reader.map_err(words)?);
            Ok((batches, columns.to_vec()))
        }),
    }))
}

pub(crate) fn arrow(path: &Path) -> Result<Box<dyn TypedFile>, String> {
    let file = opened(path)?;
    let again = file.try_clone().map_err(words)?;
    let reader = FileReader::try_new_buffered(again, None).map_err(words)?;
    let schema = reader.schema();
    Ok(Box::new(Batched {
        keys: keys(path, &schema),
        schema,
        read: Box::new(move |columns| {
            let reader = FileReader::try_new_buffered(file, Some(columns.to_vec()));
            let batches: Batches = Box::new(reader.map_err(words)?);
            Ok((batches, columns.to_vec()))
        }),
    }))
}

pub(crate) fn arrow_stream(path: &Path) -> Result<Box<dyn TypedFile>, String> {
    let reader = StreamReader::try_new_buffered(opened(path)?, None).map_err(words)?;
    let schema = reader.schema();
    let places = (0..schema.fields().len()).collect();
    Ok(Box::new(Batched {
        keys: keys(path, &schema),
        schema,
        read: Box::new(move |_| Ok((Box::new(reader), places))),
    }))
}
