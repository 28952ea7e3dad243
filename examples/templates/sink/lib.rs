//! A sink of athermal: a file with the largest value that each output had.
//!
//! Make it send rows to your controller instead. A sink that moves something gives [`Purpose::Command`] as its purpose: then only
//! recent rows come, and none changes faster than the machine file's `rate`.
//!
//! [`Purpose::Command`]: athermal_serve::connector::Purpose::Command

use std::fmt::Write as _;
use std::fs;
use std::io::ErrorKind;
use std::path::PathBuf;

use athermal_serve::connector::{ConnectorError, OutRow, Outlet, Sink, SinkWiring};
use athermal_serve::register_sink;
use schemars::JsonSchema;
use serde::Deserialize;

/// Keeps the largest value that each output had, in a file with a line for each.
#[derive(Debug, Deserialize, JsonSchema)]
pub struct MyNode {
    /// The file. What it holds from before a restart counts too.
    path: PathBuf,
}

register_sink!(MyNode, "my_node");

impl MyNode {
    /// A sink that keeps its file there.
    pub fn new(path: impl Into<PathBuf>) -> Self {
        Self { path: path.into() }
    }
}

impl Sink for MyNode {
    fn open(&self, wiring: SinkWiring) -> Result<Box<dyn Outlet>, ConnectorError> {
        let path = wiring.folder.join(&self.path);
        let before = match fs::read_to_string(&path) {
            Err(error) if error.kind() == ErrorKind::NotFound => String::new(),
            read => read.map_err(ConnectorError::new)?,
        };
        let known = |name: &str| {
            let mut lines = before.lines().filter_map(|line| line.split_once(' '));
            let (_, value) = lines.find(|(of, _)| *of == name)?;
            value.parse().ok()
        };
        let outputs = wiring.outputs.into_iter();
        let largest = outputs.map(|output| (known(&output.name).unwrap_or(f64::NAN), output.name));
        Ok(Box::new(Largest {
            path,
            largest: largest.collect(),
        }))
    }
}

struct Largest {
    path: PathBuf,
    /// By output; NaN where there was none.
    largest: Vec<(f64, String)>,
}

impl Outlet for Largest {
    fn put(&mut self, row: &OutRow<'_>) -> Result<(), ConnectorError> {
        for ((largest, _), output) in self.largest.iter_mut().zip(row.outputs) {
            // NaN is no output, and no maximum of numbers.
            *largest = largest.max(*output);
        }
        Ok(())
    }

    fn flush(&mut self) -> Result<(), ConnectorError> {
        let mut text = String::new();
        for (largest, name) in self.largest.iter().filter(|(of, _)| !of.is_nan()) {
            writeln!(text, "{name} {largest}").map_err(ConnectorError::new)?;
        }
        // Never half a file: written beside, then put in its place.
        let aside = self.path.with_extension("new");
        let written = fs::write(&aside, text).and_then(|()| fs::rename(&aside, &self.path));
        written.map_err(|error| {
            ConnectorError::new(format_args!(
                "cannot write {}: {error}",
                self.path.display()
            ))
        })
    }
}
