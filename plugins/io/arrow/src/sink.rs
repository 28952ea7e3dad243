//! `parquet` as a sink: a file for each stretch of time, each tick a row, each exactly once. Not how Parquet is written.

use std::fs::{self, File, OpenOptions};
use std::io::{self, BufReader, Read, Write};
use std::path::{Path, PathBuf};

use athermal_core::time::{Duration, Instant};
use athermal_files::TimeColumn;
use athermal_serve::connector::{ConnectorError, Kept, OutRow, Outlet, Place, Sink, SinkWiring};
use athermal_serve::journal::sync_folder;
use athermal_serve::register_sink;
use schemars::JsonSchema;
use serde::Deserialize;

use crate::parquet_sink;

/// So many bytes are held back before they are written.
const BUFFER: usize = 1 << 16;
const DAY_NS: i64 = 86_400_000_000_000;
/// What the names of rows that wait for the end of their stretch begin with; readers pass such names over.
const ROWS: &str = ".rows-";

/// Parquet files by date, `PATH/date=2026-03-01/00-00-00.parquet`, with a row for each tick: the time, the outputs, and the revision of
/// the graph that made them. A file is there once its stretch of time is over, whole or not at all, also after a kill. Until then its rows
/// wait in a hidden file beside them. After a restart it goes on where the journal is: no row is lost, none stands twice.
#[derive(Debug, Deserialize, JsonSchema)]
pub struct ParquetSink {
    /// The folder of the files.
    path: PathBuf,
    /// How long the stretch of time of a file is, a whole part of a UTC day of 1min or more: `1h`. Without it, a day.
    #[serde(default = "day")]
    every: Duration,
}

fn day() -> Duration {
    Duration::from_ns(DAY_NS)
}

register_sink!(ParquetSink, "parquet");

impl Sink for ParquetSink {
    fn open(&self, wiring: SinkWiring) -> Result<Box<dyn Outlet>, ConnectorError> {
        let every = self.every.as_ns();
        if every < 60_000_000_000 || DAY_NS % every != 0 {
            return Err(ConnectorError::new(format_args!(
                "`every` is {} and must be a whole part of a day, of 1min or more: `1h`, `6h`",
                self.every
            )));
        }
        let folder = match self.path.is_absolute() {
            true => self.path.clone(),
            false => wiring.folder.join(&self.path),
        };
        let mut names = vec![TimeColumn::from(&wiring.time).columns.title()];
        names.extend(wiring.outputs.iter().map(|of| of.name.clone()));
        names.push("revision".to_owned());
        let opened = Stretches::open(folder.clone(), every, names);
        opened
            .map(|of| Box::new(of) as Box<dyn Outlet>)
            .map_err(|error| failed(&folder, &error))
    }
}

fn failed(folder: &Path, error: &io::Error) -> ConnectorError {
    ConnectorError::new(format_args!("cannot write {}: {error}", folder.display()))
}

/// Rows of a stretch of time, in a file of their own, each of the same length: its instant in ns, its revision and its outputs.
struct RowFile {
    stretch: i64,
    path: PathBuf,
    file: File,
    /// How many whole rows stand in it.
    rows: u64,
}

/// A folder of files, one for each stretch of time.
struct Stretches {
    folder: PathBuf,
    every: i64,
    /// The columns, that of the time first and that of the revision last.
    names: Vec<String>,
    /// The rows of the last stretches, the newest last. Those behind the last place that was kept stay: after a kill they are counted, and
    /// what the journal does not know is cut off.
    files: Vec<RowFile>,
    held: Vec<u8>,
}

impl RowFile {
    fn open(path: PathBuf, stretch: i64, length: usize) -> io::Result<Self> {
        let mut options = OpenOptions::new();
        options.read(true).append(true).create(true);
        let file = options.open(&path)?;
        let rows = file.metadata()?.len() / length as u64;
        // What is left of a row.
        file.set_len(rows * length as u64)?;
        Ok(Self {
            stretch,
            path,
            file,
            rows,
        })
    }
}

impl Stretches {
    fn open(folder: PathBuf, every: i64, names: Vec<String>) -> io::Result<Self> {
        fs::create_dir_all(&folder)?;
        let mut of = Self {
            folder,
            every,
            names,
            files: Vec::new(),
            held: Vec::new(),
        };
        let length = of.length();
        // Rows of other columns, or of stretches of another length, are not gone on with.
        let suffix = of.suffix();
        for entry in fs::read_dir(&of.folder)?.flatten() {
            let name = entry.file_name();
            let Some(rest) = name.to_str().and_then(|name| name.strip_prefix(ROWS)) else {
                continue;
            };
            let stretch = rest.strip_suffix(&suffix).and_then(|of| of.parse().ok());
            let Some(stretch) = stretch else {
                return Err(io::Error::other(format!(
                    "{} holds rows of other columns or another `every`; move it away, or name another folder",
                    entry.path().display()
                )));
            };
            let file = RowFile::open(entry.path(), stretch, length)?;
            of.files.push(file);
        }
        of.files.sort_by_key(|file| file.stretch);
        // A kill came between the end of a stretch and its file.
        for nth in 0..of.files.len().saturating_sub(1) {
            of.finish(nth)?;
        }
        Ok(of)
    }

    /// How many bytes a row has.
    fn length(&self) -> usize {
        // The instant and the revision stand beside the outputs.
        8 * self.names.len()
    }

    /// What tells rows of these columns from others.
    fn suffix(&self) -> String {
        let all = format!("{:?} {}", self.names, self.every);
        format!("-{:016x}", athermal_core::engine::fnv_1a(all.as_bytes()))
    }

    fn rows_of(&self, stretch: i64) -> PathBuf {
        self.folder
            .join(format!("{ROWS}{stretch}{}", self.suffix()))
    }

    /// The file of a stretch.
    fn file_of(&self, stretch: i64) -> io::Result<PathBuf> {
        let at = jiff::Timestamp::from_nanosecond(i128::from(stretch) * i128::from(self.every));
        let at = at.map_err(io::Error::other)?;
        let name = at.strftime("date=%Y-%m-%d/%H-%M-%S.parquet").to_string();
        Ok(self.folder.join(name))
    }

    /// Writes the file of a stretch, if it is not there.
    fn finish(&self, nth: usize) -> io::Result<()> {
        let of = &self.files[nth];
        let path = self.file_of(of.stretch)?;
        if path.exists() {
            return Ok(());
        }
        path.parent().map_or(Ok(()), fs::create_dir_all)?;
        let part = path.with_file_name(".part");
        let (time, columns) = self
            .names
            .split_first()
            .ok_or(io::ErrorKind::InvalidInput)?;
        let mut sink = parquet_sink::create(File::create(&part)?, time, columns);
        let (mut row, mut values) = (vec![0; self.length()], Vec::new());
        let mut rows = BufReader::with_capacity(BUFFER, File::open(&of.path)?);
        for _ in 0..of.rows {
            rows.read_exact(&mut row)?;
            let mut cells = row.chunks_exact(8).map(|cell| {
                let mut bytes = [0; 8];
                bytes.copy_from_slice(cell);
                u64::from_le_bytes(bytes)
            });
            let (at, revision) = (cells.next().unwrap_or(0), cells.next().unwrap_or(0));
            values.clear();
            values.extend(cells.map(f64::from_bits));
            sink.write(at.cast_signed(), &values, Some(&format!("{revision:016x}")))?;
        }
        sink.finish()?;
        drop(sink);
        File::open(&part)?.sync_all()?;
        fs::rename(&part, &path)?;
        // The name of the file, and that of its folder.
        path.parent().map_or(Ok(()), sync_folder)?;
        sync_folder(&self.folder)
    }

    /// Goes on to the stretch of an instant. One before the stretch that is open belongs to that.
    fn go_to(&mut self, at: Instant) -> io::Result<()> {
        let stretch = at.as_ns().div_euclid(self.every);
        if self.files.last().is_some_and(|of| stretch <= of.stretch) {
            return Ok(());
        }
        self.write()?;
        if let Some(last) = self.files.len().checked_sub(1) {
            self.files[last].file.sync_data()?;
            self.finish(last)?;
        }
        let path = self.file_of(stretch)?;
        if path.exists() {
            return Err(io::Error::other(format!(
                "{} is there already, and no rows that wait for it; move it away, or name another folder",
                path.display()
            )));
        }
        let file = RowFile::open(self.rows_of(stretch), stretch, self.length())?;
        sync_folder(&self.folder)?;
        self.files.push(file);
        Ok(())
    }

    /// Writes what is held back; all of it, or none.
    fn write(&mut self) -> io::Result<()> {
        let length = self.length() as u64;
        let Some(last) = self.files.last_mut().filter(|_| !self.held.is_empty()) else {
            return Ok(());
        };
        if let Err(error) = last.file.write_all(&self.held) {
            // Half a row is none.
            let _ = last.file.set_len(last.rows * length);
            return Err(error);
        }
        last.rows += self.held.len() as u64 / length;
        self.held.clear();
        Ok(())
    }

    /// A place: the stretch, and how many of its rows are before it.
    fn place(&self) -> Place {
        let last = self.files.last();
        last.map_or(Place::default(), |of| Place {
            file: of.stretch.cast_unsigned(),
            rows: of.rows,
        })
    }

    /// The rows behind a place, by the files that they stand in; none where it is gone.
    fn behind(&self, place: Place) -> Option<Vec<(usize, u64)>> {
        let (stretch, before) = (place.file.cast_signed(), place.rows);
        let holds = |of: &RowFile| of.stretch == stretch && of.rows >= before;
        let first = match place == Place::default() {
            true => 0,
            false => self.files.iter().position(holds)?,
        };
        let files = self.files.iter().enumerate().skip(first);
        let behind = files.map(|(nth, of)| match nth == first {
            true => (nth, of.rows - before),
            false => (nth, of.rows),
        });
        Some(behind.collect())
    }

    fn cut(&mut self, place: Place, mut rows: u64) -> io::Result<()> {
        let length = self.length() as u64;
        for (nth, behind) in self.behind(place).unwrap_or_default() {
            let stays = behind.min(rows);
            rows -= stays;
            if stays == behind {
                continue;
            }
            let path = self.file_of(self.files[nth].stretch)?;
            if path.exists() {
                fs::remove_file(path)?;
            }
            let of = &mut self.files[nth];
            of.rows -= behind - stays;
            of.file.set_len(of.rows * length)?;
        }
        // The last stretch with rows is the one that is open.
        while let Some(empty) = self.files.pop_if(|of| of.rows == 0) {
            fs::remove_file(&empty.path)?;
        }
        if let Some(last) = self.files.last() {
            let path = self.file_of(last.stretch)?;
            if path.exists() {
                fs::remove_file(path)?;
            }
        }
        Ok(())
    }
}

impl Outlet for Stretches {
    fn put(&mut self, row: &OutRow<'_>) -> Result<(), ConnectorError> {
        let written = match self.held.len() >= BUFFER {
            true => self.write(),
            false => Ok(()),
        };
        let ready = written.and_then(|()| self.go_to(row.at));
        ready.map_err(|error| failed(&self.folder, &error))?;
        let head = [row.at.as_ns().cast_unsigned(), row.revision];
        let outputs = row.outputs.iter().map(|value| value.to_bits());
        for cell in head.into_iter().chain(outputs) {
            self.held.extend_from_slice(&cell.to_le_bytes());
        }
        Ok(())
    }

    fn flush(&mut self) -> Result<(), ConnectorError> {
        self.write().map_err(|error| failed(&self.folder, &error))
    }

    fn kept(&mut self) -> Option<&mut dyn Kept> {
        Some(self)
    }
}

impl Kept for Stretches {
    fn end(&mut self) -> Result<Place, ConnectorError> {
        let synced = self.write().and_then(|()| match self.files.last() {
            Some(last) => last.file.sync_data(),
            None => Ok(()),
        });
        synced.map_err(|error| failed(&self.folder, &error))?;
        Ok(self.place())
    }

    fn rows_after(&mut self, end: Place) -> Result<Option<u64>, ConnectorError> {
        let behind = self.behind(end);
        Ok(behind.map(|files| files.into_iter().map(|(_, rows)| rows).sum()))
    }

    fn cut(&mut self, end: Place, rows: u64) -> Result<(), ConnectorError> {
        Self::cut(self, end, rows).map_err(|error| failed(&self.folder, &error))
    }

    /// Rows of stretches that have ended before the place are in files of theirs. Where they cannot be removed they do no harm.
    fn forget(&mut self, end: Place) {
        let kept = end.file.cast_signed();
        for old in self.files.extract_if(.., |of| of.stretch < kept) {
            let _ = fs::remove_file(&old.path);
        }
    }
}
