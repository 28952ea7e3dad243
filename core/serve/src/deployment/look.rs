//! What the sources of a deployment have of each channel at present, as a table.

use std::fmt;
use std::path::PathBuf;
use std::time::Duration as Wait;

use serde_json::{Value, json};

use super::Deployment;
use crate::compile::Plan;
use crate::connector::{ConnectorError, Seen};

/// What a source has.
#[derive(Debug)]
pub struct Found {
    /// The name of the source.
    pub source: String,
    /// A row for each channel, in the order of [`NAMES`]; or why it cannot be asked.
    pub rows: Result<Vec<[String; 7]>, ConnectorError>,
    /// How many channels have no value.
    pub missing: usize,
}

/// The columns of a table.
pub const NAMES: [&str; 7] = [
    "channel", "from", "value", "quality", "time", "clock", "granted",
];

impl Deployment {
    /// Asks each source for one of everything, which may take so long each. `plan` is what it was read with.
    #[must_use]
    pub fn look(&self, plan: &Plan, patience: Wait) -> Vec<Found> {
        let found = self.sources.iter().map(|source| {
            let seen = source
                .parameters
                .look(source.wiring(plan, PathBuf::new()), patience);
            let lacks = |seen: &Vec<Seen>| seen.iter().filter(|of| of.value.is_none()).count();
            let cells = |of: &Seen| {
                let channel = &source.channels[of.channel];
                let dash = || "-".to_owned();
                [
                    channel.channel.name.clone(),
                    channel.address.clone(),
                    of.value.map_or_else(dash, |value| value.to_string()),
                    of.quality.clone(),
                    of.stamp.clone().unwrap_or_else(dash),
                    of.offset
                        .map_or_else(dash, |of| format!("{:.3} s", of.secs())),
                    of.granted.clone(),
                ]
            };
            Found {
                source: source.name.clone(),
                missing: seen.as_ref().map_or(source.channels.len(), lacks),
                rows: seen.map(|seen| seen.iter().map(cells).collect()),
            }
        });
        found.collect()
    }
}

impl Found {
    /// The same for programs.
    #[must_use]
    pub fn to_json(&self) -> Value {
        let row = |row: &[String; 7]| {
            let cells = NAMES.iter().zip(row);
            Value::Object(
                cells
                    .map(|(name, cell)| ((*name).to_owned(), json!(cell)))
                    .collect(),
            )
        };
        let rows = self
            .rows
            .as_ref()
            .map(|rows| rows.iter().map(row).collect::<Vec<_>>());
        let error = rows.as_ref().err().map(ToString::to_string);
        json!({ "source": self.source, "channels": rows.ok(), "error": error })
    }
}

impl fmt::Display for Found {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let rows = match &self.rows {
            Ok(rows) => rows,
            Err(error) => return writeln!(f, "source `{}`: {error}", self.source),
        };
        writeln!(
            f,
            "source `{}`, {} of {} missing",
            self.source,
            self.missing,
            rows.len()
        )?;
        let head = NAMES.map(str::to_owned);
        let all = || std::iter::once(&head).chain(rows);
        let width = |nth: usize| all().map(|row| row[nth].chars().count()).max().unwrap_or(0);
        let widths: [usize; 7] = std::array::from_fn(width);
        for row in all() {
            let cells = row
                .iter()
                .zip(widths)
                .map(|(cell, width)| format!("{cell:width$}"));
            writeln!(f, "  {}", cells.collect::<Vec<_>>().join("  ").trim_end())?;
        }
        Ok(())
    }
}
