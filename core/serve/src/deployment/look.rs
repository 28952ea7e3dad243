//! What the sources of a deployment have of each channel at present, as a table.

use std::fmt;
use std::path::Path;
use std::time::Duration as Wait;

use serde_json::{Value, json};

use super::Deployment;
use crate::compile::Plan;
use crate::connector::{ConnectorError, Seen};

/// What a source has, or of a sink, what its outputs go to.
#[derive(Debug)]
pub struct Found {
    /// Whether it is a source or a sink.
    pub role: &'static str,
    /// Its name.
    pub name: String,
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
    /// Asks each source for one of everything, and each sink whether it can put out what it is given, which may take so long each.
    /// `plan` is what it was read with, `state` the folder of the service.
    #[must_use]
    pub fn look(&self, plan: &Plan, state: &Path, patience: Wait) -> Vec<Found> {
        let lacks = |seen: &Vec<Seen>| seen.iter().filter(|of| of.value.is_none()).count();
        let sources = self.sources.iter().map(|source| {
            let seen = source.parameters.look(source.wiring(plan, state), patience);
            let named = |of: Seen| {
                let channel = &source.channels[of.channel];
                (channel.channel.name.clone(), channel.address.clone(), of)
            };
            Found {
                role: "source",
                name: source.name.clone(),
                missing: seen.as_ref().map_or(source.channels.len(), lacks),
                channels: seen.map(|seen| seen.into_iter().map(named).collect()),
            }
        });
        let sinks = self.sinks.iter().filter_map(|sink| {
            let seen = sink.parameters.look(sink.wiring(plan, state), patience)?;
            let named = |mut of: Seen| {
                let to = std::mem::take(&mut of.granted);
                (sink.outputs[of.channel].clone(), to, of)
            };
            Some(Found {
                role: "sink",
                name: sink.name.clone(),
                missing: seen.as_ref().map_or(sink.outputs.len(), lacks),
                channels: seen.map(|seen| seen.into_iter().map(named).collect()),
            })
        });
        sources.chain(sinks).collect()
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
        json!({ self.role: self.name, "channels": channels.ok(), "error": error })
    }
}

impl fmt::Display for Found {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let channels = match &self.channels {
            Ok(channels) => channels,
            Err(error) => return writeln!(f, "{} `{}`: {error}", self.role, self.name),
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
            "{} `{}`, {} of {} missing",
            self.role,
            self.name,
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
