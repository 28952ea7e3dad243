//! CSV as rows of cells: header, quoting, ragged and cut-off rows. Not what a cell means.

use csv_core::{ReadRecordResult, ReaderBuilder, Terminator};

use crate::cell::Cells;
use crate::columns;
use crate::ledger::Ledger;
use crate::lines::{LONGEST_ROW, Lines};
use crate::{FileError, Layout, Place};

/// The rows of a CSV file.
pub(crate) struct CsvRows {
    lines: Lines,
    splitter: csv_core::Reader,
    cells: Vec<u8>,
    ends: Vec<usize>,
    row_line: u64,
    delimiter: u8,
    names: Vec<String>,
    time: usize,
    channels: Vec<Option<usize>>,
}

/// How a row came out of the stream.
enum Record {
    End,
    Row { cells: usize, complete: bool },
}

impl CsvRows {
    /// Reads the header and finds the wanted columns in it.
    pub fn new(lines: Lines, layout: &Layout, delimiter: Option<u8>) -> Result<Self, FileError> {
        let mut rows = Self::headed(lines, delimiter, layout.names())?;
        let at = |name: &str| columns::position(&rows.names, name);
        let time = at(&layout.time.column);
        let channels: Vec<_> = layout
            .channels
            .iter()
            .map(|channel| at(&channel.column))
            .collect();
        let lacks_time = time.is_none().then_some(layout.time.column.as_str());
        let lacking = layout.channels.iter().zip(&channels);
        let lacking = lacking.filter(|(channel, at)| at.is_none() && !channel.optional);
        let mut missing = lacks_time
            .into_iter()
            .chain(lacking.map(|(channel, _)| channel.column.as_str()))
            .peekable();
        if missing.peek().is_some() {
            let assumed = std::str::from_utf8(rows.lines.text()).is_err();
            return Err(columns::missing(
                rows.place(),
                missing,
                &rows.names,
                assumed,
            ));
        }
        rows.channels = channels;
        rows.time = time.unwrap_or_default();
        Ok(rows)
    }

    /// Reads the header; the delimiter, unless stated, is the one that shows the most of the wanted columns.
    pub fn headed<'a>(
        mut lines: Lines,
        delimiter: Option<u8>,
        wanted: impl Iterator<Item = &'a str> + Clone,
    ) -> Result<Self, FileError> {
        if !lines.advance_to_content()? {
            return Err(FileError::Empty { file: lines.file });
        }
        let no_text = |byte: &u8| byte.is_ascii_control() && !byte.is_ascii_whitespace();
        if lines.text().iter().any(no_text) {
            return Err(FileError::NotText {
                place: lines.place(),
            });
        }
        let delimiter =
            delimiter.unwrap_or_else(|| columns::choose_delimiter(lines.text(), wanted));
        lines.hold();
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
            time: 0,
            channels: Vec::new(),
        };
        let Record::Row { cells, .. } = rows.read_record()? else {
            return Err(FileError::Empty {
                file: rows.lines.file,
            });
        };
        rows.names = (0..cells).map(|i| columns::name(rows.column(i))).collect();
        columns::check_unique(&rows.names, || rows.place())?;
        Ok(rows)
    }

    /// The names in the header.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// What stands between cells.
    pub fn delimiter(&self) -> u8 {
        self.delimiter
    }

    /// The texts of the current row.
    pub fn texts(&self) -> Vec<String> {
        (0..self.names.len())
            .map(|i| columns::name(self.column(i)))
            .collect()
    }

    /// Reads one record into `cells`, over several lines if it has line breaks in quotes.
    fn read_record(&mut self) -> Result<Record, FileError> {
        if !self.lines.advance_to_content()? {
            return Ok(Record::End);
        }
        self.row_line = self.lines.number();
        let (mut used, mut written, mut counted) = (0, 0, 0);
        loop {
            let line = &self.lines.text()[used..];
            let (result, read, bytes, ends) = self.splitter.read_record(
                line,
                &mut self.cells[written..],
                &mut self.ends[counted..],
            );
            used += read;
            written += bytes;
            counted += ends;
            match result {
                ReadRecordResult::Record => {
                    self.drop_carriage_return(counted);
                    return Ok(Record::Row {
                        cells: counted,
                        complete: self.lines.is_complete(),
                    });
                }
                ReadRecordResult::OutputFull if written >= LONGEST_ROW => {
                    return Err(FileError::UnclosedQuote {
                        place: self.lines.place_of(self.row_line),
                    });
                }
                ReadRecordResult::OutputFull => self.cells.resize(2 * self.cells.len(), 0),
                ReadRecordResult::OutputEndsFull => self.ends.resize(2 * self.ends.len(), 0),
                ReadRecordResult::InputEmpty if self.lines.is_complete() => {
                    used = 0;
                    if !self.lines.advance()? {
                        return Err(FileError::UnclosedQuote {
                            place: self.lines.place_of(self.row_line),
                        });
                    }
                }
                // The next call sees an empty input, which ends the record.
                ReadRecordResult::InputEmpty if self.row_line == self.lines.number() => {}
                ReadRecordResult::InputEmpty => {
                    return Err(FileError::UnclosedQuote {
                        place: self.lines.place_of(self.row_line),
                    });
                }
                ReadRecordResult::End => return Ok(Record::End),
            }
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

    fn column(&self, index: usize) -> &[u8] {
        let start = if index == 0 { 0 } else { self.ends[index - 1] };
        &self.cells[start..self.ends[index]]
    }
}

impl Cells for CsvRows {
    fn advance(&mut self, ledger: &mut Ledger) -> Result<bool, FileError> {
        loop {
            let Record::Row { cells, complete } = self.read_record()? else {
                return Ok(false);
            };
            let expected = self.names.len();
            if cells == expected {
                return Ok(true);
            }
            let place = self.lines.place_of(self.row_line);
            if !complete && cells < expected {
                ledger.report.truncated = Some(place);
                return Ok(false);
            }
            ledger.refuse_row(|| FileError::CellCount {
                place,
                expected,
                found: cells,
            })?;
        }
    }

    fn time(&self) -> &[u8] {
        self.column(self.time)
    }

    fn channel(&self, index: usize) -> &[u8] {
        self.channels[index].map_or(&[], |column| self.column(column))
    }

    fn decimal_comma(&self) -> bool {
        self.delimiter != b','
    }

    fn place(&self) -> Place {
        self.lines.place_of(self.row_line)
    }
}

#[cfg(test)]
mod tests {
    use crate::{FileError, Layout, Options, Reader, Row, TimeForm};

    fn reader(text: &str, options: Options) -> Result<Reader, FileError> {
        let layout = Layout::new("t", TimeForm::SECONDS, ["a", "b"]);
        Reader::from_read(
            "f.csv",
            std::io::Cursor::new(text.to_owned()),
            layout,
            options,
        )
    }

    /// All rows as text, the way `{:?}` shows numbers, and the reader for its report.
    fn read_with(text: &str, options: Options) -> (String, Reader) {
        let mut reader = reader(text, options).unwrap();
        let mut row = Row::default();
        let mut told = Vec::new();
        while reader.next_into(&mut row).unwrap() {
            told.push(format!("{} {:?}", row.time_text, row.values));
        }
        (told.join("; "), reader)
    }

    fn read(text: &str) -> String {
        read_with(text, Options::default()).0
    }

    /// The message of the first error.
    fn error(text: &str) -> String {
        let mut reader = match reader(text, Options::default()) {
            Ok(reader) => reader,
            Err(error) => return error.to_string(),
        };
        let mut row = Row::default();
        loop {
            match reader.next_into(&mut row) {
                Ok(true) => {}
                Ok(false) => panic!("there was no error"),
                Err(error) => return error.to_string(),
            }
        }
    }

    fn lenient() -> Options {
        Options {
            lenient: true,
            ..Options::default()
        }
    }

    const TWO_ROWS: &str = "0 [1.0, 2.5]; 1 [3.0, NaN]";

    #[test]
    fn every_delimiter_is_recognised() {
        for delimiter in [",", ";", "\t", "|"] {
            let text = "t,b,skipped,a\n0,2.5,x,1\n1,,y,3\n".replace(',', delimiter);
            assert_eq!(read(&text), TWO_ROWS, "{delimiter:?}");
        }
    }

    #[test]
    fn a_stated_delimiter_is_taken() {
        let options = Options {
            delimiter: Some(b'/'),
            ..Options::default()
        };
        assert_eq!(read_with("t/a/b\n0/1/2.5\n", options).0, "0 [1.0, 2.5]");
    }

    #[test]
    fn a_decimal_comma_is_read_where_something_else_than_a_comma_separates() {
        for delimiter in [";", "\t", "|"] {
            let text = "t;a;b\n0,5;1,5;-2,25e1\n".replace(';', delimiter);
            assert_eq!(read(&text), "0.5 [1.5, -22.5]", "{delimiter:?}");
            let mixed = "t;a;b\n0;1,5;2\n1;1.5;2\n".replace(';', delimiter);
            assert!(error(&mixed).contains("with the decimal mark `,`"));
        }
        assert!(error("t,a,b\n0,\"1,5\",2\n").contains("`1,5`"));
    }

    #[test]
    fn a_file_has_one_decimal_mark() {
        let mixed = "t;a;b\n0;1,5;2\n1;1;1.234\n2;7;2,5\n";
        assert_eq!(
            error(mixed),
            "f.csv:3: column `b`: expected a number with the decimal mark `,`, as in line 2, found `1.234`; write all numbers of a file with one mark, or read leniently (`--lenient`) to leave out those with another"
        );
        let (rows, reader) = read_with(mixed, lenient());
        assert_eq!(rows, "0 [1.5, 2.0]; 1 [1.0, NaN]; 2 [7.0, 2.5]");
        assert_eq!(reader.report().bad_cells.count, 1);
        let times = "t;a;b\n0.5;1.5;2\n1,5;1;1\n2.5;7;3\n";
        assert!(error(times).starts_with("f.csv:3: column `t`: expected a number with the decimal mark `.`, as in line 2, found `1,5`"));
        let (rows, reader) = read_with(times, lenient());
        assert_eq!(rows, "0.5 [1.5, 2.0]; 2.5 [7.0, 3.0]");
        assert_eq!(reader.report().refused_rows.count, 1);
        assert_eq!(
            read("t;a;b\n0.5;1.5;2\n1;1;2.5\n"),
            "0.5 [1.5, 2.0]; 1 [1.0, 2.5]"
        );
    }

    #[test]
    fn times_may_have_another_mark_than_values() {
        assert_eq!(
            read("t;a;b\n0.5;1,5;2\n1.5;1;2,5\n"),
            "0.5 [1.5, 2.0]; 1.5 [1.0, 2.5]"
        );
    }

    #[test]
    fn the_seconds_of_a_date_may_have_another_mark_than_numbers() {
        let layout = Layout::new("t", TimeForm::Rfc3339, ["a"]);
        let text = &b"t;a\n2013-07-04T00:00:00.5Z;1,5\n"[..];
        let mut reader = Reader::from_read("f", text, layout, Options::default()).unwrap();
        let mut row = Row::default();
        assert!(reader.next_into(&mut row).unwrap());
        assert_eq!(row.values, [1.5]);
    }

    #[test]
    fn marks_of_other_programs_do_no_harm() {
        assert_eq!(read("\u{feff}t,a,b\r\n0,1,2.5\r\n1,3,\r\n"), TWO_ROWS);
        assert_eq!(
            read("# note\n\nt,a,b\n\n0,1,2.5\n  \n# 1,1,1\n1,3,\n\n"),
            TWO_ROWS
        );
        assert_eq!(read(" t , \"a\" ,b\n 0 , 1, 2.5 \n1,3, \n"), TWO_ROWS);
    }

    #[test]
    fn quoted_names_and_cells_are_read() {
        let text = "\"t\",\"a\",\"b\",\"a, \"\"quoted\"\" note\"\n\"0\",\"1\",2.5,\"x, y\nz\"\n1,3,\"\",\"\"\n";
        assert_eq!(read(text), TWO_ROWS);
    }

    #[test]
    fn a_row_keeps_its_line_after_comments_and_quoted_line_breaks() {
        assert_eq!(
            error("# one\nt,a,b\n0,\"1\n\",2\n\n# six\n1,off,2\n"),
            "f.csv:7: column `a`: expected a number, found `off`; leave the cell empty where there is no value, or read leniently (`--lenient`) to take it as absent"
        );
    }

    #[test]
    fn a_doubled_name_is_an_error() {
        assert!(error("t,a,b,a\n").starts_with("f.csv:1: the name `a` stands at columns 2 and 4"));
    }

    #[test]
    fn a_missing_column_is_an_error_that_lists_those_found() {
        assert_eq!(
            error("t,a,bb\n0,1,2\n"),
            "f.csv:1: there is no column `b`; found `t`, `a`, `bb`; did you mean `bb`?"
        );
        assert!(
            error("time,a,b\n")
                .starts_with("f.csv:1: there is no column `t`; found `time`, `a`, `b`")
        );
    }

    #[test]
    fn all_missing_columns_are_told_at_once_and_an_optional_one_is_not() {
        let mut layout = Layout::new("t", TimeForm::SECONDS, ["room", "plate", "chuck", "room"]);
        layout.channels[1].optional = true;
        let file = &b"time,chuk,rooms\n0,1,2\n"[..];
        let error = Reader::from_read("f.csv", file, layout, Options::default()).err();
        assert_eq!(
            error.unwrap().to_string(),
            "f.csv:1: there are no columns `t`, `room`, `chuck`; found `time`, `chuk`, `rooms`; did you mean `rooms` for `room`, `chuk` for `chuck`? otherwise correct the names, or make optional those that are channels"
        );
    }

    #[test]
    fn an_optional_column_that_is_missing_is_absent_throughout() {
        let mut layout = Layout::new("t", TimeForm::SECONDS, ["a", "b"]);
        layout.channels[0].optional = true;
        let mut reader =
            Reader::from_read("f.csv", &b"t,b\n0,1\n1,2\n"[..], layout, Options::default())
                .unwrap();
        let mut row = Row::default();
        for expected in [1.0, 2.0] {
            assert!(reader.next_into(&mut row).unwrap());
            assert!(row.values[0].is_nan());
            assert_eq!(row.values[1], expected);
        }
    }

    #[test]
    fn a_row_of_another_length_is_an_error_or_left_out() {
        let text = "t,a,b\n0,1,2.5\n5,1\n6,1,2,3\n1,3,\n";
        assert_eq!(
            error(text),
            "f.csv:3: 2 cells where the header has 3; correct the row, or read leniently (`--lenient`) to leave it out"
        );
        let (rows, reader) = read_with(text, lenient());
        assert_eq!(rows, TWO_ROWS);
        assert_eq!(reader.report().refused_rows.count, 2);
        assert_eq!(reader.report().rows, 2);
    }

    #[test]
    fn a_last_line_that_was_cut_off_is_reported_and_the_rest_used() {
        let (rows, reader) = read_with("t,a,b\n0,1,2.5\n1,3,\n2,4", Options::default());
        assert_eq!(rows, TWO_ROWS);
        assert_eq!(
            reader.report().truncated.as_ref().map(|place| place.line),
            Some(4)
        );
        assert_eq!(reader.report().refused_rows.count, 0);
    }

    #[test]
    fn a_last_line_with_all_cells_but_no_end_is_complete() {
        let (rows, reader) = read_with("t,a,b\n0,1,2.5\n1,3,", Options::default());
        assert_eq!(rows, TWO_ROWS);
        assert!(reader.report().truncated.is_none());
    }

    #[test]
    fn a_quote_that_is_never_closed_is_an_error_at_its_row() {
        assert!(
            error("t,a,b\n0,1,\"2\n1,3,\n2,4,5\n")
                .starts_with("f.csv:2: a quoted cell starts here")
        );
        let endless = format!("t,a,b\n0,1,\"{}", "2\n".repeat(1_000_000));
        assert!(error(&endless).starts_with("f.csv:2: a quoted cell starts here"));
    }

    #[test]
    fn an_empty_file_and_one_without_rows_differ() {
        assert!(matches!(
            reader("", Options::default()),
            Err(FileError::Empty { .. })
        ));
        assert!(matches!(
            reader("# only\n\n", Options::default()),
            Err(FileError::Empty { .. })
        ));
        assert_eq!(read("t,a,b\n"), "");
        assert_eq!(read("t,a,b"), "");
    }

    #[test]
    fn names_as_a_windows_program_writes_them_are_read() {
        let layout = |name| Layout::new("t", TimeForm::SECONDS, [name]);
        let log = &b"t;W\xe4rme [\xb0C]\n0;21,5\n"[..];
        let read = |name| Reader::from_read("f.csv", log, layout(name), Options::default());
        let mut row = Row::default();
        assert!(read("Wärme [°C]").unwrap().next_into(&mut row).unwrap());
        assert_eq!(row.values, [21.5]);
        assert_eq!(
            read("温度").err().unwrap().to_string(),
            "f.csv:1: there is no column `温度`; found `t`, `Wärme [°C]` (read as Windows-1252, since they are not in UTF-8); \
             correct the name, or make it optional if it is a channel"
        );
    }

    #[test]
    fn two_byte_text_without_a_mark_is_refused_with_advice() {
        let layout = Layout::new("t", TimeForm::SECONDS, ["a"]);
        let utf16 = b"t\0,\0a\0\n\0";
        let refused = Reader::from_read("f.csv", &utf16[..], layout, Options::default());
        assert!(matches!(refused, Err(FileError::NotText { place }) if place.line == 1));
    }
}
