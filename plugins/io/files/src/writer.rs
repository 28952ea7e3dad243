//! Rows written as CSV or JSON lines, in the shortest numbers that read back to the same bits. Not which columns there are.

use std::fmt::Write as _;
use std::fs::{File, OpenOptions};
use std::io::{self, Write};
use std::path::Path;
use std::sync::Arc;

use athermal_core::time::Instant;

use crate::begun::Begun;
use crate::cell::text_of;
use crate::json_objects::JsonObjects;
use crate::lines::BUFFER;
use athermal_core::registry::Registered;

use crate::typed::kind_by_name;
use crate::{FileError, FileKind, Format, TimeColumn, TypedSink};

/// When a row leaves the program.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Flush {
    /// Each row at once: for pipes and terminals.
    EachRow,
    /// When a buffer is full, and at the end: for files.
    Buffered,
}

/// Writes a recording row by row; after the first row without allocating.
pub struct Writer {
    file: Arc<str>,
    flush: Flush,
    columns: usize,
    number: zmij::Buffer,
    instant: String,
    rows: Rows,
    /// The same file, where it is one that keeps what it is given.
    kept: Option<File>,
    /// What begins that file, once it was written.
    header: Vec<u8>,
    /// The instant of the last row that stood in it before.
    stood_ns: Option<i64>,
}

enum Rows {
    Csv(Box<csv::Writer<Box<dyn Write + Send>>>),
    Json(JsonObjects),
    Typed(Box<dyn TypedSink>),
}

impl Writer {
    /// Creates a file, or takes standard output for `-`, and writes the column names (CSV).
    ///
    /// The format is what the name says, CSV if it says nothing.
    ///
    /// # Errors
    /// The file cannot be created or written, or is of a kind that is only read; that one is left as it is.
    pub fn create(
        path: impl AsRef<Path>,
        time_column: &str,
        columns: &[String],
        flush: Flush,
    ) -> Result<Self, FileError> {
        let path = path.as_ref();
        if path == Path::new("-") {
            let (name, csv) = ("standard output", Format::Csv);
            return Self::to_write(name, io::stdout(), csv, time_column, columns, flush);
        }
        if let Some(kind) = kind_by_name(path) {
            return Self::of_kind(kind, path, time_column, columns);
        }
        let output = create(path).map_err(|source| FileError::cannot_open(path, source))?;
        let mut writer = Self::to_file(path, output, time_column, columns, flush)?;
        writer.write_header(time_column, columns)?;
        writer.keep_header(time_column, columns)?;
        Ok(writer)
    }

    /// Goes on with a file that was written with the same columns before: a last line that was cut off is removed, and rows up to the
    /// last one, which stand there already, are passed over. What is not there yet, empty or no file is created. `seen` is up to
    /// where the rows that it was written from were read, if that is known: it may decide which instant a time means that comes twice.
    ///
    /// # Errors
    /// The file cannot be read or written, was written with other columns, or is of a kind that is no text; nothing is then changed.
    pub fn resume(
        path: impl AsRef<Path>,
        time: &TimeColumn,
        columns: &[String],
        seen: Option<Instant>,
        flush: Flush,
    ) -> Result<Self, FileError> {
        let path = path.as_ref();
        let format = format_of(path);
        if let Some(kind) = kind_by_name(path) {
            let reason = format!(
                "nothing can be added to a file of {}, as a run with a state does; write CSV or JSON lines, or leave out `--state`",
                kind.name
            );
            return Err(FileError::unfit(path, reason));
        }
        let Some(begun) = Begun::of(path, format, time, columns, seen)? else {
            return Self::create(path, &time.columns.title(), columns, flush);
        };
        let open = || {
            let output = OpenOptions::new().append(true).open(path)?;
            output.set_len(begun.length)?;
            Ok(output)
        };
        let output = open().map_err(|source| FileError::cannot_open(path, source))?;
        let mut writer = Self::to_file(path, output, &time.columns.title(), columns, flush)?;
        writer.stood_ns = begun.last_ns;
        writer.keep_header(&time.columns.title(), columns)?;
        Ok(writer)
    }

    /// The instant of the last row that stood in the file before.
    pub fn stood(&self) -> Option<Instant> {
        self.stood_ns.map(Instant::from_ns)
    }

    fn of_kind(
        kind: &Registered<FileKind>,
        path: &Path,
        time_column: &str,
        columns: &[String],
    ) -> Result<Self, FileError> {
        let name = path.display().to_string();
        let Some(begin) = kind.create else {
            let reason = format!("{} is read, but not written", kind.name);
            return Err(FileError::unfit(path, reason));
        };
        let output = create(path).map_err(|source| FileError::cannot_open(path, source))?;
        let (csv, flush) = (Format::Csv, Flush::Buffered);
        let mut writer = Self::headless(&name, io::sink(), csv, time_column, columns, flush);
        writer.rows = Rows::Typed(begin(output, time_column, columns));
        Ok(writer)
    }

    fn to_file(
        path: &Path,
        output: File,
        time_column: &str,
        columns: &[String],
        flush: Flush,
    ) -> Result<Self, FileError> {
        let is_file = output.metadata().is_ok_and(|of| of.is_file());
        let kept = is_file.then(|| output.try_clone()).transpose();
        let kept = kept.map_err(|source| FileError::cannot_open(path, source))?;
        let name = path.display().to_string();
        let format = format_of(path);
        let mut writer = Self::headless(&name, output, format, time_column, columns, flush);
        writer.kept = kept;
        Ok(writer)
    }

    /// Writes to any stream of bytes; `name` stands for it in messages.
    ///
    /// # Errors
    /// The column names cannot be written.
    pub fn to_write(
        name: &str,
        output: impl Write + Send + 'static,
        format: Format,
        time_column: &str,
        columns: &[String],
        flush: Flush,
    ) -> Result<Self, FileError> {
        let mut writer = Self::headless(name, output, format, time_column, columns, flush);
        writer.write_header(time_column, columns)?;
        Ok(writer)
    }

    /// A writer that has not written the column names.
    fn headless(
        name: &str,
        output: impl Write + Send + 'static,
        format: Format,
        time_column: &str,
        columns: &[String],
        flush: Flush,
    ) -> Self {
        let output: Box<dyn Write + Send> = Box::new(output);
        let rows = match format {
            Format::JsonLines => Rows::Json(JsonObjects::new(output, time_column, columns)),
            _ => Rows::Csv(Box::new(csv_to(output))),
        };
        Self {
            file: name.into(),
            flush,
            columns: columns.len(),
            number: zmij::Buffer::new(),
            instant: String::new(),
            rows,
            kept: None,
            header: Vec::new(),
            stood_ns: None,
        }
    }

    /// Writes one row: its instant as the input had it, or where `time_text` is empty `time_ns` as exact decimal seconds;
    /// then one value per column, `NaN` as an empty cell (CSV) or `null`, infinities as `inf` and `-inf` (text in JSON).
    ///
    /// # Errors
    /// The number of values is not that of the columns, or writing failed.
    pub fn write_row(
        &mut self,
        time_text: &str,
        time_ns: i64,
        values: &[f64],
    ) -> Result<(), FileError> {
        self.write(time_text, time_ns, values, None)
    }

    /// Writes one row whose last column is a text: one value less than there are columns, and the text.
    ///
    /// # Errors
    /// As [`write_row`](Self::write_row).
    pub fn write_labelled_row(
        &mut self,
        time_text: &str,
        time_ns: i64,
        values: &[f64],
        label: &str,
    ) -> Result<(), FileError> {
        self.write(time_text, time_ns, values, Some(label))
    }

    fn write(
        &mut self,
        time_text: &str,
        time_ns: i64,
        values: &[f64],
        label: Option<&str>,
    ) -> Result<(), FileError> {
        let found = values.len() + usize::from(label.is_some());
        if found != self.columns {
            return Err(FileError::ValueCount {
                file: self.file.clone(),
                expected: self.columns,
                found,
            });
        }
        if self.stood_ns.is_some_and(|stood_ns| time_ns <= stood_ns) {
            return Ok(());
        }
        let time_text = match time_text {
            "" => {
                self.instant.clear();
                // Writing to a `String` cannot fail.
                let _ = write!(self.instant, "{}", Instant::from_ns(time_ns));
                self.instant.as_str()
            }
            text => text,
        };
        let written = match &mut self.rows {
            Rows::Csv(csv) => write_cells(csv, &mut self.number, time_text, values, label),
            Rows::Json(json) => json.write(&mut self.number, time_text, values, label),
            Rows::Typed(rows) => rows.write(time_ns, values, label),
        };
        written
            .and_then(|()| self.flush_when(self.flush == Flush::EachRow))
            .map_err(|source| self.failed(source))
    }

    /// Writes what is still held back. Dropping a writer does the same but cannot report a failure.
    ///
    /// # Errors
    /// Writing failed.
    pub fn finish(mut self) -> Result<(), FileError> {
        self.end()
    }

    /// Writes what is still held back, and the end of what has one.
    pub(crate) fn end(&mut self) -> Result<(), FileError> {
        let ended = match &mut self.rows {
            Rows::Typed(rows) => rows.finish(),
            _ => self.flush_when(true),
        };
        ended.map_err(|source| self.failed(source))
    }

    pub(crate) fn flush_all(&mut self) -> Result<(), FileError> {
        self.flush_when(true).map_err(|source| self.failed(source))
    }

    /// Writes what is still held back so that it stands in the file also after a failure of power.
    pub(crate) fn make_last(&mut self) -> Result<(), FileError> {
        self.flush_all()?;
        let synced = self.kept.as_ref().map_or(Ok(()), File::sync_data);
        synced.map_err(|source| self.failed(source))
    }

    fn write_header(&mut self, time_column: &str, columns: &[String]) -> Result<(), FileError> {
        let mut write = || {
            if let Rows::Csv(csv) = &mut self.rows {
                csv.write_field(time_column).map_err(io_error)?;
                csv.write_record(columns).map_err(io_error)?;
            }
            self.flush_when(self.flush == Flush::EachRow)
        };
        write().map_err(|source| self.failed(source))
    }

    /// Keeps what begins the file, to begin it again where another program empties it.
    fn keep_header(&mut self, time_column: &str, columns: &[String]) -> Result<(), FileError> {
        if let (Rows::Csv(_), Flush::EachRow) = (&self.rows, self.flush) {
            let mut csv = csv_to(Vec::new());
            let written = csv
                .write_field(time_column)
                .and_then(|()| csv.write_record(columns));
            written.map_err(|error| self.failed(io_error(error)))?;
            let header = csv.into_inner();
            self.header = header.map_err(|error| self.failed(error.into_error()))?;
        }
        Ok(())
    }

    /// Begins the file again where it was emptied, as what rotates logs does with one that it has copied.
    fn begin_again(&mut self) -> io::Result<()> {
        match &mut self.kept {
            Some(file) if file.metadata()?.len() == 0 => file.write_all(&self.header),
            _ => Ok(()),
        }
    }

    fn flush_when(&mut self, now: bool) -> io::Result<()> {
        if now && !self.header.is_empty() {
            self.begin_again()?;
        }
        match &mut self.rows {
            _ if !now => Ok(()),
            Rows::Csv(csv) => csv.flush(),
            Rows::Json(json) => json.flush(),
            // What it holds back goes with its next piece.
            Rows::Typed(_) => Ok(()),
        }
    }

    fn failed(&self, source: io::Error) -> FileError {
        FileError::Write {
            file: self.file.clone(),
            source: Arc::new(source),
        }
    }
}

/// Creates a file, or empties it. What is written to it goes to its end, wherever that is by then.
fn create(path: &Path) -> io::Result<File> {
    let created = File::create(path)?;
    match created.metadata()?.is_file() {
        true => OpenOptions::new().append(true).open(path),
        false => Ok(created),
    }
}

fn csv_to<W: Write>(output: W) -> csv::Writer<W> {
    csv::WriterBuilder::new()
        .comment(Some(b'#'))
        .buffer_capacity(BUFFER)
        .from_writer(output)
}

/// What the name of a file says, CSV if it says nothing.
fn format_of(path: &Path) -> Format {
    Format::from_path(path).unwrap_or(Format::Csv)
}

fn write_cells<W: Write>(
    csv: &mut csv::Writer<W>,
    number: &mut zmij::Buffer,
    time_text: &str,
    values: &[f64],
    label: Option<&str>,
) -> io::Result<()> {
    csv.write_field(time_text).map_err(io_error)?;
    for &value in values {
        csv.write_field(text_of(value, number)).map_err(io_error)?;
    }
    if let Some(label) = label {
        csv.write_field(label).map_err(io_error)?;
    }
    csv.write_record(None::<&[u8]>).map_err(io_error)
}

/// The error as the system gave it: turned by `From`, it would lose its kind.
fn io_error(error: csv::Error) -> io::Error {
    match error.into_kind() {
        csv::ErrorKind::Io(error) => error,
        other => io::Error::other(format!("{other:?}")),
    }
}

#[cfg(test)]
mod tests;
