//! Rows of a recording in either format: instants that advance, values or absence. Not how the bytes are cut into cells.

use std::io::Read;
use std::path::Path;

use crate::cell::{self, Cells};
use crate::csv_rows::CsvRows;
use crate::error::excerpt;
use crate::instant::has_zone;
use crate::json_rows::JsonRows;
use crate::ledger::Ledger;
use crate::lines::Lines;
use crate::{FileError, Format, Layout, Place, Report, TimeForm};

/// How a recording is to be read.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Options {
    /// The format; by default what the name of the file says, else its first byte.
    pub format: Option<Format>,
    /// What stands between the cells of CSV; by default the one of `,` `;` tab `|` that fits the header best.
    pub delimiter: Option<u8>,
    /// Take a cell that cannot be read as absent and leave a broken row out, counted, instead of stopping with an error.
    pub lenient: bool,
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
/// A row is left out and counted when its time is not after the one before. A last line without an end that lacks cells
/// (CSV) or is no whole object (JSON lines) was cut off while it was written: it is left out and reported, never an error.
pub struct Reader {
    rows: Rows,
    layout: Layout,
    ledger: Ledger,
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
        let path = path.as_ref();
        let format = options.format.or_else(|| Format::from_path(path));
        Self::from_lines(Lines::open(path)?, layout, Options { format, ..options })
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
        Self::from_lines(Lines::new(name.into(), Box::new(input)), layout, options)
    }

    fn from_lines(mut lines: Lines, layout: Layout, options: Options) -> Result<Self, FileError> {
        let rows = match lines.format_or(options.format)? {
            Format::Csv => Rows::Csv(Box::new(CsvRows::new(lines, &layout, options.delimiter)?)),
            Format::JsonLines => Rows::Json(Box::new(JsonRows::new(lines, &layout)?)),
        };
        Ok(Self {
            rows,
            layout,
            ledger: Ledger::new(options.lenient),
        })
    }

    /// Reads the next row into `row`; false at the end of the recording.
    ///
    /// # Errors
    /// A cell, row or line that cannot be read, with its place, unless [`Options::lenient`]; at the end of JSON lines also
    /// a channel that no line had.
    pub fn next_into(&mut self, row: &mut Row) -> Result<bool, FileError> {
        match &mut self.rows {
            Rows::Csv(rows) => next(rows.as_mut(), &self.layout, &mut self.ledger, row),
            Rows::Json(rows) => next(rows.as_mut(), &self.layout, &mut self.ledger, row),
        }
    }

    /// Tells of what is met for the first time as soon as it is: who reads what never ends gets no report at its end.
    pub fn tell_first(&mut self, tell: impl FnMut(&FileError) + Send + 'static) {
        self.ledger.tell = Some(Box::new(tell));
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

fn next<C: Cells>(
    rows: &mut C,
    layout: &Layout,
    ledger: &mut Ledger,
    row: &mut Row,
) -> Result<bool, FileError> {
    while rows.advance(ledger)? {
        if let Some(time_ns) = read_time(rows, layout, ledger, &mut row.time_text)?
            && ledger.accepts(time_ns, cell::trim(rows.time()), || rows.place())
        {
            row.time_ns = time_ns;
            read_values(rows, layout, ledger, &mut row.values)?;
            return Ok(true);
        }
    }
    Ok(false)
}

/// The instant of the current row, and its text; `None` when the row is left out for want of one.
fn read_time<C: Cells>(
    rows: &C,
    layout: &Layout,
    ledger: &mut Ledger,
    text: &mut String,
) -> Result<Option<i64>, FileError> {
    let cell = cell::trim(rows.time());
    text.clear();
    let time = &layout.time;
    let time_ns = match std::str::from_utf8(cell) {
        Ok(cell) => {
            text.push_str(cell);
            if rows.decimal_comma()
                && let Some(comma) = cell::single_comma(cell.as_bytes())
            {
                text.replace_range(comma..=comma, ".");
            }
            time.form.read(text.as_bytes())
        }
        Err(_) => None,
    };
    if time_ns.is_none() {
        ledger.refuse_row(|| {
            let (place, column, found) = (rows.place(), time.column.clone(), excerpt(cell));
            if time.form.is_beyond(text.as_bytes()) {
                return FileError::TimeBeyond {
                    place,
                    column,
                    found,
                };
            }
            FileError::BadTime {
                place,
                column,
                found,
                expected: time.form.expected(),
            }
        })?;
    } else if time.form == TimeForm::Rfc3339 {
        let report = &mut ledger.report;
        if report.without_zone.is_none() && !has_zone(text.as_bytes()) {
            report.without_zone = Some(rows.place());
        }
    } else if rows.decimal_comma()
        && let Some(mark) = ledger.other_time_mark(cell, || rows.place().line)
    {
        ledger.refuse_row(|| mixed(rows.place(), &time.column, cell, mark))?;
        return Ok(None);
    }
    Ok(time_ns)
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
mod tests {
    use std::io;
    use std::sync::Arc;

    use super::*;

    fn layout(form: TimeForm) -> Layout {
        Layout::new("t", form, ["a"])
    }

    fn lenient() -> Options {
        Options {
            lenient: true,
            ..Options::default()
        }
    }

    fn rows(reader: &mut Reader) -> Vec<(i64, String)> {
        let mut row = Row::default();
        let mut rows = Vec::new();
        while reader.next_into(&mut row).unwrap() {
            rows.push((row.time_ns, row.time_text.clone()));
        }
        rows
    }

    #[test]
    fn a_row_whose_time_repeats_or_steps_back_is_left_out_and_counted() {
        let text = &b"t,a\n0,1\n10,1\n10,off\n5,1\n10.5,1\n"[..];
        let mut reader =
            Reader::from_read("f.csv", text, layout(TimeForm::SECONDS), Options::default())
                .unwrap();
        let times: Vec<String> = rows(&mut reader)
            .into_iter()
            .map(|(_, text)| text)
            .collect();
        assert_eq!(times, ["0", "10", "10.5"]);
        let refused = &reader.report().refused_time;
        assert_eq!(refused.count, 2);
        assert_eq!(
            refused.first.as_ref().unwrap().to_string(),
            "f.csv:4: the time `10` is not after `10`; the row was left out"
        );
    }

    #[test]
    fn a_time_that_steps_back_is_told_as_the_file_has_it() {
        let told = |text: &'static str, form| {
            let mut reader =
                Reader::from_read("f.csv", text.as_bytes(), layout(form), Options::default())
                    .unwrap();
            assert_eq!(rows(&mut reader).len(), 1);
            let refused = &reader.report().refused_time;
            refused.first.as_ref().unwrap().to_string()
        };
        assert_eq!(
            told(
                "t,a\n2026-03-02T08:30:00+01:00,1\n2026-03-02T07:29:30+01:00,1\n",
                TimeForm::Rfc3339
            ),
            "f.csv:3: the time `2026-03-02T07:29:30+01:00` is not after `2026-03-02T08:30:00+01:00`; the row was left out"
        );
        assert_eq!(
            told("t;a\n1,50;1\n 1,25 ;1\n", TimeForm::SECONDS),
            "f.csv:3: the time `1,25` is not after `1,50`; the row was left out"
        );
    }

    #[test]
    fn the_text_of_the_time_is_kept_for_every_form() {
        let cases: [(TimeForm, &str, i64, i64); 3] = [
            (
                TimeForm::Numbers {
                    ns_per_unit: 1_000_000,
                },
                "t,a\n 0.50,1\n1e3 ,1\n",
                500_000,
                1_000_000_000,
            ),
            (
                TimeForm::Samples { step_ns: 80 },
                "t,a\n1,1\n2,1\n",
                80,
                160,
            ),
            (
                TimeForm::Rfc3339,
                "t,a\n1970-01-01 00:00:01,1\n\"1970-01-01T00:00:02Z\",1\n",
                1_000_000_000,
                2_000_000_000,
            ),
        ];
        for (form, text, first, second) in cases {
            let mut reader =
                Reader::from_read("f", text.as_bytes(), layout(form), Options::default()).unwrap();
            let rows = rows(&mut reader);
            assert_eq!([rows[0].0, rows[1].0], [first, second]);
            for (_, time) in rows {
                assert!(
                    text.contains(&time) && time.trim() == time && !time.contains('"'),
                    "{time}"
                );
            }
        }
    }

    #[test]
    fn a_time_that_cannot_be_read_is_an_error_or_the_row_is_left_out() {
        let text = "t,a\n0,1\n,1\nnan,1\nsoon,1\n1,1\n";
        let mut reader = Reader::from_read(
            "f.csv",
            text.as_bytes(),
            layout(TimeForm::SECONDS),
            Options::default(),
        )
        .unwrap();
        let mut row = Row::default();
        assert!(reader.next_into(&mut row).unwrap());
        let error = reader.next_into(&mut row).unwrap_err().to_string();
        assert!(
            error.starts_with("f.csv:3: column `t`: expected a decimal number, found nothing"),
            "{error}"
        );
        let mut reader = Reader::from_read(
            "f.csv",
            text.as_bytes(),
            layout(TimeForm::SECONDS),
            lenient(),
        )
        .unwrap();
        assert_eq!(rows(&mut reader).len(), 2);
        assert_eq!(reader.report().refused_rows.count, 3);
    }

    #[test]
    fn a_lenient_reader_takes_bad_cells_as_absent_and_keeps_the_first() {
        let text = "t,a\n0,1\n1,NA\n2,-\n3,4\n";
        let mut reader = Reader::from_read(
            "f.csv",
            text.as_bytes(),
            layout(TimeForm::SECONDS),
            lenient(),
        )
        .unwrap();
        assert_eq!(rows(&mut reader).len(), 4);
        let bad = &reader.report().bad_cells;
        assert_eq!(bad.count, 2);
        assert!(
            matches!(&bad.first, Some(FileError::BadCell { place, found, .. }) if place.line == 3 && found == "NA")
        );
        let of_channel = &reader.report().bad_cells_of[0];
        assert_eq!(of_channel.count, 2);
        assert!(of_channel.first.is_some());
    }

    /// Gives one line per call, and knows how many it gave.
    struct LineByLine {
        lines: std::array::IntoIter<&'static str, 4>,
        given: Arc<std::sync::atomic::AtomicUsize>,
    }

    impl Read for LineByLine {
        fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
            let line = self.lines.next().unwrap_or_default();
            buffer[..line.len()].copy_from_slice(line.as_bytes());
            self.given
                .fetch_add(1, std::sync::atomic::Ordering::Relaxed);
            Ok(line.len())
        }
    }

    #[test]
    fn a_row_is_given_as_soon_as_its_line_is_there() {
        let csv = ["t,a\n", "0,1\n", "1,2\r\n", "2,3\n"];
        let json = [
            "\n",
            "{\"t\":0,\"a\":1}\n",
            "{\"t\":1,\"a\":2}\r\n",
            "{\"t\":2,\"a\":3}\n",
        ];
        for lines in [csv, json] {
            let given = Arc::new(std::sync::atomic::AtomicUsize::new(0));
            let input = LineByLine {
                lines: lines.into_iter(),
                given: given.clone(),
            };
            let mut reader =
                Reader::from_read("pipe", input, layout(TimeForm::SECONDS), Options::default())
                    .unwrap();
            let mut row = Row::default();
            for lines_needed in [2, 3, 4] {
                assert!(reader.next_into(&mut row).unwrap());
                assert_eq!(
                    given.load(std::sync::atomic::Ordering::Relaxed),
                    lines_needed
                );
                assert_eq!(row.values, [lines_needed as f64 - 1.0]);
            }
        }
    }

    #[test]
    fn a_file_that_is_not_there_is_an_error_that_names_it() {
        let opened = Reader::open(
            "no-such-file.csv",
            layout(TimeForm::SECONDS),
            Options::default(),
        );
        let error = opened.err().unwrap().to_string();
        assert!(
            error.starts_with("no-such-file.csv: cannot be opened: "),
            "{error}"
        );
    }
}
