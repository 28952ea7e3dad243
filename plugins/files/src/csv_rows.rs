//! CSV as rows of cells: header, quoting, ragged and cut-off rows. Not what a cell means.

use athermal_core::time::Civil;
use csv_core::{ReadRecordResult, ReaderBuilder, Terminator};

use crate::cell::{self, is_number, trim};
use crate::cells::Cells;
use crate::columns::{self, Columns};
use crate::glued::{bare_time, names_behind};
use crate::header::{self, Head};
use crate::ledger::{Ledger, Report};
use crate::lines::{LONGEST_ROW, Lines};
use crate::units::{self, are_units};
use crate::{FileError, Layout, LongFormat, Place};

/// The rows of a CSV file.
pub(crate) struct CsvRows {
    lines: Lines,
    splitter: csv_core::Reader,
    cells: Vec<u8>,
    ends: Vec<usize>,
    row_line: u64,
    delimiter: u8,
    names: Vec<String>,
    /// The first cells of the lines above the names.
    above: Vec<String>,
    /// The units in the row below the names; none where there is no such row.
    units: Vec<String>,
    /// How many cells a row has; 0 until the first row below the names.
    width: usize,
    /// Whether rows, but not the names, end in a delimiter.
    ends_in_delimiter: bool,
    layout: Option<Layout>,
    columns: Columns,
    /// The text of the time of the current row, where it is put together from several cells.
    joined: Option<Vec<u8>>,
    /// The last header, where it lacks columns, until the row below it tells whether it was cut off.
    doubted: Option<NamesAgain>,
}

/// The names of the columns where they stand within the log again.
struct NamesAgain {
    place: Place,
    names: Vec<String>,
    columns: Columns,
    lacking: Vec<String>,
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
    /// A quoted cell does not end: the row is its first line, which is this, and those after it are read anew.
    Unclosed(Vec<u8>),
}

/// How many rows are looked at to tell why a column is missing.
const LOOKED_AT: usize = 20;

/// Over how many lines a row can go, by line breaks in quotes.
const LINES_OF_ROW: usize = 50;

impl CsvRows {
    /// Reads the header and finds the wanted columns in it.
    pub fn new(lines: Lines, layout: &Layout, delimiter: Option<u8>) -> Result<Self, FileError> {
        let mut rows = Self::headed(lines, delimiter, Some(layout))?;
        rows.columns = Columns::of(layout, &rows.names);
        let lacking = rows.columns.lacking(layout);
        if lacking.is_empty() {
            return Ok(rows);
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

    fn missing(&self, lacking: Vec<&str>, names: &[String]) -> FileError {
        let assumed = std::str::from_utf8(self.lines.text()).is_err();
        columns::missing(self.place(), lacking, names, assumed)
    }

    /// Whether the current row is a comment; only where the header was one are others read.
    fn is_comment(&self) -> bool {
        self.lines.comments_count && self.column(0).trim_ascii_start().starts_with(b"#")
    }

    /// Reads the header, which a layout tells from what may stand above it; the delimiter, unless stated, is found with it.
    pub fn headed(
        mut lines: Lines,
        delimiter: Option<u8>,
        layout: Option<&Layout>,
    ) -> Result<Self, FileError> {
        let Head { delimiter, above } = header::seek(&mut lines, delimiter, layout)?;
        let splitter = ReaderBuilder::new()
            .delimiter(delimiter)
            .terminator(Terminator::Any(b'\n'))
            .build();
        let mut rows = Self {
            lines,
            splitter,
            cells: vec![0; 1024],
            ends: vec![0; 64],
            row_line: 0,
            delimiter,
            names: Vec::new(),
            above,
            units: Vec::new(),
            width: 0,
            ends_in_delimiter: false,
            layout: layout.cloned(),
            columns: Columns::default(),
            joined: layout
                .filter(|layout| !layout.time.columns.is_one())
                .map(|_| Vec::new()),
            doubted: None,
        };
        let cells = match rows.read_record()? {
            Record::Row { cells, .. } => cells,
            Record::Unclosed(_) | Record::Cut => {
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
        rows.names = rows.current(cells);
        columns::check_unique(&rows.names, || rows.place())?;
        Ok(rows)
    }

    /// The names in the header.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// The units in the row below the names; none where there is no such row, known once a row was read.
    pub fn units(&self) -> &[String] {
        &self.units
    }

    /// What stands between cells.
    pub fn delimiter(&self) -> u8 {
        self.delimiter
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
        if let Some(again) = self.doubted.take() {
            self.resolve(again, cells, ledger)?;
        }
        let expected = self.names.len();
        if self.width == 0 {
            let row = self.current(cells);
            let is_below_names = self.units.is_empty();
            if is_below_names && cells <= expected + 1 && are_units(&row) {
                self.units = row;
                self.units.resize(expected, String::new());
                self.report_units(&mut ledger.report);
                return Ok(None);
            }
            self.width = expected;
            self.ends_in_delimiter = cells == expected + 1 && row[expected].is_empty();
            if cells == expected || self.ends_in_delimiter {
                return Ok(Some(true));
            }
        }
        let place = self.place();
        if !complete && cells < expected {
            ledger.report.truncated = Some(place);
            return Ok(Some(false));
        }
        ledger.refuse_row(|| FileError::CellCount {
            place,
            expected,
            found: cells,
        })?;
        Ok(None)
    }

    fn report_units(&self, report: &mut Report) {
        let channels = self.layout.iter().flat_map(|layout| &layout.channels);
        for channel in channels {
            let at = self.names.iter().position(|name| *name == channel.column);
            let known = report
                .units
                .iter()
                .any(|(column, _)| *column == channel.column);
            if let Some(unit) = at
                .filter(|_| !known)
                .and_then(|at| units::unit(&self.units[at]))
            {
                report.units.push((channel.column.clone(), unit));
            }
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
        let is_above = self.above.contains(&columns::name(self.column(0)));
        if let Some(last) = (0..cells).rev().find(|&at| is_value(at)) {
            let is_behind = !is_above && ledger.is_lenient();
            let names = self.current(cells).split_off(last + 1);
            return Ok(is_above || is_behind && self.takes_names_behind(names, ledger)?);
        }
        let mut names = self.current(cells);
        if self.is_comment() {
            let first = names[0].trim_start().trim_start_matches('#');
            names[0] = first.trim().to_owned();
        }
        let columns = Columns::of(layout, &names);
        let lacking = columns.lacking(layout);
        if !lacking.is_empty() && is_above || !columns.are_named(layout) {
            let may_be_glued = !is_above && ledger.is_lenient();
            return Ok(is_above || may_be_glued && self.takes_names_behind(names, ledger)?);
        }
        if !lacking.is_empty() && !self.lines.is_complete() {
            ledger.report.truncated = Some(self.place());
            return Ok(true);
        }
        if !lacking.is_empty()
            && ledger.is_lenient()
            && let Some(names) = self.names_behind()
        {
            self.take_names_behind(names, ledger)?;
            return Ok(true);
        }
        let unusable = match columns::check_unique(&names, || self.place()) {
            Ok(()) if lacking.is_empty() || ledger.is_lenient() && columns.have_time() => None,
            Ok(()) => Some(self.missing(lacking.clone(), &names)),
            Err(error) => Some(error),
        };
        if let Some(error) = unusable {
            ledger.refuse_header(error)?;
            if !columns.agree_with(&self.columns) {
                // Rows have no time until the columns are named so that they can be told apart.
                self.columns.time.fill(None);
            }
            return Ok(true);
        }
        let again = NamesAgain {
            place: self.place(),
            lacking: lacking.into_iter().map(str::to_owned).collect(),
            names,
            columns,
        };
        self.width = 0;
        if again.lacking.is_empty() {
            self.take_names(again, ledger);
        } else {
            self.doubted = Some(again);
        }
        Ok(true)
    }

    /// All names that are known, where they stand behind the beginning of a row in the current line.
    fn names_behind(&self) -> Option<Vec<String>> {
        names_behind(self.lines.text(), self.delimiter, &self.names)
    }

    /// Takes the columns by names that stand behind the beginning of a row, up to its last value, if they do. Where they are not those
    /// known before, it is not known where rows from here on have what.
    fn takes_names_behind(
        &mut self,
        mut names: Vec<String>,
        ledger: &mut Ledger,
    ) -> Result<bool, FileError> {
        if let Some(names) = self.names_behind() {
            self.take_names_behind(names, ledger)?;
            return Ok(true);
        }
        let moved = self.layout.as_ref().is_some_and(|layout| {
            bare_time(&mut names, layout.time.columns.names(), self.delimiter);
            let columns = Columns::of(layout, &names);
            columns.are_named(layout) && !columns.agree_with(&self.columns)
        });
        if moved {
            ledger.refuse_row(|| FileError::HeaderBehind {
                place: self.place(),
                taken: false,
            })?;
            self.columns.time.fill(None);
        }
        Ok(moved)
    }

    fn take_names_behind(
        &mut self,
        names: Vec<String>,
        ledger: &mut Ledger,
    ) -> Result<(), FileError> {
        ledger.refuse_row(|| FileError::HeaderBehind {
            place: self.place(),
            taken: true,
        })?;
        let Some(layout) = &self.layout else {
            return Ok(());
        };
        let columns = Columns::of(layout, &names);
        let lacking = columns.lacking(layout).into_iter().map(str::to_owned);
        let again = NamesAgain {
            place: self.place(),
            lacking: lacking.collect(),
            names,
            columns,
        };
        self.take_names(again, ledger);
        Ok(())
    }

    /// Takes the columns by these names from here on.
    fn take_names(&mut self, again: NamesAgain, ledger: &mut Ledger) {
        ledger.header(FileError::HeaderAgain {
            place: again.place,
            moved: again.columns != self.columns,
            lacking: again.lacking,
        });
        (self.names, self.columns) = (again.names, again.columns);
        self.units.clear();
        self.width = 0;
        self.ends_in_delimiter = false;
        self.doubted = None;
    }

    /// Takes the columns by a header that lacks some, save where it was cut off: the row below it is then as wide as those before.
    fn resolve(
        &mut self,
        again: NamesAgain,
        cells: usize,
        ledger: &mut Ledger,
    ) -> Result<(), FileError> {
        let (before, found) = (self.names.len(), again.names.len());
        let is_as_before = cells == before || cells == before + 1;
        if cells == found || !is_as_before {
            self.take_names(again, ledger);
            return Ok(());
        }
        ledger.refuse_header(FileError::CellCount {
            place: again.place,
            expected: before,
            found,
        })
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
                    let beyond = self.ends_in_delimiter && counted == self.width + 1;
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
        let may_end_so = self.width == 0 || self.ends_in_delimiter;
        names == 0 || cells == names || cells == names + 1 && may_end_so
    }

    /// Leaves only the first of these lines to a row whose quoted cell began in it, and gives the others and the current one again.
    fn unclosed(&mut self, before: Vec<(u64, Vec<u8>)>) -> Record {
        let mut lines = before.into_iter();
        let (_, first) = lines.next().unwrap_or_default();
        let mut after: Vec<_> = lines.collect();
        after.extend(self.lines.take_any());
        self.lines.hold(after);
        self.splitter.reset();
        Record::Unclosed(first)
    }

    /// Goes to the next line of a quoted cell that began within these. It does not go on for long, nor in what is a row by itself.
    fn goes_on(&mut self, before: &[(u64, Vec<u8>)]) -> Result<bool, FileError> {
        let bytes: usize = before.iter().map(|(_, line)| line.len()).sum();
        if before.len() >= LINES_OF_ROW || bytes > LONGEST_ROW {
            return Ok(false);
        }
        match self.lines.advance() {
            Ok(more) => Ok(more && !self.is_row_by_itself()),
            Err(error) if error.is_of_line() => Ok(false),
            Err(error) => Err(error),
        }
    }

    /// Whether the current line has as many cells as a row, and a time, be its quotes taken for such or not.
    fn is_row_by_itself(&self) -> bool {
        let line = self.lines.text();
        let line = line.strip_suffix(b"\n").unwrap_or(line);
        let line = line.strip_suffix(b"\r").unwrap_or(line);
        let plain = line.split(|&byte| byte == self.delimiter);
        let plain: Vec<String> = plain.map(columns::name).collect();
        [plain, columns::names_in(line, self.delimiter)]
            .iter()
            .any(|cells| header::is_of_width(cells, self.names.len()) && self.have_time(cells))
    }

    /// Whether these cells have a time where the columns have it.
    fn have_time(&self, cells: &[String]) -> bool {
        let Some(layout) = &self.layout else {
            return cells.first().is_some_and(|first| header::is_value(first));
        };
        let cell = |column: usize| {
            let at = self.columns.time.get(column).copied().flatten();
            at.map_or(&[][..], |at| cells[at].as_bytes())
        };
        let mut time = Vec::new();
        layout.time.columns.join(&mut time, cell);
        let time = cell::text(&time);
        let read = layout
            .time
            .read(cell::with_decimal_point(&time).as_bytes(), None);
        matches!(read, Some(Civil::At(_)))
    }

    /// A line may end in CR LF; only LF ends a record, so that a stray CR cannot shift the rest of a line.
    fn drop_carriage_return(&mut self, counted: usize) {
        if let Some(last) = counted.checked_sub(1)
            && self.column(last).ends_with(b"\r")
        {
            self.ends[last] -= 1;
        }
    }

    /// Puts the time of the current row together.
    fn join_time(&mut self) {
        let mut text = self.joined.take().unwrap_or_default();
        if let Some(layout) = &self.layout {
            let cell = |column: usize| trim(self.cell(self.columns.time[column]));
            layout.time.columns.join(&mut text, cell);
        }
        self.joined = Some(text);
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
                Ok(Record::Unclosed(line)) => {
                    let behind = names_behind(&line, self.delimiter, &self.names);
                    match behind.filter(|_| ledger.is_lenient()) {
                        Some(names) => self.take_names_behind(names, ledger)?,
                        None => ledger.refuse_row(|| FileError::UnclosedQuote {
                            place: self.place(),
                        })?,
                    }
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
                if taken && self.joined.is_some() {
                    self.join_time();
                }
                return Ok(taken);
            }
        }
    }

    fn time(&self) -> &[u8] {
        match &self.joined {
            Some(joined) => joined,
            None => self.cell(self.columns.time.first().copied().flatten()),
        }
    }

    fn channel(&self, index: usize) -> &[u8] {
        self.cell(self.columns.channels[index])
    }

    fn decimal_comma(&self) -> bool {
        self.delimiter != b','
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
