//! `csv` and `jsonl` as sinks: a file with a row for each tick, each exactly once.

use std::fs::{File, OpenOptions};
use std::io::{self, BufRead, BufReader, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use athermal_core::document::TimeBase;
use athermal_core::time::Instant;
use athermal_files::{Flush, Format, TimeColumn, Writer, begun_columns};
use athermal_serve::connector::{
    ConnectorError, Kept, OutRow, Outlet, Sink, SinkWiring, WiredOutput,
};
use athermal_serve::register_sink;
use schemars::JsonSchema;
use serde::Deserialize;

use crate::table::in_folder;

/// So many bytes are held back before they are written.
const BUFFER: usize = 1 << 16;

/// A CSV file with a row for each tick: the time, the outputs, and the revision of the graph that made them. After a restart it goes on
/// where the journal is: no row is lost, none stands twice.
#[derive(Debug, Deserialize, JsonSchema)]
pub struct CsvSink {
    /// The file. One that is there with the same columns is appended to.
    path: PathBuf,
}

/// JSON lines with an object for each tick; else as a CSV file.
#[derive(Debug, Deserialize, JsonSchema)]
pub struct JsonLinesSink {
    /// The file. One that is there with the same columns is appended to.
    path: PathBuf,
}

register_sink!(CsvSink, "csv");
register_sink!(JsonLinesSink, "jsonl");

impl Sink for CsvSink {
    fn open(&self, wiring: SinkWiring) -> Result<Box<dyn Outlet>, ConnectorError> {
        Ok(Box::new(FileOutlet::open(
            &self.path,
            Format::Csv,
            &wiring,
        )?))
    }
}

impl Sink for JsonLinesSink {
    fn open(&self, wiring: SinkWiring) -> Result<Box<dyn Outlet>, ConnectorError> {
        Ok(Box::new(FileOutlet::open(
            &self.path,
            Format::JsonLines,
            &wiring,
        )?))
    }
}

/// The columns of a sink as `run` writes them: that of time, and the others.
pub(crate) fn columns(wiring: &SinkWiring) -> (String, Vec<String>) {
    let names = wiring
        .outputs
        .iter()
        .map(|of: &WiredOutput| of.name.clone());
    let columns = names.chain(["revision".to_owned()]).collect();
    (TimeColumn::from(&wiring.time).columns.title(), columns)
}

/// An instant as the graph's time is written; empty where that is in seconds.
pub(crate) fn time_text(time: &TimeBase, at: Instant) -> String {
    TimeColumn::from(time).write(at)
}

/// Bytes on their way to a file.
#[derive(Debug, Clone, Default)]
struct Bytes(Arc<Mutex<Vec<u8>>>);

impl Bytes {
    fn with<T>(&self, work: impl FnOnce(&mut Vec<u8>) -> T) -> T {
        work(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

impl Write for Bytes {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.with(|held| held.extend_from_slice(bytes));
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

struct FileOutlet {
    path: PathBuf,
    file: File,
    /// Where whole rows end.
    end: u64,
    held: Bytes,
    writer: Writer,
    time: TimeBase,
}

impl FileOutlet {
    fn open(path: &Path, format: Format, wiring: &SinkWiring) -> Result<Self, ConnectorError> {
        let path = in_folder(&wiring.folder, path);
        let shown = path.display().to_string();
        let failed =
            |error: io::Error| ConnectorError::new(format_args!("cannot write {shown}: {error}"));
        let (time, columns) = columns(wiring);
        let mut options = OpenOptions::new();
        options.read(true).write(true).create(true).truncate(false);
        let mut file = options.open(&path).map_err(failed)?;
        let held = Bytes::default();
        let writer = Writer::to_write(
            &shown,
            held.clone(),
            format,
            &time,
            &columns,
            Flush::EachRow,
        );
        let writer = writer.map_err(ConnectorError::new)?;
        let mut end = file.metadata().map_err(failed)?.len();
        if end > 0 {
            let expected: Vec<_> = std::iter::once(time).chain(columns).collect();
            let found = begun_columns(&path).unwrap_or_default();
            if found != expected {
                return Err(ConnectorError::new(format_args!(
                    "{shown} has other columns than what is to be written ({} and not {}): move it away, or name another file",
                    found.join(", "),
                    expected.join(", ")
                )));
            }
            end = whole_lines(&mut file).map_err(failed)?;
            // The names stand there already.
            held.with(Vec::clear);
        }
        Ok(Self {
            path,
            file,
            end,
            held,
            writer,
            time: wiring.time.clone(),
        })
    }

    /// Writes what is held back; all of it, or none.
    fn write(&mut self) -> Result<(), ConnectorError> {
        let (file, end) = (&mut self.file, self.end);
        let written = self.held.with(|held| {
            if held.is_empty() {
                return Ok(end);
            }
            file.seek(SeekFrom::Start(end))?;
            if let Err(error) = file.write_all(held) {
                // Half a row is none; where it cannot be cut off now, it is written over.
                let _ = file.set_len(end);
                return Err(error);
            }
            let end = end + held.len() as u64;
            held.clear();
            Ok(end)
        });
        self.end = written.map_err(|error| self.failed(&error))?;
        Ok(())
    }

    fn failed(&self, error: &io::Error) -> ConnectorError {
        ConnectorError::new(format_args!(
            "cannot write {}: {error}",
            self.path.display()
        ))
    }
}

/// Cuts off what is left of a line, and gives where whole lines end.
fn whole_lines(file: &mut File) -> io::Result<u64> {
    let length = file.metadata()?.len();
    let mut end = length;
    let mut piece = vec![0; BUFFER];
    while end > 0 {
        let from = end.saturating_sub(piece.len() as u64);
        let part = &mut piece[..(end - from) as usize];
        file.seek(SeekFrom::Start(from))?;
        io::Read::read_exact(file, part)?;
        match part.iter().rposition(|byte| *byte == b'\n') {
            Some(place) => {
                end = from + place as u64 + 1;
                break;
            }
            None => end = from,
        }
    }
    if end < length {
        file.set_len(end)?;
    }
    Ok(end)
}

impl Outlet for FileOutlet {
    fn put(&mut self, row: &OutRow<'_>) -> Result<(), ConnectorError> {
        if self.held.with(|held| held.len()) >= BUFFER {
            self.write()?;
        }
        let text = time_text(&self.time, row.at);
        let label = format!("{:016x}", row.revision);
        self.writer
            .write_labelled_row(&text, row.at.as_ns(), row.outputs, &label)
            .map_err(ConnectorError::new)
    }

    fn flush(&mut self) -> Result<(), ConnectorError> {
        self.write()
    }

    fn kept(&mut self) -> Option<&mut dyn Kept> {
        Some(self)
    }
}

impl Kept for FileOutlet {
    fn end(&mut self) -> Result<u64, ConnectorError> {
        self.write()?;
        self.file.sync_data().map_err(|error| self.failed(&error))?;
        Ok(self.end)
    }

    fn rows_after(&mut self, end: u64) -> Result<Option<u64>, ConnectorError> {
        if self.end < end {
            return Ok(None);
        }
        let count = || {
            let mut file = &self.file;
            file.seek(SeekFrom::Start(end))?;
            let (mut rows, mut reader) = (0, BufReader::new(file));
            loop {
                let piece = reader.fill_buf()?;
                let length = piece.len();
                if length == 0 {
                    return Ok(Some(rows));
                }
                rows += piece.iter().filter(|byte| **byte == b'\n').count() as u64;
                reader.consume(length);
            }
        };
        count().map_err(|error: io::Error| self.failed(&error))
    }

    fn cut(&mut self, end: u64, rows: u64) -> Result<(), ConnectorError> {
        let find = || {
            let mut file = &self.file;
            file.seek(SeekFrom::Start(end))?;
            let mut reader = BufReader::new(file);
            let (mut place, mut line) = (end, Vec::new());
            for _ in 0..rows {
                line.clear();
                place += reader.read_until(b'\n', &mut line)? as u64;
            }
            self.file.set_len(place)?;
            Ok(place)
        };
        self.end = find().map_err(|error: io::Error| self.failed(&error))?;
        Ok(())
    }
}
