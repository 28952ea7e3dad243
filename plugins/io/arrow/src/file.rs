//! Files as batches of columns: Parquet, Arrow, and its stream. Not what a column means.

use std::fmt::Display;
use std::fs::File;
use std::path::{Component, Path};

use arrow_array::{Array, ArrayRef, RecordBatch};
use arrow_ipc::reader::{FileReader, StreamReader};
use arrow_schema::{ArrowError, SchemaRef};
use athermal_files::{Selection, TypedFile, TypedRows, Within};
use parquet::arrow::ProjectionMask;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use parquet::arrow::arrow_reader::statistics::StatisticsConverter;

use crate::column::{self, Instants};
use crate::rows::{Column, PassedOver, Rows, Wanted};

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
    read: Box<Read>,
}

/// Reads some columns. Rows outside of a stretch of time may be passed over.
type Read = dyn FnOnce(&[usize], Option<OfTime>) -> Result<Begun, String> + Send;

/// The column of the time, and the stretch that is asked for.
type OfTime = (usize, Within);

/// What is read.
struct Begun {
    batches: Batches,
    /// Where in a batch each of the file's columns stands.
    places: Vec<usize>,
    passed_over: PassedOver,
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
        let within = match &wanted.time[..] {
            [time] if *time < fields => wanted.within.map(|within| (*time, within)),
            _ => None,
        };
        let begun = (self.read)(&read, within)?;
        let places = begun.places;
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
        Ok(Box::new(Rows::new(
            begun.batches,
            wanted,
            begun.passed_over,
        )?))
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

/// All rows of some batches.
fn all(batches: Batches, places: Vec<usize>) -> Begun {
    Begun {
        batches,
        places,
        passed_over: PassedOver::default(),
    }
}

/// Batches of this schema that come from elsewhere, as the columns of a file that is read once
/// ([`athermal_files::Reader::from_typed`]).
#[must_use]
pub fn batches(schema: SchemaRef, batches: Batches) -> Box<dyn TypedFile> {
    let places = (0..schema.fields().len()).collect();
    Box::new(Batched {
        schema,
        keys: Vec::new(),
        read: Box::new(move |_, _| Ok(all(batches, places))),
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
        read: Box::new(move |columns, within| {
            let mask = ProjectionMask::roots(builder.parquet_schema(), columns.iter().copied());
            let groups = within.and_then(|within| groups_within(&builder, within));
            let (builder, passed_over) = match groups {
                Some(groups) => {
                    let rows = builder.metadata().row_groups().iter();
                    let rows = rows.map(|group| group.num_rows().unsigned_abs());
                    let passed_over = PassedOver::of(rows, &groups);
                    (builder.with_row_groups(groups), passed_over)
                }
                None => (builder, PassedOver::default()),
            };
            let reader = builder.with_projection(mask).with_batch_size(BATCH).build();
            Ok(Begun {
                batches: Box::new(reader.map_err(words)?),
                places: columns.to_vec(),
                passed_over,
            })
        }),
    }))
}

/// The row groups that may have rows of a stretch of time, by what the file says of their lowest and highest times; none where it
/// says nothing, or the column has neither instants nor numbers.
fn groups_within(
    builder: &ParquetRecordBatchReaderBuilder<File>,
    (time, within): OfTime,
) -> Option<Vec<usize>> {
    let (schema, groups) = (builder.schema(), builder.metadata().row_groups());
    let name = schema.field(time).name();
    let of = StatisticsConverter::try_new(name, schema, builder.parquet_schema()).ok()?;
    let lowest = ends(&of.row_group_mins(groups).ok()?, within.unit)?;
    let highest = ends(&of.row_group_maxes(groups).ok()?, within.unit)?;
    let (from, to) = within.ends;
    let may_be = |group: &usize| {
        lowest[*group].is_none_or(|(first, _)| first <= to)
            && highest[*group].is_none_or(|(_, last)| last >= from)
    };
    Some((0..groups.len()).filter(may_be).collect())
}

/// Between which two instants in ns each time of a column is at any rate; none where there is no time, or one that is not known.
fn ends(times: &ArrayRef, unit: Option<(i64, i128)>) -> Option<Vec<Option<(i64, i64)>>> {
    // A clock of which is not said where it stands is so much off at most.
    const ANYWHERE_NS: i64 = 86_400_000_000_000;
    // Numbers are rounded to doubles here; Julian days are off by some microseconds.
    const ROUNDED_NS: f64 = 1e6;
    if let Some(instants) = Instants::of(times) {
        let margin = if instants.is_utc { 0 } else { ANYWHERE_NS };
        let end = |at: i64| (at.saturating_sub(margin), at.saturating_add(margin));
        return Some(
            (0..times.len())
                .map(|row| instants.at(row).map(end))
                .collect(),
        );
    }
    let (ns, origin_ns) = unit.filter(|_| times.data_type().is_numeric())?;
    let mut all = vec![None; times.len()];
    let mut put = |row: usize, number: f64| {
        let at = number * ns as f64 - origin_ns as f64;
        let end = ((at - ROUNDED_NS) as i64, (at + ROUNDED_NS) as i64);
        all[row] = (!number.is_nan()).then_some(end);
    };
    column::numbers(times, &mut put, &mut |_, _| {});
    Some(all)
}

pub(crate) fn arrow(path: &Path) -> Result<Box<dyn TypedFile>, String> {
    let file = opened(path)?;
    let again = file.try_clone().map_err(words)?;
    let reader = FileReader::try_new_buffered(again, None).map_err(words)?;
    let schema = reader.schema();
    Ok(Box::new(Batched {
        keys: keys(path, &schema),
        schema,
        read: Box::new(move |columns, _| {
            let reader = FileReader::try_new_buffered(file, Some(columns.to_vec()));
            Ok(all(Box::new(reader.map_err(words)?), columns.to_vec()))
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
        read: Box::new(move |_, _| Ok(all(Box::new(reader), places))),
    }))
}
