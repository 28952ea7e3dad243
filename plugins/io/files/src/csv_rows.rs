//! CSV as rows of cells: header, quoting, ragged and cut-off rows. Not what a cell means.

use std::path::Path;

use athermal_core::document::{Encoding, TableFormat};
use csv_core::{ReadRecordResult, ReaderBuilder, Terminator};

use crate::cell::{self, is_number};
use crate::cells::Cells;
use crate::columns::{self, Columns};
use crate::detect::{self, Head, LongFormat, are_units, is_of_processing};
use crate::error::excerpt;
use crate::ledger::{Ledger, Report};
use crate::lines::{LONGEST_ROW, Lines};
use crate::runs::{Merge, Stamp};
use crate::{FileError, Layout, Place, TimeColumn};

/// The rows of a CSV file.
pub(crate) struct CsvRows {
    lines: Lines,
    splitter: csv_core::Reader,
    cells: Vec<u8>,
    ends: Vec<usize>,
    row_line: u64,
    head: Head,
    table: TableFormat,
    names: Vec<String>,
    /// The units in the row below the names; none where there is no such row.
    units: Vec<String>,
    /// How many rows below the names are no data, the last of them the units.
    below_names: Option<u32>,
    /// How many cells a row has; 0 until the first row below the names.
    width: usize,
    /// Whether rows, but not the names, end in a separator, or in a note behind it.
    ends_in_separator: bool,
    /// Which row from the names on has the units, where one has; the names are 1.
    units_row: u32,
    /// Whether the names are not in UTF-8.
    windows_1252: bool,
    layout: Option<Layout>,
    columns: Columns,
}

/// How a row came out of the stream.
enum Record {
    End,
    Row {
        cells: usize,
        complete: bool,
    },
    /// The stream ends within a quoted cell, and within a line.
    Cut,
    /// A quoted cell does not end: the row is its first line, and those after it are read anew.
    Unclosed,
}

/// How many rows are looked at to find why a column is missing.
const LOOKED_AT: usize = 20;

/// Over how many lines a row can go, by line breaks in quotes.
const LINES_OF_ROW: usize = 50;

impl CsvRows {
    /// Reads the header and finds the wanted columns in it.
    pub fn new(lines: Lines, layout: &Layout, table: &TableFormat) -> Result<Self, FileError> {
        let mut rows = Self::headed(lines, table, Some(layout))?;
        rows.columns = Columns::of(layout, &rows.names);
        let lacking = rows.columns.lacking(layout);
        if lacking.is_empty() {
            return Ok(rows);
        }
        if let Some(ambiguous) = columns::ambiguous(rows.place(), &lacking, &rows.names) {
            return Err(ambiguous);
        }
        let missing = rows.missing(lacking, &rows.names);
        if rows.columns.channels.iter().any(Option::is_some) {
            return Err(missing);
        }
        let (names, place) = (rows.names.clone(), rows.place());
        let mut texts = Vec::new();
        while texts.len() < LOOKED_AT
            && let Ok(Record::Row { cells, .. }) = rows.read_record()
        {
            texts.push(rows.current(cells));
        }
        match LongFormat::of(&names, &texts, &|name| layout.names().any(|of| of == name)) {
            Some(long) => Err(FileError::LongFormat { place, long }),
            None => Err(missing),
        }
    }

    /// Gives the rows of a file in order of time, where they are several stretches that each are so.
    pub fn merge(&mut self, path: &Path, time: &TimeColumn, commas: bool) {
        let places: Option<Vec<usize>> = self.columns.time.iter().copied().collect();
        let is_text = matches!(
            self.table.encoding,
            None | Some(Encoding::Utf8 | Encoding::Windows1252)
        );
        let Some(places) = places.filter(|_| is_text && self.lines.holds_none()) else {
            return;
        };
        let stamp = Stamp {
            time: time.clone(),
            places,
            separator: self.head.separator,
            commas,
            header: self.lines.text().to_vec(),
        };
        self.lines.merge = Merge::of(path, self.row_line, stamp).map(Box::new);
    }

    fn missing(&self, lacking: Vec<&str>, names: &[String]) -> FileError {
        let note = match self.table.encoding {
            _ if self.table.skip.is_some() || self.table.names.is_some() => {
                " in the row that `[table]` declares for them"
            }
            None if self.windows_1252 => " (read as Windows-1252, since they are not in UTF-8)",
            _ => "",
        };
        columns::missing(self.place(), lacking, names, note)
    }

    /// Whether the current row is a comment; only where the header was one are others read.
    fn is_comment(&self) -> bool {
        self.lines.comments_count && self.column(0).trim_ascii_start().starts_with(b"#")
    }

    /// Reads the header where it is declared, or else found by the layout among what may stand above it.
    pub fn headed(
        mut lines: Lines,
        table: &TableFormat,
        layout: Option<&Layout>,
    ) -> Result<Self, FileError> {
        let head = detect::seek(&mut lines, table, layout)?;
        let splitter = ReaderBuilder::new()
            .delimiter(head.separator)
            .terminator(Terminator::Any(b'\n'))
            .build();
        let mut rows = Self {
            lines,
            splitter,
            cells: vec![0; 1024],
            ends: vec![0; 64],
            row_line: 0,
            head,
            table: table.clone(),
            names: Vec::new(),
            units: Vec::new(),
            below_names: None,
            width: 0,
            ends_in_separator: false,
            units_row: 1,
            windows_1252: false,
            layout: layout.cloned(),
            columns: Columns::default(),
        };
        let cells = match rows.read_record()? {
            Record::Row { cells, .. } => cells,
            Record::Unclosed | Record::Cut => {
                return Err(FileError::UnclosedQuote {
                    place: rows.place(),
                });
            }
            Record::End => {
                return Err(FileError::Empty {
                    file: rows.lines.file,
                });
            }
        };
        rows.windows_1252 = std::str::from_utf8(rows.lines.text()).is_err();
        if rows.windows_1252 && table.encoding == Some(Encoding::Utf8) {
            return Err(FileError::NotAsDeclared {
                place: rows.place(),
                key: "encoding",
                found: "these names are not in UTF-8".to_owned(),
            });
        }
        rows.names = columns::numbered(rows.current(cells));
        rows.expect_below_names();
        Ok(rows)
    }

    fn expect_below_names(&mut self) {
        let names = self.table.names.unwrap_or(1);
        let below = self.table.units.map(|units| units.saturating_sub(names));
        self.below_names = below;
    }

    /// The names in the header.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// Which channels have a column.
    pub fn present(&self) -> Vec<bool> {
        let channels = self.layout.iter().flat_map(|layout| &layout.channels);
        let places = channels.zip(&self.columns.channels);
        places.map(|(_, at)| at.is_some()).collect()
    }

    /// The units in the row below the names; none where there is no such row, known once a row was read.
    pub fn units(&self) -> &[String] {
        &self.units
    }

    /// Which row from the names on has the units; the names are 1.
    pub fn units_row(&self) -> u32 {
        self.units_row
    }

    /// What stands between cells.
    pub fn separator(&self) -> u8 {
        self.head.separator
    }

    /// How many lines stand above the names.
    pub fn skip(&self) -> u32 {
        self.head.skip
    }

    /// Whether the names or the units are not in UTF-8, and were taken for Windows-1252.
    pub fn is_windows_1252(&self) -> bool {
        self.windows_1252
    }

    /// The text of a cell of the current row.
    pub fn text(&self, column: usize) -> String {
        columns::name(self.column(column))
    }

    /// The texts of the current row.
    pub fn texts(&self) -> Vec<String> {
        self.current(self.names.len())
    }

    fn current(&self, cells: usize) -> Vec<String> {
        (0..cells).map(|i| columns::name(self.column(i))).collect()
    }

    /// A row that is no usual one: whether it is to be taken, or the data end with it; none where the next is to be read.
    #[cold]
    fn unusual(
        &mut self,
        cells: usize,
        complete: bool,
        ledger: &mut Ledger,
    ) -> Result<Option<bool>, FileError> {
        if self.takes_header(cells, ledger)? || self.is_comment() {
            return Ok(None);
        }
        let expected = self.names.len();
        if self.width == 0 {
            let row = self.current(cells);
            if self.takes_units(&row, ledger)? {
                return Ok(None);
            }
            self.width = expected;
            self.ends_in_separator = cells == expected + 1 && !is_number(&row[expected]);
            if cells == expected {
                return Ok(Some(true));
            }
        }
        let place = self.place();
        if !complete && cells < expected {
            ledger.report.truncated = Some(place);
            return Ok(Some(false));
        }
        if cells == expected + 1 && self.ends_in_separator {
            let beyond = columns::name(self.column(expected));
            if !is_number(&beyond) {
                if !beyond.is_empty() {
                    ledger.note(|| FileError::CellBeyond {
                        place,
                        found: excerpt(beyond.as_bytes()),
                    });
                }
                return Ok(Some(true));
            }
        } else if cells < expected && self.may_lack(cells) {
            ledger.short_row(|| FileError::CellsLacking {
                place,
                expected,
                found: cells,
            });
            self.fill(cells);
            return Ok(Some(true));
        }
        ledger.refuse_row(|| FileError::CellCount {
            place,
            expected,
            found: cells,
        })?;
        Ok(None)
    }

    /// Whether a row of so few cells has a time, and more.
    fn may_lack(&self, cells: usize) -> bool {
        let begins = |at: &usize| {
            let mut cell = cell::trim(self.column(*at)).iter();
            let first = cell.find(|byte| !b"+-.".contains(byte));
            first.is_some_and(u8::is_ascii_digit)
        };
        let mut time = self.columns.time.iter().flatten();
        cells > 1 && time.all(|at| *at < cells && begins(at))
    }

    /// Gives the current row of so many cells empty ones for the columns behind them.
    fn fill(&mut self, cells: usize) {
        let end = cells.checked_sub(1).map_or(0, |last| self.ends[last]);
        let width = self.names.len();
        self.ends.resize(self.ends.len().max(width), 0);
        self.ends[cells..width].fill(end);
    }

    /// Whether this row, below the names and above the data, is one of units, or one that is declared to be no data.
    fn takes_units(&mut self, row: &[String], ledger: &mut Ledger) -> Result<bool, FileError> {
        let is_units = match &mut self.below_names {
            _ if row.len() > self.names.len() + 1 => return Ok(false),
            Some(0) => return Ok(!self.units.is_empty() && is_of_processing(row)),
            Some(rows) => {
                *rows -= 1;
                *rows == 0
            }
            None if !self.units.is_empty() => return Ok(is_of_processing(row)),
            None if is_of_processing(row) => false,
            None if are_units(row) => true,
            None => return Ok(false),
        };
        self.units_row += 1;
        if !is_units {
            return Ok(true);
        }
        if let Some(found) = row.iter().find(|cell| is_number(cell)) {
            return Err(FileError::NotAsDeclared {
                place: self.place(),
                key: "units",
                found: format!("`{found}` stands here"),
            });
        }
        self.windows_1252 |= std::str::from_utf8(self.lines.text()).is_err();
        self.units = row.to_vec();
        self.units.resize(self.names.len(), String::new());
        self.report_units(&mut ledger.report);
        Ok(true)
    }

    fn report_units(&self, report: &mut Report) {
        let channels = self.layout.iter().flat_map(|layout| &layout.channels);
        for channel in channels {
            let column = &channel.column;
            let at = self.names.iter().position(|name| name == column);
            let column = self.table.rename.get(column).unwrap_or(column);
            let mut known = report.units.iter();
            let is_known = known.any(|(known, _)| known == column);
            let unit = at.filter(|_| !is_known);
            let unit = unit.and_then(|at| detect::unit(&self.units[at]));
            report.units.extend(unit.map(|unit| (column.clone(), unit)));
        }
    }

    /// Takes the columns by the current row of so many cells, if it names wanted columns and holds no values. Lines that stood above
    /// the names stand there again.
    fn takes_header(&mut self, cells: usize, ledger: &mut Ledger) -> Result<bool, FileError> {
        let Some(layout) = &self.layout else {
            return Ok(false);
        };
        // Most rows that cannot be used hold values, and are seen to without anything being set up.
        let is_value = |at: usize| {
            let text = cell::text(cell::trim(self.column(at)));
            is_number(&text) && !self.names.iter().any(|name| *name == text)
        };
        let is_above = self.head.above.contains(&columns::name(self.column(0)));
        if (0..cells).any(is_value) {
            return Ok(is_above);
        }
        let mut names = self.current(cells);
        if self.is_comment() {
            let first = names[0].trim_start().trim_start_matches('#');
            names[0] = first.trim().to_owned();
        }
        let names = columns::numbered(names);
        let columns = Columns::of(layout, &names);
        let lacking = columns.lacking(layout);
        if !lacking.is_empty() && is_above || !columns.are_named(layout) {
            return Ok(is_above);
        }
        if !lacking.is_empty() && !self.lines.is_complete() {
            ledger.report.truncated = Some(self.place());
            return Ok(true);
        }
        // Shorter names that lack columns were cut off, or rows below them will not fit those before.
        let is_whole = cells >= self.names.len() && columns.have_time();
        let unusable = match columns::ambiguous(self.place(), &lacking, &names) {
            None if lacking.is_empty() || ledger.is_lenient() && is_whole => None,
            None => Some(self.missing(lacking.clone(), &names)),
            ambiguous => ambiguous,
        };
        if let Some(error) = unusable {
            ledger.refuse_header(error)?;
            if cells >= self.names.len() && !columns.agree_with(&self.columns) {
                // Rows have no time until names say which columns are which.
                self.columns.time.fill(None);
            }
            return Ok(true);
        }
        ledger.header(FileError::HeaderAgain {
            place: self.place(),
            moved: columns != self.columns,
            lacking: lacking.into_iter().map(str::to_owned).collect(),
        });
        (self.names, self.columns) = (names, columns);
        self.units.clear();
        self.units_row = 1;
        self.expect_below_names();
        self.width = 0;
        self.ends_in_separator = false;
        Ok(true)
    }

    /// Reads one record into `cells`, over several lines if it has line breaks in quotes.
    fn read_record(&mut self) -> Result<Record, FileError> {
        if !self.lines.advance_to_content()? {
            return Ok(Record::End);
        }
        self.row_line = self.lines.number();
        let mut before = Vec::new();
        let (mut used, mut written, mut counted) = (0, 0, 0);
        loop {
            let line = &self.lines.text()[used..];
            let at_end = line.is_empty() && !self.lines.is_complete();
            // A line break ends a last line that has none, unless it is within quotes.
            let (result, read, bytes, ends) = self.splitter.read_record(
                if at_end { b"\n" } else { line },
                &mut self.cells[written..],
                &mut self.ends[counted..],
            );
            used += if at_end { 0 } else { read };
            written += bytes;
            counted += ends;
            match result {
                ReadRecordResult::Record if !before.is_empty() && !self.is_width(counted) => {
                    return Ok(self.unclosed(before));
                }
                ReadRecordResult::Record => {
                    self.drop_carriage_return(counted);
                    let beyond = self.ends_in_separator && counted == self.width + 1;
                    let beyond = beyond && self.column(self.width).trim_ascii().is_empty();
                    return Ok(Record::Row {
                        cells: counted - usize::from(beyond),
                        complete: self.lines.is_complete(),
                    });
                }
                ReadRecordResult::OutputFull => self.cells.resize(2 * self.cells.len(), 0),
                ReadRecordResult::OutputEndsFull => self.ends.resize(2 * self.ends.len(), 0),
                ReadRecordResult::InputEmpty if self.lines.is_complete() => {
                    used = 0;
                    before.push(self.lines.take());
                    if !self.goes_on(&before)? {
                        return Ok(self.unclosed(before));
                    }
                }
                ReadRecordResult::InputEmpty if at_end => return Ok(Record::Cut),
                ReadRecordResult::InputEmpty => {}
                ReadRecordResult::End => return Ok(Record::End),
            }
        }
    }

    /// Whether a row over several lines may have so many cells. Of the names, none are known before.
    fn is_width(&self, cells: usize) -> bool {
        let names = self.names.len();
        let may_end_so = self.width == 0 || self.ends_in_separator;
        names == 0 || cells == names || cells == names + 1 && may_end_so
    }

    /// Leaves only the first of these lines to a row whose quoted cell began in it, and gives the others and the current one again.
    fn unclosed(&mut self, before: Vec<(u64, Vec<u8>)>) -> Record {
        let mut after: Vec<_> = before.into_iter().skip(1).collect();
        after.extend(self.lines.take_any());
        self.lines.hold(after);
        self.splitter.reset();
        Record::Unclosed
    }

    /// Goes to the next line of a quoted cell that began within these. It does not go on for long.
    fn goes_on(&mut self, before: &[(u64, Vec<u8>)]) -> Result<bool, FileError> {
        let bytes: usize = before.iter().map(|(_, line)| line.len()).sum();
        if before.len() >= LINES_OF_ROW || bytes > LONGEST_ROW {
            return Ok(false);
        }
        match self.lines.advance() {
            Err(error) if error.is_of_line() => Ok(false),
            more => more,
        }
    }

    /// A line may end in CR LF; only LF ends a record, so that a stray CR cannot shift the rest of a line.
    fn drop_carriage_return(&mut self, counted: usize) {
        if let Some(last) = counted.checked_sub(1)
            && self.column(last).ends_with(b"\r")
        {
            self.ends[last] -= 1;
        }
    }

    /// The cell of a column, if that is there; else an empty one.
    fn cell(&self, column: Option<usize>) -> &[u8] {
        column.map_or(&[], |column| self.column(column))
    }

    fn column(&self, index: usize) -> &[u8] {
        let start = if index == 0 { 0 } else { self.ends[index - 1] };
        &self.cells[start..self.ends[index]]
    }
}

impl Cells for CsvRows {
    fn advance(&mut self, ledger: &mut Ledger) -> Result<bool, FileError> {
        loop {
            let (cells, complete) = match self.read_record() {
                Ok(Record::Row { cells, complete }) if self.lines.may_be_row() => (cells, complete),
                Ok(Record::End) => return Ok(false),
                Ok(Record::Row { .. } | Record::Cut) => {
                    ledger.report.truncated = Some(self.place());
                    return Ok(false);
                }
                Ok(Record::Unclosed) => {
                    ledger.refuse_row(|| FileError::UnclosedQuote {
                        place: self.place(),
                    })?;
                    continue;
                }
                Err(error) if error.is_of_line() => {
                    ledger.refuse_row(|| error)?;
                    continue;
                }
                Err(error) => return Err(error),
            };
            let taken = match cells == self.width && !self.is_comment() {
                true => Some(true),
                false => self.unusual(cells, complete, ledger)?,
            };
            if let Some(taken) = taken {
                return Ok(taken);
            }
        }
    }

    fn time(&self, column: usize) -> &[u8] {
        self.cell(self.columns.time[column])
    }

    fn channel(&self, index: usize) -> &[u8] {
        self.cell(self.columns.channels[index])
    }

    fn place(&self) -> Place {
        self.lines.place_of(self.row_line)
    }

    fn take_header(&mut self, ledger: &mut Ledger) -> Result<bool, FileError> {
        self.takes_header(self.width, ledger)
    }
}

#[cfg(test)]
mod tests;
