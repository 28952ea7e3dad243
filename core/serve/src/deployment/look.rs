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
    /// What it has of each channel, with the names of the channel and of its place; or why it cannot be asked.
    pub channels: Result<Vec<(String, String, Seen)>, ConnectorError>,
    /// How many channels have no value.
    pub missing: usize,
}

/// The columns of a table.
const NAMES: [&str; 7] = [
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
            let named = |of: Seen| {
                let channel = &source.channels[of.channel];
                (channel.channel.name.clone(), channel.address.clone(), of)
            };
            Found {
                source: source.name.clone(),
                missing: seen.as_ref().map_or(source.channels.len(), lacks),
                channels: seen.map(|seen| seen.into_iter().map(named).collect()),
            }
        });
        found.collect()
    }
}

impl Found {
    /// The same for programs.
    #[must_use]
    pub fn to_json(&self) -> Value {
        let channel = |(name, from, of): &(String, String, Seen)| {
            json!({
                "channel": name,
                "from": from,
                "value": of.value,
                "quality": of.quality,
                "time": of.stamp,
                "clock_s": of.offset.map(|of| of.secs()),
                "granted": of.granted,
            })
        };
        let channels = self.channels.as_ref();
        let channels = channels.map(|all| all.iter().map(channel).collect::<Vec<_>>());
        let error = channels.as_ref().err().map(ToString::to_string);
        json!({ "source": self.source, "channels": channels.ok(), "error": error })
    }
}

impl fmt::Display for Found {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let channels = match &self.channels {
            Ok(channels) => channels,
            Err(error) => return writeln!(f, "source `{}`: {error}", self.source),
        };
        let cells = |(name, from, of): &(String, String, Seen)| {
            let shown = |of: Option<String>| of.unwrap_or_else(|| "-".to_owned());
            [
                name.clone(),
                from.clone(),
                shown(of.value.map(|of| of.to_string())),
                of.quality.clone(),
                shown(of.stamp.clone()),
                shown(of.offset.map(|of| format!("{:.3} s", of.secs()))),
                of.granted.clone(),
            ]
        };
        let rows: Vec<_> = channels.iter().map(cells).collect();
        writeln!(
            f,
            "source `{}`, {} of {} missing",
            self.source,
            self.missing,
            rows.len()
        )?;
        let head = NAMES.map(str::to_owned);
        let all = || std::iter::once(&head).chain(&rows);
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
