//! `csv` and `jsonl` as sources: a file that a logger writes, followed as it grows.

use std::path::PathBuf;

use athermal_core::time::Instant;
use athermal_files::Format;
use athermal_serve::connector::{
    ConnectorError, Inlet, Outflow, Source, SourceWiring, Stamps, Stop,
};
use athermal_serve::register_source;
use schemars::JsonSchema;
use serde::Deserialize;

use crate::follow::Follow;
use crate::table::{in_folder, pass, reader};

/// A CSV file that is followed as it grows, also when it is moved away and begun anew. What stands in it already is read first. Each
/// channel has a column, by the names that the signals give them or `channels` does; the time is read as `[time]` says.
#[derive(Debug, Deserialize, JsonSchema)]
pub struct CsvSource {
    /// The file. It may not be there yet.
    path: PathBuf,
}

/// JSON lines that are followed as they grow, an object a line; else as a CSV file.
#[derive(Debug, Deserialize, JsonSchema)]
pub struct JsonLinesSource {
    /// The file. It may not be there yet.
    path: PathBuf,
}

register_source!(CsvSource, "csv");
register_source!(JsonLinesSource, "jsonl");

impl Source for CsvSource {
    fn stamps(&self) -> Stamps {
        Stamps::Order
    }

    fn open(&self, wiring: SourceWiring) -> Result<Box<dyn Inlet>, ConnectorError> {
        Ok(FileInlet::open(&self.path, Format::Csv, wiring))
    }
}

impl Source for JsonLinesSource {
    fn stamps(&self) -> Stamps {
        Stamps::Order
    }

    fn open(&self, wiring: SourceWiring) -> Result<Box<dyn Inlet>, ConnectorError> {
        Ok(FileInlet::open(&self.path, Format::JsonLines, wiring))
    }
}

struct FileInlet {
    path: PathBuf,
    format: Format,
    wiring: SourceWiring,
    /// The last row that was given.
    last: Option<Instant>,
}

impl FileInlet {
    fn open(path: &std::path::Path, format: Format, wiring: SourceWiring) -> Box<dyn Inlet> {
        Box::new(Self {
            path: in_folder(&wiring.folder, path),
            format,
            wiring,
            last: None,
        })
    }
}

impl Inlet for FileInlet {
    fn run(&mut self, out: &mut Outflow, stop: &Stop) -> Result<(), ConnectorError> {
        let name = self.path.display().to_string();
        while !stop.is_asked() {
            let file = Follow::open(self.path.clone(), stop.clone());
            let file = file.map_err(|error| {
                ConnectorError::new(format_args!("cannot open {name}: {error}"))
            })?;
            let opened = reader(&name, file, &self.wiring, Some(self.format), self.last, out);
            let mut reader = match opened {
                Ok(reader) => reader,
                // Stopped before there was a line, or replaced by one that has.
                Err(athermal_files::FileError::Empty { .. }) => continue,
                Err(error) => return Err(ConnectorError::new(error)),
            };
            out.connected();
            let last = pass(&mut reader, out, stop, |_| true)?;
            self.last = last.or(self.last);
        }
        Ok(())
    }
}
