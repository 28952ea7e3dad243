//! Rows of batches, one after the other, as a reader of recordings takes them.

use std::panic::{AssertUnwindSafe, catch_unwind};

use arrow_array::{ArrayRef, RecordBatch};
use arrow_schema::DataType;
use athermal_core::diagnostic::panic_text;
use athermal_files::{TypedRows, TypedTime, number};

use crate::column::{self, Instants};
use crate::file::Batches;
use crate::stamp::Stamp;

/// A column that is read.
pub(crate) enum Column {
    /// One of the batches.
    At {
        /// Its place in a batch.
        place: usize,
        /// Its name, for messages.
        name: String,
        /// Its type.
        data_type: DataType,
    },
    /// The same text in every row.
    Constant(String),
}

/// The columns that are read, and as what.
pub(crate) struct Wanted {
    /// The columns of the time.
    pub time: Vec<Column>,
    /// Those of numbers; none where there is no such column.
    pub values: Vec<Option<Column>>,
    /// Those of texts; the same.
    pub texts: Vec<Option<Column>>,
}

/// Rows of a file that are not read: behind so many that are, so many are passed over.
#[derive(Debug, Default)]
pub(crate) struct PassedOver(Vec<(u64, u64)>);

impl PassedOver {
    /// Those of groups of so many rows of which these alone are read.
    pub fn of(rows: impl Iterator<Item = u64>, read: &[usize]) -> Self {
        let (mut all, mut before) = (Vec::new(), 0);
        for (group, rows) in rows.enumerate() {
            match read.contains(&group) {
                true => before += rows,
                false => all.push((before, rows)),
            }
        }
        Self(all)
    }
}

/// A column of the time in a batch.
enum Time {
    At(Instants),
    Text,
}

/// The rows of a file.
pub(crate) struct Rows {
    batches: Batches,
    wanted: Wanted,
    /// How many rows the batch has, and which is the next.
    length: usize,
    next: usize,
    /// The numbers of the batch, row after row.
    numbers: Vec<f64>,
    /// The texts of the batch that are no numbers, in the order of rows, and the rows that they are of.
    no_numbers: Vec<(usize, String)>,
    no_number_rows: Vec<usize>,
    times: Vec<Time>,
    batch: Option<RecordBatch>,
    /// The cells of the current row that are texts: those of the time, then the others.
    cells: Vec<Vec<u8>>,
    /// Of a recording that has instants that of the current row, as a text.
    stamp: Stamp,
    /// The same of cells beside the time.
    cell_stamp: Stamp,
    passed_over: PassedOver,
}

impl Rows {
    pub fn new(batches: Batches, wanted: Wanted, passed_over: PassedOver) -> Result<Self, String> {
        for column in wanted.values.iter().flatten() {
            match column {
                Column::At {
                    name, data_type, ..
                } => column::check_numbers(name, data_type)?,
                Column::Constant(text) if number(text.as_bytes()).is_none() => {
                    return Err(format!("the folder says `{text}`, which is no number"));
                }
                Column::Constant(_) => {}
            }
        }
        let cells = wanted.time.len() + wanted.texts.len();
        Ok(Self {
            batches,
            wanted,
            length: 0,
            next: 0,
            numbers: Vec::new(),
            no_numbers: Vec::new(),
            no_number_rows: Vec::new(),
            times: Vec::new(),
            batch: None,
            cells: vec![Vec::new(); cells],
            stamp: Stamp::default(),
            cell_stamp: Stamp::default(),
            passed_over,
        })
    }

    /// Takes the next batch that has rows; false where there is none.
    fn take_batch(&mut self) -> Result<bool, String> {
        let batch = loop {
            // A damaged file makes the reader panic here and there.
            let next = catch_unwind(AssertUnwindSafe(|| self.batches.next()));
            match next.map_err(|panic| format!("it is damaged: {}", panic_text(&*panic)))? {
                None => return Ok(false),
                Some(batch) => {
                    let batch = batch.map_err(|error| error.to_string())?;
                    if batch.num_rows() > 0 {
                        break batch;
                    }
                }
            }
        };
        (self.length, self.next) = (batch.num_rows(), 0);
        let width = self.wanted.values.len();
        self.numbers.clear();
        self.numbers.resize(self.length * width, f64::NAN);
        self.no_numbers.clear();
        self.no_number_rows.clear();
        let mut strange = Vec::new();
        for (index, column) in self.wanted.values.iter().enumerate() {
            match column {
                None => {}
                Some(Column::Constant(text)) => {
                    let value = number(text.as_bytes()).unwrap_or(f64::NAN);
                    let cells = self.numbers[index..].iter_mut().step_by(width);
                    cells.for_each(|cell| *cell = value);
                }
                Some(Column::At { place, .. }) => {
                    let mut put =
                        |row: usize, value: f64| self.numbers[row * width + index] = value;
                    let mut refuse = |row: usize, text: String| strange.push((row, (index, text)));
                    column::numbers(batch.column(*place), &mut put, &mut refuse);
                }
            }
        }
        strange.sort_by_key(|(row, _)| *row);
        (self.no_number_rows, self.no_numbers) = strange.into_iter().unzip();
        // The cells of several columns are put together as texts.
        self.times = match &*self.wanted.time {
            [column] => vec![time_of(column, &batch)],
            several => several.iter().map(|_| Time::Text).collect(),
        };
        self.batch = Some(batch);
        Ok(true)
    }

    /// Writes the cells of the current row that are texts.
    fn write_cells(&mut self, row: usize) {
        // A time that is an instant has its own text.
        let times = self.wanted.time.iter().zip(&self.times);
        let times = times.map(|(column, of)| matches!(of, Time::Text).then_some(column));
        let all = times.chain(self.wanted.texts.iter().map(Option::as_ref));
        for (cell, column) in self.cells.iter_mut().zip(all) {
            cell.clear();
            match (column, &self.batch) {
                (Some(Column::Constant(text)), _) => cell.extend_from_slice(text.as_bytes()),
                (Some(Column::At { place, .. }), Some(batch)) => {
                    column::write(batch.column(*place), row, &mut self.cell_stamp, cell);
                }
                _ => {}
            }
        }
    }
}

fn time_of(column: &Column, batch: &RecordBatch) -> Time {
    let instants = match column {
        Column::At { place, .. } => Instants::of(batch.column(*place) as &ArrayRef),
        Column::Constant(_) => None,
    };
    instants.map_or(Time::Text, Time::At)
}

impl TypedRows for Rows {
    fn advance(&mut self) -> Result<bool, String> {
        if self.next >= self.length && !self.take_batch()? {
            return Ok(false);
        }
        self.next += 1;
        self.write_cells(self.next - 1);
        if let [Time::At(instants)] = &*self.times
            && let Some(ns) = instants.at(self.next - 1)
        {
            self.stamp.write(ns, instants.is_utc);
        }
        Ok(true)
    }

    fn time(&self, index: usize) -> TypedTime<'_> {
        let row = self.next.saturating_sub(1);
        match self.times.get(index) {
            Some(Time::At(instants)) => match instants.at(row) {
                Some(ns) => TypedTime::At {
                    ns,
                    is_utc: instants.is_utc,
                    text: self.stamp.text(),
                },
                None => TypedTime::Text(&[]),
            },
            _ => TypedTime::Text(self.cells.get(index).map_or(&[], Vec::as_slice)),
        }
    }

    fn values(&self) -> &[f64] {
        let width = self.wanted.values.len();
        let row = self.next.saturating_sub(1);
        self.numbers
            .get(row * width..(row + 1) * width)
            .unwrap_or(&[])
    }

    fn no_numbers(&self) -> &[(usize, String)] {
        if self.no_numbers.is_empty() {
            return &[];
        }
        let row = self.next.saturating_sub(1);
        let from = self.no_number_rows.partition_point(|of| *of < row);
        let to = self.no_number_rows.partition_point(|of| *of <= row);
        &self.no_numbers[from..to]
    }

    fn text(&self, index: usize) -> &[u8] {
        let cell = self.cells.get(self.wanted.time.len() + index);
        cell.map_or(&[], Vec::as_slice)
    }

    fn passed_over(&self, nth: u64) -> u64 {
        let all = self.passed_over.0.iter();
        let before = all.take_while(|(read, _)| *read < nth);
        before.map(|(_, rows)| rows).sum()
    }
}
