//! Decides what a file that an earlier run wrote holds, so that another can go on with it. Not what is written next.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Cursor, Read, Seek, SeekFrom};
use std::path::Path;
use std::sync::Arc;

use athermal_core::document::{Separator, TableBase, TableFormat};
use athermal_core::time::{Civil, Instant};

use crate::csv_rows::CsvRows;
use crate::error::quoted;
use crate::lines::{LONGEST_ROW, Lines};
use crate::{Description, FileError, Format, Layout, Options, Reader, Row, TimeColumn};

/// A file that was begun.
pub(crate) struct Begun {
    /// How many bytes its whole lines are; what comes after them was cut off.
    pub length: u64,
    /// The instant of its last row, if it has one.
    pub last_ns: Option<i64>,
}

impl Begun {
    /// Looks at a file; none where it is empty or no file. `seen` is what is known to have been read when it was written, which may
    /// decide what a time means that comes twice.
    ///
    /// # Errors
    /// The file cannot be read, or is not one with these columns.
    pub fn of(
        path: &Path,
        format: Format,
        time: &TimeColumn,
        columns: &[String],
        seen: Option<Instant>,
    ) -> Result<Option<Self>, FileError> {
        if !path.metadata().is_ok_and(|of| of.is_file() && of.len() > 0) {
            return Ok(None);
        }
        let file: Arc<str> = path.display().to_string().into();
        let ends = Ends::of(path).map_err(|source| FileError::cannot_open(path, source))?;
        let other = |reason: String| FileError::NotBegun {
            file: file.clone(),
            reason,
        };
        // Only a part of the file is read, whose lines are counted from where it begins.
        let of_line = |line: &str, error: FileError| {
            let message = match (&error, format) {
                (FileError::Empty { .. }, Format::JsonLines) => "it is no JSON object".to_owned(),
                (FileError::Empty { .. }, _) => "it names no columns".to_owned(),
                _ => error.to_string(),
            };
            let place = error.place().map(|place| format!("{place}: "));
            let what = place.and_then(|place| message.strip_prefix(&place));
            other(format!("{line}: {}", what.unwrap_or(&message)))
        };
        let ends = ends.ok_or_else(|| other("it has no whole line".to_owned()))?;
        let expected = [&[time.columns.title()], columns].concat();
        let found = ends.names(format);
        let named = match format {
            Format::JsonLines => LAST_LINE,
            _ => FIRST_LINE,
        };
        let found = found.map_err(|error| of_line(named, error))?;
        if found != expected {
            return Err(other(format!(
                "its columns are {} and not {}",
                quoted(found.iter().map(String::as_str)),
                quoted(expected.iter().map(String::as_str))
            )));
        }
        let rows = match format {
            Format::JsonLines => Some(ends.last.clone()),
            _ if ends.is_one_line => None,
            _ => Some([&*ends.first, &*ends.last].concat()),
        };
        let time = time.written();
        let last = rows
            .map(|rows| last_row(&file, rows, format, &time))
            .transpose()
            .map_err(|error| of_line(LAST_LINE, error))?
            .flatten();
        let last_ns = match last {
            Some(last) if later(&time, &last.time_text) != Some(last.time_ns) => {
                let among = || ends.instant_among_rows(path, format, &time, &last.time_text);
                let by_rows = among().map_err(|source| FileError::cannot_open(path, source))?;
                let known = by_rows.unwrap_or(last.time_ns);
                match seen {
                    Some(seen) if known < seen.as_ns() => later(&time, &last.time_text),
                    _ => Some(known),
                }
            }
            last => last.map(|last| last.time_ns),
        };
        Ok(Some(Self {
            length: ends.length,
            last_ns,
        }))
    }
}

/// The later of the instants that a time can stand for.
fn later(time: &TimeColumn, text: &str) -> Option<i64> {
    instant(time.read(text.as_bytes(), Some((Instant::MAX, 0))))
}

fn instant(read: Option<Civil>) -> Option<i64> {
    match read {
        Some(Civil::At(at)) => Some(at.as_ns()),
        _ => None,
    }
}

/// The columns of a file that was begun, that of the time first; none where it is no file, empty, or cannot be read.
#[must_use]
pub fn begun_columns(path: &Path) -> Option<Vec<String>> {
    let is_file = path.metadata().is_ok_and(|of| of.is_file());
    let ends = is_file.then(|| Ends::of(path).ok()).flatten().flatten()?;
    let format = Format::from_path(path).unwrap_or(Format::Csv);
    ends.names(format).ok()
}

/// The instant of the last row of a file that a sink with these columns began; none where it has no row.
///
/// # Errors
/// The file cannot be read, or is not one with these columns.
pub fn begun_until(
    path: &Path,
    format: Format,
    time: &TimeColumn,
    columns: &[String],
) -> Result<Option<Instant>, FileError> {
    let begun = Begun::of(path, format, time, columns, None)?;
    Ok(begun.and_then(|of| of.last_ns).map(Instant::from_ns))
}

/// What lines are called where one of them is no such as a run wrote.
const FIRST_LINE: &str = "its first line";
const LAST_LINE: &str = "its last line";

/// The first and the last whole line of a file; `of` gives none where there is no whole line.
struct Ends {
    first: Vec<u8>,
    last: Vec<u8>,
    is_one_line: bool,
    length: u64,
    /// Where the last line begins.
    last_at: u64,
}

impl Ends {
    fn of(path: &Path) -> io::Result<Option<Self>> {
        let mut input = BufReader::new(File::open(path)?);
        let mut first = Vec::new();
        input
            .by_ref()
            .take(LONGEST_ROW as u64)
            .read_until(b'\n', &mut first)?;
        let length = input.seek(SeekFrom::End(0))?;
        let begin = input.seek(SeekFrom::Start(
            length.saturating_sub(2 * LONGEST_ROW as u64),
        ))?;
        let mut tail = Vec::new();
        input.read_to_end(&mut tail)?;
        let Some(end) = tail.iter().rposition(|&byte| byte == b'\n') else {
            return Ok(None);
        };
        tail.truncate(end + 1);
        let before = tail[..end].iter().rposition(|&byte| byte == b'\n');
        let last_at = before.map_or(0, |before| before + 1);
        Ok(Some(Self {
            first,
            is_one_line: before.is_none(),
            last: tail.split_off(last_at),
            length: begin + end as u64 + 1,
            last_at: begin + last_at as u64,
        }))
    }

    /// The instant of the last row by those before it, from one on whose time comes only once; none where there are none.
    fn instant_among_rows(
        &self,
        path: &Path,
        format: Format,
        time: &TimeColumn,
        text: &str,
    ) -> io::Result<Option<i64>> {
        let mut looked_at = 2 * LONGEST_ROW as u64;
        loop {
            let begin = self.last_at.saturating_sub(looked_at);
            looked_at *= 2;
            let mut rows = BufReader::new(File::open(path)?);
            rows.seek(SeekFrom::Start(begin))?;
            let mut rows = rows.take(self.last_at - begin);
            let names: &[u8] = match format {
                Format::Csv if begin > 0 => &self.first,
                _ => &[],
            };
            if begin > 0 {
                rows.skip_until(b'\n')?;
            }
            let rows = Cursor::new(names.to_vec()).chain(rows);
            let Ok(mut reader) = reader("", rows, format, time) else {
                return Ok(None);
            };
            let mut row = Row::default();
            let mut is_first = true;
            let begins_twice = loop {
                match reader.next_into(&mut row) {
                    Ok(true) => {}
                    Ok(false) | Err(_) => break false,
                }
                let comes_twice = later(time, &row.time_text) != Some(row.time_ns);
                if std::mem::take(&mut is_first) && begin > 0 && comes_twice {
                    break true;
                }
            };
            if !begins_twice {
                let read = time.read(text.as_bytes(), reader.last());
                return Ok(instant(read));
            }
        }
    }

    fn names(&self, format: Format) -> Result<Vec<String>, FileError> {
        match format {
            Format::JsonLines => self.json_names(),
            _ => self.csv_names(),
        }
    }

    fn csv_names(&self) -> Result<Vec<String>, FileError> {
        let lines = Lines::new(FIRST_LINE.into(), None, Cursor::new(self.first.clone()));
        let rows = CsvRows::headed(lines, &own(), None)?;
        Ok(rows.names().to_vec())
    }

    fn json_names(&self) -> Result<Vec<String>, FileError> {
        let line = Cursor::new(self.last.clone());
        Ok(Description::of_read(LAST_LINE, line, Some(Format::JsonLines), 1)?.columns)
    }
}

fn last_row(
    file: &str,
    rows: Vec<u8>,
    format: Format,
    time: &TimeColumn,
) -> Result<Option<Row>, FileError> {
    let mut row = Row::default();
    let mut reader = reader(file, Cursor::new(rows), format, time)?;
    Ok(reader.next_into(&mut row)?.then_some(row))
}

/// How rows are laid out that were written.
fn own() -> TableFormat {
    TableFormat {
        separator: Some(Separator(b',')),
        ..TableFormat::default()
    }
}

/// Reads the times of rows that were written.
fn reader(
    file: &str,
    rows: impl Read + Send + 'static,
    format: Format,
    time: &TimeColumn,
) -> Result<Reader, FileError> {
    let layout = Layout {
        time: time.clone(),
        channels: Vec::new(),
        table: TableBase {
            base: own(),
            files: Vec::new(),
        },
    };
    let options = Options {
        format: Some(format),
        ..Options::default()
    };
    Reader::from_read(file, rows, layout, options)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 2026-10-25T00:00:00Z, when it is two o'clock in Berlin; an hour later the clocks go back to two.
    const AUTUMN_S: i64 = 1_792_886_400;

    /// What is found of a file with rows at these times, in s since then, up to where its rows were read.
    fn last(name: &str, times: impl Iterator<Item = i64>, seen_s: Option<i64>) -> i64 {
        let clock = |at: i64| {
            let at = at + if at < 3600 { 7200 } else { 3600 };
            let (hours, minutes) = (at / 3600, at / 60 % 60);
            format!("2026-10-25 {hours:02}:{minutes:02}:{:02}", at % 60)
        };
        // Wide enough for two hours of seconds to be more than is looked at first.
        let value = format!("1.{:0400}", 0);
        let is_csv = name.ends_with("csv");
        let row = |at| match is_csv {
            true => format!("{},{value}\n", clock(at)),
            false => format!("{{\"t\":\"{}\",\"a\":{value}}}\n", clock(at)),
        };
        let names = is_csv.then(|| "t,a\n".to_owned());
        let text: String = names.into_iter().chain(times.map(row)).collect();
        let path =
            std::env::temp_dir().join(format!("athermal-begun-{}-{name}", std::process::id()));
        std::fs::write(&path, text).unwrap();
        let time = TimeColumn {
            columns: "t".parse().unwrap(),
            form: crate::TimeForm::Format("%Y-%m-%d %H:%M:%S".parse().unwrap()),
            zone: Some("Europe/Berlin".parse().unwrap()),
        };
        let seen = seen_s.map(|at| Instant::from_ns((AUTUMN_S + at) * 1_000_000_000));
        let format = Format::from_path(&path).unwrap();
        let begun = Begun::of(&path, format, &time, &["a".to_owned()], seen);
        std::fs::remove_file(&path).unwrap();
        begun.unwrap().unwrap().last_ns.unwrap() / 1_000_000_000 - AUTUMN_S
    }

    #[test]
    fn a_last_time_that_comes_twice_is_told_by_the_rows_before_it_however_many_and_by_what_was_read()
     {
        for name in ["a.csv", "a.jsonl"] {
            for end in [1800, 3599, 3600, 5400, 7199, 7200] {
                assert_eq!(last(name, -1800..=end, None), end, "{name}");
            }
            let single = |at: i64, seen_s| last(name, std::iter::once(at), seen_s);
            assert_eq!(single(4200, None), 600, "nothing decides");
            assert_eq!(single(4200, Some(4200)), 4200);
            assert_eq!(single(4200, Some(4190)), 4200);
            assert_eq!(single(600, Some(590)), 600);
        }
    }
}
