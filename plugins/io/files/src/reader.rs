//! Rows of a recording in either format: instants that advance, values or absence. Not how the bytes are cut into cells.

mod commas;
mod reading;

use std::io::Read;
use std::path::{Path, PathBuf};

use athermal_core::document::{Arrangement, TableFormat};
use athermal_core::time::Instant;

use crate::csv_rows::CsvRows;
use crate::joined::Lookahead;
use crate::json_rows::JsonRows;
use crate::ledger::Ledger;
use crate::lines::Lines;
use crate::long::Long;
use crate::machines::Machines;
use crate::recording::offset_of;
use crate::typed::{self, TypedCells, TypedFile};
use crate::{ChannelColumn, Event, FileError, Format, Layout, Report, Stretch, Tables, TimeColumn};
use commas::Commas;
use reading::Reading;

/// How a recording is to be read.
#[derive(Debug, Clone, Default)]
pub struct Options {
    /// The format; by default what the name of the file says, else its first byte.
    pub format: Option<Format>,
    /// Take a cell that cannot be read as absent and leave a broken row out, counted, instead of stopping with an error.
    pub lenient: bool,
    /// Put rows of one time together, where no two have different values of a channel. A row then waits for the time of the next
    /// one: for what was recorded, not for what is still being written.
    pub joins: bool,
    /// What is read goes on later, and is read again then: leave out at its end what only more of it would confirm. That is a last
    /// line without an end, even if it lacks nothing, since its last number may lack digits, and a second row that leaps.
    pub goes_on: bool,
    /// Of several files each is a segment of its own, also where its times go on from those of the one before.
    pub segments: bool,
    /// Files of different columns count their times from one instant, so that they can be merged where these are no dates.
    pub merge: bool,
    /// What is added to the times of files, in ns.
    pub offsets: Vec<(PathBuf, i64)>,
    /// The first and last instant that is asked for, in ns: what can pass rows outside over without reading them does so.
    pub within: Option<(i64, i64)>,
    /// The rows that are taken, by their times with what is added to them: others are as if they were not there.
    pub stretch: Stretch,
    /// The time of files that have another than the layout says.
    pub times: Vec<(PathBuf, TimeColumn)>,
    /// What stands for files in memory.
    pub tables: Tables,
}

/// One row of a recording. Reused from row to row, so that reading does not allocate.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Row {
    /// The instant in nanoseconds.
    pub time_ns: i64,
    /// The instant as the input has it, without spaces around it and with a point for a decimal comma.
    pub time_text: String,
    /// One value per channel of the layout, in its unit; `NaN` where there is none.
    pub values: Vec<f64>,
    /// Whether the column that `[table]` declares for segments has another value than in the row before.
    pub begins_segment: bool,
}

/// Reads a recording row by row, each as soon as its line is there.
///
/// A row is left out and counted when its time is not after the one before, save one of the same time that is put together with it
/// ([`Options::joins`]). One that leaps, by more than five minutes and more than
/// thirty times the step before, waits for the next row: it is left out and counted when that lies between the two, since then
/// its time is wrong and no row after it is to be lost; so is it when no row follows, unless it is the second. A last line without
/// an end that lacks cells (CSV) or is no whole object (JSON lines) was cut off while it was written: it is left out and reported, never
/// an error.
pub struct Reader {
    rows: Rows,
    reading: Reading,
    /// The first row of a segment, after the break before it was given.
    waiting: Option<Row>,
    /// Its rows from the first on, of a file whose machines are read one after the other.
    again: Option<Again>,
}

type Again = Box<dyn Fn() -> Result<Rows, FileError> + Send>;

enum Rows {
    Csv(Box<CsvRows>),
    Json(Box<JsonRows>),
    Typed(Box<TypedCells>),
}

impl Reader {
    /// Opens a file, or standard input for `-`, and reads as far as the column names.
    ///
    /// # Errors
    /// The file cannot be opened, is empty or not text, is otherwise than declared, or (CSV) lacks a column or has one twice.
    pub fn open(
        path: impl AsRef<Path>,
        layout: Layout,
        options: Options,
    ) -> Result<Self, FileError> {
        Self::open_through(path, layout, options, |input| input)
    }

    /// The same, with something between the file and what reads it, such as one that ends where the program is to stop.
    ///
    /// # Errors
    /// As for [`Reader::open`].
    pub fn open_through(
        path: impl AsRef<Path>,
        mut layout: Layout,
        options: Options,
        through: impl FnOnce(Box<dyn Read + Send>) -> Box<dyn Read + Send>,
    ) -> Result<Self, FileError> {
        let path = path.as_ref();
        let stretch = options.stretch.of(&layout.time)?;
        let options = Options { stretch, ..options };
        if let Some((_, time)) = options.times.iter().find(|(file, _)| file == path) {
            layout.time = time.clone();
        }
        let is_whole = !options.goes_on && path.is_file();
        let table = layout.table_of(path).clone();
        let is_of_several = table.machine.is_some() && table.only.is_none();
        let again = (is_of_several && (is_whole || options.tables.has(path))).then(|| {
            let (path, layout, options) = (path.to_owned(), layout.clone(), options.clone());
            let again = move || Ok(Self::open(&path, layout.clone(), options.clone())?.rows);
            Box::new(again) as Again
        });
        if let Some(file) = typed::opened(path, &options.tables) {
            let reader = Self::from_typed(path, file?, layout, options)?;
            return Ok(reader.reading_again(again));
        }
        let format = options.format.or_else(|| Format::of_file(path));
        let options = Options { format, ..options };
        let lines = Lines::open_through(path, table.encoding, through)?;
        // What is read once, or goes on, is read as it comes.
        let mut reader = Self::from_lines(lines, layout, &table, options)?;
        if let (Rows::Csv(rows), true, Some(_)) = (&mut reader.rows, is_whole, &reader.reading.long)
        {
            rows.merge(
                path,
                &reader.reading.layout.time,
                reader.reading.commas.times,
            );
        }
        Ok(reader.reading_again(again))
    }

    /// The same with its rows from the first on, where these can be had.
    fn reading_again(mut self, again: Option<Again>) -> Self {
        if let Some(machines) = &mut self.reading.machines {
            machines.is_file = again.is_some();
        }
        self.again = again;
        self
    }

    /// Reads from any stream of bytes; `name` stands for it in messages.
    ///
    /// # Errors
    /// As for [`Reader::open`].
    pub fn from_read(
        name: &str,
        input: impl Read + Send + 'static,
        layout: Layout,
        options: Options,
    ) -> Result<Self, FileError> {
        let table = layout.table_of(Path::new(name)).clone();
        let lines = Lines::new(name.into(), table.encoding, input);
        Self::from_lines(lines, layout, &table, options)
    }

    fn from_lines(
        mut lines: Lines,
        layout: Layout,
        table: &TableFormat,
        options: Options,
    ) -> Result<Self, FileError> {
        lines.only_whole = options.goes_on;
        let wanted = wanted(&layout, table);
        let taken = taken(Path::new(&*lines.place().file), &layout, &options)?;
        let rows = match lines.format_or(options.format)? {
            Format::JsonLines => (Rows::Json(Box::new(JsonRows::new(lines, &wanted)?)), None),
            _ => {
                let rows = CsvRows::new(lines, &wanted, table)?;
                let separator = rows.separator();
                (Rows::Csv(Box::new(rows)), Some(separator))
            }
        };
        Ok(Self::of_rows(rows, layout, table, &options, taken))
    }

    /// Reads columns that are no text, such as those of a data frame; the path stands for them in messages.
    ///
    /// # Errors
    /// As for [`Reader::open`].
    pub fn from_typed(
        path: &Path,
        file: Box<dyn TypedFile>,
        layout: Layout,
        options: Options,
    ) -> Result<Self, FileError> {
        let table = layout.table_of(path).clone();
        let wanted = wanted(&layout, &table);
        let is_long = table.layout == Arrangement::Long;
        let numbers = if is_long { 0 } else { layout.channels.len() };
        let offset = offset_of(path, &options);
        let own = |at: i64| at.saturating_sub(offset);
        let taken = taken(path, &layout, &options)?;
        let within = options.within.map(|(from, to)| (own(from), own(to)));
        let within = match (within, taken) {
            (Some((from, to)), Some(taken)) => Some((from.max(taken.0), to.min(taken.1))),
            _ => within.or(taken),
        };
        let cells = TypedCells::new(path, file, &wanted, numbers, within)?;
        let rows = Rows::Typed(Box::new(cells));
        Ok(Self::of_rows((rows, None), layout, &table, &options, taken))
    }

    fn of_rows(
        (rows, separator): (Rows, Option<u8>),
        layout: Layout,
        table: &TableFormat,
        options: &Options,
        taken: Option<(i64, i64)>,
    ) -> Self {
        let long = (table.layout == Arrangement::Long).then(|| Long::of(&layout.in_file(table)));
        let cells = if long.is_some() {
            2
        } else {
            layout.channels.len()
        };
        let is_time = |name: &String| layout.time.columns.names().contains(name);
        let restarts = table.segment.as_ref().is_some_and(is_time);
        let segment_cell = table.segment.as_ref().map(|_| cells).filter(|_| !restarts);
        let machine_cell = cells + usize::from(table.segment.is_some());
        let machines = table.machine.as_ref();
        let machines =
            machines.map(|column| Machines::new(column, machine_cell, table.only.as_deref()));
        let joins = options.joins || long.is_some();
        let mut ledger = Ledger::new(options.lenient || table.lenient, table.decimal);
        ledger.joins = joins;
        ledger.goes_on = options.goes_on;
        Self {
            rows,
            reading: Reading {
                layout,
                ledger,
                commas: Commas::of(table, separator),
                time: Vec::new(),
                text: String::new(),
                segment_cell,
                restarts,
                segment: Vec::new(),
                machines,
                long,
                ahead: None,
                joins,
                lookahead: Lookahead::default(),
                taken,
            },
            waiting: None,
            again: None,
        }
    }

    /// Reads the next row into `row`; false at the end of the recording.
    ///
    /// # Errors
    /// A cell, row or line that cannot be read, with its place, unless [`Options::lenient`]; at the end of JSON lines and of a long
    /// layout also a channel that no line had, unless that was reported at once ([`Reader::report_first`]).
    pub fn next_into(&mut self, row: &mut Row) -> Result<bool, FileError> {
        loop {
            let is_row = match &mut self.rows {
                Rows::Csv(rows) => self.reading.next_joined(rows.as_mut(), row),
                Rows::Json(rows) => self.reading.next_joined(rows.as_mut(), row),
                Rows::Typed(rows) => self.reading.next_joined(rows.as_mut(), row),
            }?;
            match &self.again {
                Some(again) if !is_row && self.reading.next_machine() => self.rows = again()?,
                _ => return Ok(is_row),
            }
        }
    }

    /// Whether rows of several machines are read, one machine after the other.
    pub(crate) fn is_of_several(&self) -> bool {
        let machines = self.reading.machines.as_ref();
        machines.is_some_and(Machines::are_several)
    }

    /// What comes next, with `row` filled if it is a row.
    pub(crate) fn next_event(&mut self, row: &mut Row) -> Result<Event, FileError> {
        if let Some(waiting) = self.waiting.take() {
            *row = waiting;
        } else if !self.next_into(row)? {
            return Ok(Event::End);
        } else if row.begins_segment {
            self.waiting = Some(std::mem::take(row));
            return Ok(Event::Segment);
        }
        Ok(Event::Row)
    }

    /// Reports what is met for the first time as soon as it is: who reads what never ends gets no report at its end.
    pub fn report_first(&mut self, report: impl FnMut(&FileError) + Send + 'static) {
        self.reading.ledger.on_first = Some(Box::new(report));
    }

    /// Goes on after an instant that is known before the first row, with its text for messages. Where that row is after it, it is
    /// followed like a row before; where it is not, what was read is read again.
    pub fn begin_after(&mut self, before: Instant, text: &str) {
        self.reading.ledger.begin_after(before, text);
    }

    /// The instant of the last row, and how long after the one before it that was, in ns.
    pub(crate) fn last(&self) -> Option<(Instant, i64)> {
        self.reading.ledger.last()
    }

    /// What was met so far.
    pub fn report(&self) -> &Report {
        &self.reading.ledger.report
    }

    /// Whether the columns are known by their names alone, and not by the rows.
    pub(crate) fn has_names(&self) -> bool {
        !matches!(self.rows, Rows::Json(_)) && self.reading.long.is_none()
    }

    /// Which channels of the layout were there, as far as the file was read.
    pub(crate) fn present(&self) -> Vec<bool> {
        match (&self.reading.long, &self.rows) {
            (Some(long), _) => long.seen().to_vec(),
            (None, Rows::Csv(rows)) => rows.present(),
            (None, Rows::Json(rows)) => rows.present(),
            (None, Rows::Typed(rows)) => rows.present(),
        }
    }

    /// The names of all columns that are known; none of a file that has them in its rows.
    pub(crate) fn names(&self) -> Vec<String> {
        match &self.rows {
            Rows::Csv(rows) => rows.names().to_vec(),
            Rows::Json(rows) => rows.names(),
            Rows::Typed(rows) => rows.names().to_vec(),
        }
    }

    /// What is read.
    pub fn layout(&self) -> &Layout {
        &self.reading.layout
    }
}

/// The first instant that is taken of a file and the first behind, by its own clock; none where all are.
fn taken(path: &Path, layout: &Layout, options: &Options) -> Result<Option<(i64, i64)>, FileError> {
    let ends = options.stretch.of(&layout.time)?.ends();
    // What has no end there has none by any clock.
    let own = |at: i64| match at {
        i64::MIN | i64::MAX => at,
        at => at.saturating_sub(offset_of(path, options)),
    };
    Ok(ends.map(|(from, to)| (own(from), own(to))))
}

/// The columns whose cells are read, as the file names them: those of the channels, or where a row has one value its name and that;
/// behind them those for segments and machines.
fn wanted(layout: &Layout, table: &TableFormat) -> Layout {
    let column = |name: &String| ChannelColumn {
        column: name.clone(),
        optional: false,
        is_instant: false,
    };
    let mut wanted = layout.in_file(table);
    if table.layout == Arrangement::Long {
        let cells = [&table.name, &table.value].into_iter().flatten();
        wanted.channels = cells.map(column).collect();
    }
    let apart = [&table.segment, &table.machine].into_iter().flatten();
    wanted.channels.extend(apart.map(column));
    wanted
}

#[cfg(test)]
mod tests;
