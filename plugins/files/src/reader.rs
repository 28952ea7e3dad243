//! Rows of a recording in either format: instants that advance, values or absence. Not how the bytes are cut into cells.

use std::io::Read;
use std::path::Path;

use athermal_core::time::{Civil, Instant};

use crate::cell;
use crate::cells::Cells;
use crate::csv_rows::CsvRows;
use crate::error::excerpt;
use crate::joined::{self, Held, Joined};
use crate::json_rows::JsonRows;
use crate::ledger::{Follows, Ledger};
use crate::lines::Lines;
use crate::{Again, FileError, Format, Layout, Place, Report, TimeColumn};

/// How a recording is to be read.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Options {
    /// The format; by default what the name of the file says, else its first byte.
    pub format: Option<Format>,
    /// What stands between the cells of CSV; by default the one of `,` `;` tab `|` that fits the header best.
    pub delimiter: Option<u8>,
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
}

/// Reads a recording row by row, each as soon as its line is there.
///
/// A row is left out and counted when its time is not after the one before, save one of the same time that is put together with it
/// ([`Options::joins`]). One that leaps, by more than five minutes and more than
/// thirty times the step before, waits for the next row: it is left out and counted when that lies between the two, since then
/// its time is wrong and no row after it is to be lost; so is it when no row follows, unless it is the second. Where rows are put
/// together the first one waits too, and is left out and counted when it is more than five minutes after the next. A last line without
/// an end that lacks cells (CSV) or is no whole object (JSON lines) was cut off while it was written: it is left out and reported, never
/// an error.
pub struct Reader {
    rows: Rows,
    layout: Layout,
    ledger: Ledger,
    /// What was read to find out whether the row before it is to be taken.
    ahead: Option<Stamped>,
    /// Where rows of one time are put together.
    held: Option<Held>,
}

/// A row with the cell that its time is from.
struct Stamped {
    row: Row,
    cell: Vec<u8>,
    place: Place,
}

impl Stamped {
    fn new<C: Cells>(row: &Row, rows: &C) -> Self {
        Self {
            row: row.clone(),
            cell: cell::trim(rows.time()).to_vec(),
            place: rows.place(),
        }
    }
}

enum Rows {
    Csv(Box<CsvRows>),
    Json(Box<JsonRows>),
}

impl Reader {
    /// Opens a file, or standard input for `-`, and reads as far as the column names.
    ///
    /// # Errors
    /// The file cannot be opened, is empty or not text, or (CSV) lacks a column or has one twice.
    pub fn open(
        path: impl AsRef<Path>,
        layout: Layout,
        options: Options,
    ) -> Result<Self, FileError> {
        Self::open_through(path, layout, options, |input| input)
    }

    /// The same, with something between the file and what reads it, such as one that ends where the program is told to stop.
    ///
    /// # Errors
    /// As for [`Reader::open`].
    pub fn open_through(
        path: impl AsRef<Path>,
        layout: Layout,
        options: Options,
        through: impl FnOnce(Box<dyn Read + Send>) -> Box<dyn Read + Send>,
    ) -> Result<Self, FileError> {
        let path = path.as_ref();
        let format = options.format.or_else(|| Format::from_path(path));
        let options = Options { format, ..options };
        Self::from_lines(Lines::open_through(path, through)?, layout, options)
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
        Self::from_lines(Lines::new(name.into(), input), layout, options)
    }

    fn from_lines(mut lines: Lines, layout: Layout, options: Options) -> Result<Self, FileError> {
        lines.only_whole = options.goes_on;
        let rows = match lines.format_or(options.format)? {
            Format::Csv => Rows::Csv(Box::new(CsvRows::new(lines, &layout, options.delimiter)?)),
            Format::JsonLines => Rows::Json(Box::new(JsonRows::new(lines, &layout)?)),
        };
        let mut ledger = Ledger::new(options.lenient);
        ledger.joins = options.joins;
        ledger.goes_on = options.goes_on;
        Ok(Self {
            rows,
            layout,
            ledger,
            ahead: None,
            held: options.joins.then(Held::default),
        })
    }

    /// Reads the next row into `row`; false at the end of the recording.
    ///
    /// # Errors
    /// A cell, row or line that cannot be read, with its place, unless [`Options::lenient`]; at the end of JSON lines also
    /// a channel that no line had, unless that was told at once ([`Reader::tell_first`]).
    pub fn next_into(&mut self, row: &mut Row) -> Result<bool, FileError> {
        let Self {
            rows,
            layout,
            ledger,
            ahead,
            held,
        } = self;
        match rows {
            Rows::Csv(rows) => next_joined(rows.as_mut(), layout, ledger, ahead, held, row),
            Rows::Json(rows) => next_joined(rows.as_mut(), layout, ledger, ahead, held, row),
        }
    }

    /// Tells of what is met for the first time as soon as it is: who reads what never ends gets no report at its end.
    pub fn tell_first(&mut self, tell: impl FnMut(&FileError) + Send + 'static) {
        self.ledger.tell = Some(Box::new(tell));
    }

    /// Goes on after an instant that is known before the first row, and is told so. Where that row is after it, it is followed like a
    /// row before; where it is not, what was read is read again.
    pub fn begin_after(&mut self, before: Instant, told: &str) {
        self.ledger.begin_after(before, told);
    }

    /// The instant of the last row, and how long after the one before it that was, in ns.
    pub(crate) fn last(&self) -> Option<(Instant, i64)> {
        self.ledger.last()
    }

    /// What was met so far.
    pub fn report(&self) -> &Report {
        &self.ledger.report
    }

    /// What is read.
    pub fn layout(&self) -> &Layout {
        &self.layout
    }
}

/// Reads the next row with all those of its time that can be put together with it.
fn next_joined<C: Cells>(
    rows: &mut C,
    layout: &Layout,
    ledger: &mut Ledger,
    ahead: &mut Option<Stamped>,
    held: &mut Option<Held>,
    row: &mut Row,
) -> Result<bool, FileError> {
    let Some(held) = held else {
        return next(rows, layout, ledger, ahead, row);
    };
    if let Some(given) = held.give(row) {
        if !matches!(given, Ok(true)) {
            return given;
        }
    } else if !next(rows, layout, ledger, ahead, row)? {
        return Ok(false);
    }
    loop {
        // Where the next row stands, if that was read before.
        let stands = match ahead {
            Some(read) if read.row.time_ns == row.time_ns => Some(read.place.clone()),
            _ => None,
        };
        let read = next(rows, layout, ledger, ahead, &mut held.row);
        if ledger.takes_place_of_first() {
            if !matches!(read, Ok(true)) {
                return read;
            }
            std::mem::swap(row, &mut held.row);
            continue;
        }
        if matches!(read, Ok(true)) && held.row.time_ns == row.time_ns {
            let place = || stands.unwrap_or_else(|| rows.place());
            match joined::join(&mut row.values, &held.row.values) {
                Joined::More => ledger.report.joined += 1,
                Joined::Nothing => {
                    ledger.refuse_again(held.row.time_text.as_bytes(), place, Again::Nothing);
                }
                Joined::Contradicts(channel) => {
                    let column = layout.channels[channel].column.clone();
                    let other = Again::Other(column);
                    ledger.refuse_again(held.row.time_text.as_bytes(), place, other);
                }
            }
            continue;
        }
        held.read = Some(read);
        return Ok(true);
    }
}

fn next<C: Cells>(
    rows: &mut C,
    layout: &Layout,
    ledger: &mut Ledger,
    ahead: &mut Option<Stamped>,
    row: &mut Row,
) -> Result<bool, FileError> {
    if let Some(read_ahead) = ahead.take() {
        let follows = ledger.follows(read_ahead.row.time_ns);
        if !ledger.refuses(follows) {
            return next_doubted(rows, layout, ledger, ahead, read_ahead, row);
        }
        ledger.refuse(follows, &read_ahead.cell, || read_ahead.place);
    }
    match read(rows, layout, ledger, row)? {
        None => return Ok(false),
        Some(Follows::Leaping) => {
            let doubted = Stamped::new(row, rows);
            return next_doubted(rows, layout, ledger, ahead, doubted, row);
        }
        Some(Follows::Again) => {}
        Some(_) => {
            ledger.take(row.time_ns, cell::trim(rows.time()));
            ledger.doubt_first(|| rows.place());
        }
    }
    Ok(true)
}

/// Gives a row of which the next tells whether it is taken, or else that one; false where none follows that tells it.
#[cold]
fn next_doubted<C: Cells>(
    rows: &mut C,
    layout: &Layout,
    ledger: &mut Ledger,
    ahead: &mut Option<Stamped>,
    mut doubted: Stamped,
    row: &mut Row,
) -> Result<bool, FileError> {
    while ledger.follows(doubted.row.time_ns) == Follows::Leaping {
        let next = match read(rows, layout, ledger, row) {
            Ok(Some(_)) => Stamped::new(row, rows),
            Ok(None) if !ledger.knows_leaps() => break,
            end => {
                ledger.refuse_leap(&doubted.cell, doubted.place, None);
                return end.map(|_| false);
            }
        };
        if next.row.time_ns >= doubted.row.time_ns {
            *ahead = Some(next);
            break;
        }
        ledger.refuse_leap(&doubted.cell, doubted.place, Some(&next.cell));
        doubted = next;
    }
    if ledger.follows(doubted.row.time_ns) != Follows::Again {
        ledger.take(doubted.row.time_ns, &doubted.cell);
    }
    *row = doubted.row;
    Ok(true)
}

/// Reads the next row that is after the last one taken, or where rows are put together at its time, and how it follows that; none at
/// the end.
fn read<C: Cells>(
    rows: &mut C,
    layout: &Layout,
    ledger: &mut Ledger,
    row: &mut Row,
) -> Result<Option<Follows>, FileError> {
    while rows.advance(ledger)? {
        let Some(time_ns) = read_time(rows, layout, ledger, &mut row.time_text)? else {
            continue;
        };
        let mut follows = ledger.follows(time_ns);
        if ledger.refuses(follows) {
            let cell = cell::trim(rows.time());
            if !ledger.refuse_first(time_ns, cell) {
                ledger.refuse(follows, cell, || rows.place());
                continue;
            }
            follows = Follows::Next;
        }
        row.time_ns = time_ns;
        read_values(rows, layout, ledger, &mut row.values)?;
        return Ok(Some(follows));
    }
    Ok(None)
}

/// The instant of the current row, and its text; `None` when the row is left out for want of one.
fn read_time<C: Cells>(
    rows: &mut C,
    layout: &Layout,
    ledger: &mut Ledger,
    text: &mut String,
) -> Result<Option<i64>, FileError> {
    let cell = cell::trim(rows.time());
    text.clear();
    let time = &layout.time;
    let read = std::str::from_utf8(cell).ok().and_then(|cell| {
        text.push_str(cell);
        if rows.decimal_comma()
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
        ledger.refuse_row(|| no_instant(time, read, rows.place(), cell::trim(rows.time())))?;
        return Ok(None);
    };
    if let Some(zoned) = time.form.is_zoned(text.as_bytes()) {
        let report = &mut ledger.report;
        if report.without_zone.is_none() && !zoned && time.zone.is_none() {
            report.without_zone = Some(rows.place());
        }
    } else if rows.decimal_comma()
        && let Some(mark) = ledger.other_time_mark(cell, || rows.place().line)
    {
        ledger.refuse_row(|| mixed(rows.place(), &time.columns.to_string(), cell, mark))?;
        return Ok(None);
    }
    Ok(Some(at.as_ns()))
}

/// What is wrong with a time that is no instant, read as this.
fn no_instant(time: &TimeColumn, read: Option<Civil>, place: Place, cell: &[u8]) -> FileError {
    let (column, found) = (time.columns.to_string(), excerpt(cell));
    match (read, &time.zone) {
        (Some(Civil::Skipped { offset_s }), Some(zone)) => FileError::TimeSkipped {
            place,
            column,
            found,
            zone: zone.to_string(),
            offset_s,
        },
        (Some(_), _) => FileError::TimeBeyond {
            place,
            column,
            found,
        },
        (None, _) => FileError::BadTime {
            place,
            column,
            found,
            expected: time.form.expected(),
        },
    }
}

fn read_values<C: Cells>(
    rows: &C,
    layout: &Layout,
    ledger: &mut Ledger,
    values: &mut Vec<f64>,
) -> Result<(), FileError> {
    values.clear();
    for (index, channel) in layout.channels.iter().enumerate() {
        let cell = rows.channel(index);
        let value = match cell::value(cell, rows.decimal_comma()) {
            Some(_)
                if rows.decimal_comma()
                    && let Some(mark) = ledger.other_value_mark(cell, || rows.place().line) =>
            {
                ledger.bad_cell(index, || mixed(rows.place(), &channel.column, cell, mark))?;
                f64::NAN
            }
            Some(value) => value,
            None => {
                ledger.bad_cell(index, || FileError::BadCell {
                    place: rows.place(),
                    column: channel.column.clone(),
                    found: excerpt(cell::trim(cell)),
                })?;
                f64::NAN
            }
        };
        values.push(value);
    }
    Ok(())
}

/// What is wrong with a number that has another decimal mark than those since that line.
fn mixed(place: Place, column: &str, cell: &[u8], (mark, since): (u8, u64)) -> FileError {
    FileError::MixedMarks {
        place,
        column: column.to_owned(),
        found: excerpt(cell::trim(cell)),
        mark: char::from(mark),
        since,
    }
}

#[cfg(test)]
mod tests;
