//! Rows of a recording in either format: instants that advance, values or absence. Not how the bytes are cut into cells.

mod commas;

use std::io::Read;
use std::path::{Path, PathBuf};

use athermal_core::document::{Arrangement, TableFormat};
use athermal_core::time::{Civil, Instant};

use crate::cell;
use crate::cells::Cells;
use crate::csv_rows::CsvRows;
use crate::error::excerpt;
use crate::joined::{self, Joined, Lookahead};
use crate::json_rows::JsonRows;
use crate::ledger::{Follows, Ledger};
use crate::lines::Lines;
use crate::long::Long;
use crate::typed::{self, TypedCells, TypedFile};
use crate::{
    Again, CellFault, ChannelColumn, Event, FileError, Format, Layout, Place, Report, TimeColumn,
};
use commas::Commas;

/// How a recording is to be read.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
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
    /// The time of files that have another than the layout says.
    pub times: Vec<(PathBuf, TimeColumn)>,
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
}

enum Rows {
    Csv(Box<CsvRows>),
    Json(Box<JsonRows>),
    Typed(Box<TypedCells>),
}

/// What becomes of rows, whatever their format.
struct Reading {
    layout: Layout,
    ledger: Ledger,
    commas: Commas,
    /// The text of the time of the row that was read last.
    time: Vec<u8>,
    /// Which cell says the segment of a row, after those of the channels.
    segment_cell: Option<usize>,
    /// The segment of the row that was read last.
    segment: Vec<u8>,
    /// Where a row has one value.
    long: Option<Long>,
    /// What was read to find out whether the row before it is to be taken.
    ahead: Option<Stamped>,
    /// Where rows of one time are put together.
    joins: bool,
    lookahead: Lookahead,
}

/// A row with the cell that its time is from.
struct Stamped {
    row: Row,
    cell: Vec<u8>,
    place: Place,
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
        if let Some((_, time)) = options.times.iter().find(|(file, _)| file == path) {
            layout.time = time.clone();
        }
        if let Some(kind) = typed::kind_of(path) {
            return Self::from_typed(path, typed::open(kind, path)?, layout, options);
        }
        let format = options.format.or_else(|| Format::of_file(path));
        let options = Options { format, ..options };
        let table = layout.table_of(path).clone();
        let lines = Lines::open_through(path, table.encoding, through)?;
        // What is read once, or goes on, is read as it comes.
        let is_whole = !options.goes_on && path.is_file();
        let mut reader = Self::from_lines(lines, layout, &table, options)?;
        if let (Rows::Csv(rows), true, Some(_)) = (&mut reader.rows, is_whole, &reader.reading.long)
        {
            rows.merge(
                path,
                &reader.reading.layout.time,
                reader.reading.commas.times,
            );
        }
        Ok(reader)
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
        let (rows, separator) = match lines.format_or(options.format)? {
            Format::JsonLines => (Rows::Json(Box::new(JsonRows::new(lines, &wanted)?)), None),
            _ => {
                let rows = CsvRows::new(lines, &wanted, table)?;
                let separator = rows.separator();
                (Rows::Csv(Box::new(rows)), Some(separator))
            }
        };
        Ok(Self::of_rows(rows, separator, layout, table, &options))
    }

    /// Reads a file that is no text.
    fn from_typed(
        path: &Path,
        file: Box<dyn TypedFile>,
        layout: Layout,
        options: Options,
    ) -> Result<Self, FileError> {
        let table = layout.table_of(path).clone();
        let wanted = wanted(&layout, &table);
        let is_long = table.layout == Arrangement::Long;
        let numbers = if is_long { 0 } else { layout.channels.len() };
        let cells = TypedCells::new(path, file, &wanted, numbers)?;
        let rows = Rows::Typed(Box::new(cells));
        Ok(Self::of_rows(rows, None, layout, &table, &options))
    }

    fn of_rows(
        rows: Rows,
        separator: Option<u8>,
        layout: Layout,
        table: &TableFormat,
        options: &Options,
    ) -> Self {
        let long = (table.layout == Arrangement::Long).then(|| Long::of(&layout));
        let cells = if long.is_some() {
            2
        } else {
            layout.channels.len()
        };
        let segment_cell = table.segment.as_ref().map(|_| cells);
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
                segment_cell,
                segment: Vec::new(),
                long,
                ahead: None,
                joins,
                lookahead: Lookahead::default(),
            },
            waiting: None,
        }
    }

    /// Reads the next row into `row`; false at the end of the recording.
    ///
    /// # Errors
    /// A cell, row or line that cannot be read, with its place, unless [`Options::lenient`]; at the end of JSON lines and of a long
    /// layout also a channel that no line had, unless that was reported at once ([`Reader::report_first`]).
    pub fn next_into(&mut self, row: &mut Row) -> Result<bool, FileError> {
        match &mut self.rows {
            Rows::Csv(rows) => self.reading.next_joined(rows.as_mut(), row),
            Rows::Json(rows) => self.reading.next_joined(rows.as_mut(), row),
            Rows::Typed(rows) => self.reading.next_joined(rows.as_mut(), row),
        }
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

impl Reading {
    /// Reads the next row with all those of its time that can be put together with it.
    fn next_joined<C: Cells>(&mut self, rows: &mut C, row: &mut Row) -> Result<bool, FileError> {
        if !self.joins {
            return self.next(rows, row);
        }
        let mut lookahead = std::mem::take(&mut self.lookahead);
        let joined = self.join_next(rows, &mut lookahead, row);
        self.lookahead = lookahead;
        joined
    }

    fn join_next<C: Cells>(
        &mut self,
        rows: &mut C,
        lookahead: &mut Lookahead,
        row: &mut Row,
    ) -> Result<bool, FileError> {
        if let Some(given) = lookahead.give(row) {
            if !matches!(given, Ok(true)) {
                return given;
            }
        } else if !self.next(rows, row)? {
            return Ok(false);
        }
        loop {
            // Where the next row stands, if that was read before.
            let stands = match &self.ahead {
                Some(read) if read.row.time_ns == row.time_ns => Some(read.place.clone()),
                _ => None,
            };
            let next = &mut lookahead.row;
            let read = self.next(rows, next);
            if !matches!(read, Ok(true)) || next.time_ns != row.time_ns || next.begins_segment {
                lookahead.read = Some(read);
                return Ok(true);
            }
            let why = match joined::join(&mut row.values, &next.values) {
                Joined::More => {
                    self.ledger.report.joined += 1;
                    continue;
                }
                Joined::Nothing => Again::Nothing,
                Joined::Contradicts(channel) => {
                    Again::Other(self.layout.channels[channel].column.clone())
                }
            };
            let place = || stands.unwrap_or_else(|| rows.place());
            let time = next.time_text.as_bytes();
            self.ledger.refuse_again(time, place, why);
        }
    }

    fn next<C: Cells>(&mut self, rows: &mut C, row: &mut Row) -> Result<bool, FileError> {
        if let Some(ahead) = self.ahead.take() {
            let follows = self.follows(&ahead.row);
            if !self.ledger.refuses(follows) {
                return self.next_doubted(rows, ahead, row);
            }
            self.ledger.refuse(follows, &ahead.cell, || ahead.place);
        }
        match self.read(rows, row)? {
            None => return Ok(false),
            Some(Follows::Leaping) => {
                let doubted = self.stamped(row, rows);
                return self.next_doubted(rows, doubted, row);
            }
            Some(Follows::Again) => {}
            Some(_) => {
                self.ledger
                    .take(row.time_ns, &self.time, row.begins_segment);
            }
        }
        Ok(true)
    }

    /// The row that was read last.
    fn stamped<C: Cells>(&self, row: &Row, rows: &C) -> Stamped {
        Stamped {
            row: row.clone(),
            cell: self.time.clone(),
            place: rows.place(),
        }
    }

    /// How a row follows the last one that was taken; the first of a segment follows none.
    fn follows(&self, row: &Row) -> Follows {
        match row.begins_segment {
            true => Follows::Next,
            false => self.ledger.follows(row.time_ns),
        }
    }

    /// Gives a row of which the next says whether it is taken, or else that one; false where none follows that says it.
    #[cold]
    fn next_doubted<C: Cells>(
        &mut self,
        rows: &mut C,
        mut doubted: Stamped,
        row: &mut Row,
    ) -> Result<bool, FileError> {
        while self.follows(&doubted.row) == Follows::Leaping {
            let next = match self.read(rows, row) {
                Ok(Some(_)) => self.stamped(row, rows),
                Ok(None) if !self.ledger.knows_leaps() => break,
                end => {
                    self.ledger.refuse_leap(&doubted.cell, doubted.place, None);
                    return end.map(|_| false);
                }
            };
            if next.row.time_ns >= doubted.row.time_ns || next.row.begins_segment {
                self.ahead = Some(next);
                break;
            }
            let cell = Some(&*next.cell);
            self.ledger.refuse_leap(&doubted.cell, doubted.place, cell);
            doubted = next;
        }
        if self.follows(&doubted.row) != Follows::Again {
            let row = &doubted.row;
            self.ledger
                .take(row.time_ns, &doubted.cell, row.begins_segment);
        }
        *row = doubted.row;
        Ok(true)
    }

    /// Reads the next row that is after the last one taken, or where rows are put together at its time, and how it follows that; none
    /// at the end.
    fn read<C: Cells>(
        &mut self,
        rows: &mut C,
        row: &mut Row,
    ) -> Result<Option<Follows>, FileError> {
        while rows.advance(&mut self.ledger)? {
            if let Some(long) = &mut self.long
                && !long.takes(rows.channel(0))
            {
                continue;
            }
            let Some(time_ns) = self.read_time(rows, &mut row.time_text)? else {
                continue;
            };
            row.time_ns = time_ns;
            row.begins_segment = self.segment_cell.is_some_and(|at| {
                let segment = cell::trim(rows.channel(at));
                let changes = !segment.is_empty() && *segment != *self.segment;
                let is_first = self.segment.is_empty();
                if changes {
                    self.segment = segment.to_vec();
                }
                changes && !is_first
            });
            let follows = self.follows(row);
            if self.ledger.refuses(follows) {
                if self.long.is_some() && follows == Follows::Behind {
                    return Err(self.ledger.out_of_order(&self.time, rows.place()));
                }
                self.ledger.refuse(follows, &self.time, || rows.place());
                continue;
            }
            self.read_values(rows, &mut row.values)?;
            return Ok(Some(follows));
        }
        match &self.long {
            Some(long) if self.ledger.on_first.is_none() => long.check(&self.layout, rows.place()),
            _ => Ok(()),
        }?;
        Ok(None)
    }

    /// The instant of the current row, and its text; `None` when the row is left out for want of one.
    fn read_time<C: Cells>(
        &mut self,
        rows: &mut C,
        text: &mut String,
    ) -> Result<Option<i64>, FileError> {
        text.clear();
        if let Some((ns, is_utc, of_file)) = rows.instant() {
            text.push_str(of_file);
            return self.take_instant(rows, ns, is_utc);
        }
        let (time, ledger) = (&self.layout.time, &mut self.ledger);
        time.columns
            .join(&mut self.time, |column| cell::trim(rows.time(column)));
        let cell = self.time.as_slice();
        let read = std::str::from_utf8(cell).ok().and_then(|cell| {
            text.push_str(cell);
            if self.commas.times
                && let Some(comma) = cell::comma_of_time(cell.as_bytes())
            {
                text.replace_range(comma..=comma, ".");
            }
            time.read(text.as_bytes(), ledger.last())
        });
        let Some(Civil::At(at)) = read else {
            if read.is_none() && rows.take_header(ledger)? {
                return Ok(None);
            }
            ledger.refuse_row(|| {
                let column = time.columns.to_string();
                bad_cell(rows.place(), &column, cell, no_instant(time, read))
            })?;
            return Ok(None);
        };
        if let Some(zoned) = time.form.is_zoned(text.as_bytes()) {
            let report = &mut ledger.report;
            if report.without_zone.is_none() && !zoned && time.zone.is_none() {
                report.without_zone = Some(rows.place());
            }
        } else if self.commas.times
            && let Some(mark) = ledger.other_time_mark(cell, || rows.place().line)
        {
            ledger.refuse_row(|| {
                let column = time.columns.to_string();
                bad_cell(rows.place(), &column, cell, other_mark(mark))
            })?;
            return Ok(None);
        }
        Ok(Some(at.as_ns()))
    }

    /// The same of a row that has an instant, by UTC or by the clock of the zone.
    fn take_instant<C: Cells>(
        &mut self,
        rows: &C,
        ns: i64,
        is_utc: bool,
    ) -> Result<Option<i64>, FileError> {
        self.time.clear();
        self.time.extend_from_slice(rows.time(0));
        let (time, ledger) = (&self.layout.time, &mut self.ledger);
        let at = match &time.zone {
            Some(zone) if !is_utc => zone.instant(Instant::from_ns(ns), ledger.last()),
            _ => Civil::At(Instant::from_ns(ns)),
        };
        if !is_utc && time.zone.is_none() {
            ledger
                .report
                .without_zone
                .get_or_insert_with(|| rows.place());
        }
        if let Civil::At(at) = at {
            return Ok(Some(at.as_ns()));
        }
        ledger.refuse_row(|| {
            let column = time.columns.to_string();
            bad_cell(
                rows.place(),
                &column,
                &self.time,
                no_instant(time, Some(at)),
            )
        })?;
        Ok(None)
    }

    fn read_values<C: Cells>(&mut self, rows: &C, values: &mut Vec<f64>) -> Result<(), FileError> {
        values.clear();
        if let Some(numbers) = rows.numbers() {
            values.extend_from_slice(numbers);
            return Ok(());
        }
        let channels = self.layout.channels.len();
        if self.long.is_none() {
            for index in 0..channels {
                let value = self.read_value(rows, index, rows.channel(index))?;
                values.push(value);
            }
            return Ok(());
        }
        values.resize(channels, f64::NAN);
        let of_row = |long: &Long| long.channels().to_vec();
        for index in self.long.as_ref().map_or(Vec::new(), of_row) {
            values[index] = self.read_value(rows, index, rows.channel(1))?;
        }
        Ok(())
    }

    #[inline]
    fn read_value<C: Cells>(
        &mut self,
        rows: &C,
        index: usize,
        cell: &[u8],
    ) -> Result<f64, FileError> {
        let (column, ledger) = (&self.layout.channels[index].column, &mut self.ledger);
        match cell::value(cell, self.commas.values) {
            Some(_)
                if self.commas.values
                    && let Some(mark) = ledger.other_value_mark(cell, || rows.place().line) =>
            {
                ledger.bad_cell(index, || {
                    bad_cell(rows.place(), column, cell::trim(cell), other_mark(mark))
                })?;
            }
            Some(value) => return Ok(value),
            None => ledger.bad_cell(index, || {
                bad_cell(rows.place(), column, cell::trim(cell), CellFault::NoNumber)
            })?,
        }
        Ok(f64::NAN)
    }
}

/// The columns whose cells are read: those of the channels, or where a row has one value its name and that; behind them the one for
/// segments.
fn wanted(layout: &Layout, table: &TableFormat) -> Layout {
    let column = |name: &String| ChannelColumn {
        column: name.clone(),
        optional: false,
    };
    let mut wanted = layout.clone();
    if table.layout == Arrangement::Long {
        let cells = [&table.name, &table.value].into_iter().flatten();
        wanted.channels = cells.map(column).collect();
    }
    wanted.channels.extend(table.segment.as_ref().map(column));
    wanted
}

/// A cell that is not taken.
fn bad_cell(place: Place, column: &str, cell: &[u8], fault: CellFault) -> FileError {
    FileError::BadCell {
        place,
        column: column.to_owned(),
        found: excerpt(cell),
        fault,
    }
}

/// What is wrong with a time that is no instant, read as this.
fn no_instant(time: &TimeColumn, read: Option<Civil>) -> CellFault {
    match (read, &time.zone) {
        (Some(Civil::Skipped { offset_s }), Some(zone)) => CellFault::TimeSkipped {
            zone: zone.to_string(),
            offset_s,
        },
        (Some(_), _) => CellFault::TimeBeyond,
        (None, _) => CellFault::NoTime {
            expected: time.form.expected(),
        },
    }
}

/// What is wrong with a number that has another decimal mark than those since that line.
fn other_mark((mark, since): (u8, Option<u64>)) -> CellFault {
    CellFault::OtherMark {
        mark: char::from(mark),
        since,
    }
}

#[cfg(test)]
mod tests;
