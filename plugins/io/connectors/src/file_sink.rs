//! `csv` and `jsonl` as sinks: a file with a row for each tick, each exactly once.

use std::borrow::Cow;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use athermal_core::document::TimeBase;
use athermal_core::time::{Duration, Instant};
use athermal_files::{Flush, Format, TimeColumn, Writer};
use athermal_serve::connector::{
    ConnectorError, Kept, OutRow, Outlet, ParameterRemark, Place, Sink, SinkWiring, WiredOutput,
};
use athermal_serve::deployment::Size;
use athermal_serve::register_sink;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Deserializer, de};

use crate::row_files::{Layout, RowFiles};
use crate::table::in_folder;

/// So many bytes are held back before they are written.
const BUFFER: usize = 1 << 16;

/// A CSV file with a row for each tick: the time, the outputs, and the revision of the graph that made them. After a restart it goes on
/// where the journal is: no row is lost, none stands twice.
///
/// A file that is full is renamed to `NAME-DAY-NUMBER.csv`, with the day of its last row. One that another program moves or truncates is
/// left, and the sink goes on in a new one at its path.
#[derive(Debug, Deserialize, JsonSchema)]
pub struct CsvSink {
    /// The file. One that is there with the same columns is appended to.
    path: PathBuf,
    /// When a file is full and another begins: after a time, as "1d" for one a UTC day, or with so many bytes, as "100 MB". Never without.
    #[serde(default)]
    rotate: Option<Rotate>,
    /// How many full files are kept; all without.
    #[serde(default)]
    #[schemars(range(min = 1))]
    keep: Option<usize>,
}

/// JSON lines with an object for each tick; else as a CSV file.
#[derive(Debug, Deserialize, JsonSchema)]
pub struct JsonLinesSink {
    /// The file. One that is there with the same columns is appended to.
    path: PathBuf,
    /// When a file is full and another begins: after a time, as "1d" for one a UTC day, or with so many bytes, as "100 MB". Never without.
    #[serde(default)]
    rotate: Option<Rotate>,
    /// How many full files are kept; all without.
    #[serde(default)]
    #[schemars(range(min = 1))]
    keep: Option<usize>,
}

register_sink!(CsvSink, "csv");
register_sink!(JsonLinesSink, "jsonl");

/// When a file is full.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Rotate {
    /// Where a stretch of time of this length is over.
    Every(Duration),
    /// With so many bytes.
    Size(u64),
}

/// The shortest stretch of time of a file.
const SHORTEST: Duration = Duration::from_ns(1_000_000_000);

impl<'de> Deserialize<'de> for Rotate {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = String::deserialize(deserializer)?;
        match (text.parse(), text.parse()) {
            (Ok(every), _) if every >= SHORTEST => Ok(Self::Every(every)),
            (_, Ok(Size(bytes))) if bytes > 0 => Ok(Self::Size(bytes)),
            _ => Err(de::Error::custom(format_args!(
                "expected a time of 1s or more, such as \"1d\", or a number of bytes, such as \"100 MB\", found \"{text}\""
            ))),
        }
    }
}

impl JsonSchema for Rotate {
    fn schema_name() -> Cow<'static, str> {
        "Rotate".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "type": "string",
            "description": "When a file is full: a time, \"1d\", or a number of bytes, \"100 MB\".",
            "pattern": "^\\s*\\.?[0-9]",
            "examples": ["1d", "100 MB"]
        })
    }
}

/// When files are full, and what becomes of them.
#[derive(Debug, Clone, Copy)]
struct Rotation {
    rotate: Option<Rotate>,
    keep: Option<usize>,
}

impl Rotation {
    /// Whether a file of so many bytes, with a last row at an instant, is full before a row at another.
    fn is_due(self, last: Instant, at: Instant, length: u64) -> bool {
        match self.rotate {
            None => false,
            Some(Rotate::Size(bytes)) => length >= bytes,
            Some(Rotate::Every(every)) => {
                let stretch = |of: Instant| of.as_ns().div_euclid(every.as_ns());
                stretch(last) != stretch(at)
            }
        }
    }

    fn remarks(self) -> Vec<ParameterRemark> {
        let is_mistake = self.keep.is_some() && self.rotate.is_none();
        let remark = is_mistake.then(|| ParameterRemark {
            at: vec!["keep".to_owned()],
            is_mistake,
            words: "no file is ever full, of which so many could be kept".to_owned(),
            help: "write when one is: `rotate = \"1d\"`, or `rotate = \"100 MB\"`".to_owned(),
        });
        remark.into_iter().collect()
    }
}

/// A kind of sink for each format: they are alike but for that.
macro_rules! file_sink {
    ($spec:ty, $format:expr) => {
        impl $spec {
            fn rotation(&self) -> Rotation {
                let (rotate, keep) = (self.rotate, self.keep);
                Rotation { rotate, keep }
            }
        }

        impl Sink for $spec {
            fn remarks(&self) -> Vec<ParameterRemark> {
                self.rotation().remarks()
            }

            fn open(&self, wiring: SinkWiring) -> Result<Box<dyn Outlet>, ConnectorError> {
                let outlet = FileOutlet::open(&self.path, $format, self.rotation(), &wiring)?;
                Ok(Box::new(outlet))
            }
        }
    };
}

file_sink!(CsvSink, Format::Csv);
file_sink!(JsonLinesSink, Format::JsonLines);

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

/// Rows on their way to files.
struct FileOutlet {
    files: RowFiles,
    rotation: Rotation,
    held: Bytes,
    writer: Writer,
    time: TimeBase,
    /// The instant of the newest row of the file that is written.
    last: Option<Instant>,
}

impl FileOutlet {
    fn open(
        path: &Path,
        format: Format,
        rotation: Rotation,
        wiring: &SinkWiring,
    ) -> Result<Self, ConnectorError> {
        let path = in_folder(&wiring.folder, path);
        let (title, columns) = columns(wiring);
        let (shown, held) = (path.display().to_string(), Bytes::default());
        let writer = Writer::to_write(
            &shown,
            held.clone(),
            format,
            &title,
            &columns,
            Flush::EachRow,
        );
        let layout = Layout {
            format,
            time: TimeColumn::from(&wiring.time),
            columns,
            // It has written the names of the columns.
            header: held.with(std::mem::take),
        };
        let mut outlet = Self {
            files: RowFiles::new(path, layout),
            rotation,
            held,
            writer: writer.map_err(ConnectorError::new)?,
            time: wiring.time.clone(),
            last: None,
        };
        let ready = outlet.files.ready();
        outlet.last = ready.map_err(|error| outlet.failed(&error))?;
        Ok(outlet)
    }

    /// Writes what is held back; all of it, or none.
    fn write(&mut self) -> io::Result<()> {
        let files = &mut self.files;
        self.held.with(|held| {
            if !held.is_empty() {
                files.append(held)?;
                held.clear();
            }
            Ok(())
        })
    }

    /// Makes room for a row: in memory, and in a file that is not full.
    fn make_room(&mut self, at: Instant) -> io::Result<()> {
        let held = self.held.with(|held| held.len());
        if held >= BUFFER {
            self.write()?;
        }
        let length = self.files.length() + held as u64;
        if let Some(last) = self.last
            && self.rotation.is_due(last, at, length)
        {
            self.write()?;
            self.files.rotate(last)?;
            self.last = None;
        }
        Ok(())
    }

    fn failed(&self, error: &io::Error) -> ConnectorError {
        let (shown, words) = (self.files.path().display().to_string(), error.to_string());
        match words.starts_with(&shown) {
            true => ConnectorError::new(words),
            false => ConnectorError::new(format_args!("cannot write {shown}: {words}")),
        }
    }
}

impl Outlet for FileOutlet {
    fn put(&mut self, row: &OutRow<'_>) -> Result<(), ConnectorError> {
        let room = self.make_room(row.at);
        room.map_err(|error| self.failed(&error))?;
        let text = time_text(&self.time, row.at);
        let label = format!("{:016x}", row.revision);
        self.last = Some(row.at);
        self.writer
            .write_labelled_row(&text, row.at.as_ns(), row.outputs, &label)
            .map_err(ConnectorError::new)
    }

    fn flush(&mut self) -> Result<(), ConnectorError> {
        self.write().map_err(|error| self.failed(&error))
    }

    fn kept(&mut self) -> Option<&mut dyn Kept> {
        Some(self)
    }
}

impl Kept for FileOutlet {
    fn end(&mut self) -> Result<Place, ConnectorError> {
        let end = self.write().and_then(|()| self.files.end());
        end.map_err(|error| self.failed(&error))
    }

    fn rows_after(&mut self, end: Place) -> Result<Option<u64>, ConnectorError> {
        let rows = self.files.rows_after(end);
        rows.map_err(|error| self.failed(&error))
    }

    fn cut(&mut self, end: Place, rows: u64) -> Result<(), ConnectorError> {
        let cut = self.files.cut(end, rows);
        cut.map_err(|error| self.failed(&error))
    }

    fn forget(&mut self, end: Place) {
        if let Some(keep) = self.rotation.keep {
            // What stays is removed the next time.
            let _ = self.files.forget(end, keep);
        }
    }
}
