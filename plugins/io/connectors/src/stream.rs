//! `stdin` and `stdout`.

use std::io;

use athermal_files::{FileError, Flush, Format, STANDARD_INPUT, Writer};
use athermal_serve::connector::{
    ConnectorError, Inlet, OutRow, Outflow, Outlet, Sink, SinkWiring, Source, SourceWiring, Stamps,
    Stop,
};
use athermal_serve::{register_sink, register_source};
use schemars::JsonSchema;
use serde::Deserialize;

use crate::file_sink::{columns, time_text};
use crate::pipe::Pipe;
use crate::table::{pass, reader};

/// How rows of a pipe are written.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Rows {
    /// A line with the names of the columns, then a line a row.
    #[default]
    Csv,
    /// An object a line.
    Jsonl,
}

impl Rows {
    fn format(self) -> Format {
        match self {
            Self::Csv => Format::Csv,
            Self::Jsonl => Format::JsonLines,
        }
    }
}

/// Rows from standard input, until it ends; the service ends with it. What a pipe gave is not given again after a restart.
#[derive(Debug, Deserialize, JsonSchema)]
pub struct StandardInput {
    /// How the rows are written: "csv" or "jsonl".
    #[serde(default)]
    format: Rows,
}

register_source!(StandardInput, "stdin");

impl Source for StandardInput {
    fn stamps(&self) -> Stamps {
        Stamps::Order
    }

    fn ends(&self) -> bool {
        true
    }

    fn open(&self, wiring: SourceWiring) -> Result<Box<dyn Inlet>, ConnectorError> {
        Ok(Box::new(StandardInlet {
            format: self.format.format(),
            wiring,
        }))
    }
}

struct StandardInlet {
    format: Format,
    wiring: SourceWiring,
}

impl Inlet for StandardInlet {
    fn run(&mut self, out: &mut Outflow, stop: &Stop) -> Result<(), ConnectorError> {
        let opened = reader(
            STANDARD_INPUT,
            Pipe::new(stop),
            &self.wiring,
            Some(self.format),
            None,
            out,
        );
        let mut reader = match opened {
            // It has ended, be it after a failure: it cannot be read again.
            Err(FileError::Empty { .. }) => return Ok(()),
            opened => opened.map_err(ConnectorError::new)?,
        };
        out.connected();
        pass(&mut reader, out, stop, |_| true).map(|_| ())
    }
}

/// A row for each tick to standard output.
#[derive(Debug, Deserialize, JsonSchema)]
pub struct StandardOutput {
    /// How the rows are written: "csv" or "jsonl".
    #[serde(default)]
    format: Rows,
}

register_sink!(StandardOutput, "stdout");

impl Sink for StandardOutput {
    fn open(&self, wiring: SinkWiring) -> Result<Box<dyn Outlet>, ConnectorError> {
        Ok(Box::new(StandardOutlet {
            format: self.format.format(),
            wiring,
            writer: None,
            values: Vec::new(),
        }))
    }
}

struct StandardOutlet {
    format: Format,
    wiring: SinkWiring,
    writer: Option<Writer>,
    values: Vec<f64>,
}

impl Outlet for StandardOutlet {
    fn put(&mut self, row: &OutRow<'_>) -> Result<(), ConnectorError> {
        let writer = match &mut self.writer {
            Some(writer) => writer,
            none => {
                let (time, columns) = columns(&self.wiring);
                let out = io::stdout();
                let format = self.format;
                let made = Writer::to_write(
                    "standard output",
                    out,
                    format,
                    &time,
                    &columns,
                    Flush::EachRow,
                );
                none.insert(made.map_err(ConnectorError::new)?)
            }
        };
        self.values.clear();
        self.values.extend_from_slice(row.outputs);
        let text = time_text(&self.wiring.time, row.at);
        let label = format!("{:016x}", row.revision);
        writer
            .write_labelled_row(&text, row.at.as_ns(), &self.values, &label)
            .map_err(ConnectorError::new)
    }
}
