//! A long layout: which channel a row is of, by the name in one of its cells. Not whether a table that declares none has one.

use std::collections::{BTreeSet, HashMap};

use crate::columns::{self, name};
use crate::{FileError, Layout, Place};

/// How many names of channels a message lists.
const LISTED: usize = 50;

/// The channels of a table that has a row for each value.
pub(crate) struct Long {
    /// The channels that are called by each name.
    channels: HashMap<String, Vec<usize>>,
    /// Whether a row was of each channel.
    seen: Vec<bool>,
    /// Names of other channels, for a message.
    others: BTreeSet<String>,
    /// The name in the current row.
    current: String,
}

impl Long {
    pub fn of(layout: &Layout) -> Self {
        let mut channels: HashMap<String, Vec<usize>> = HashMap::new();
        for (at, channel) in layout.channels.iter().enumerate() {
            let of_name = channels.entry(channel.column.clone()).or_default();
            of_name.push(at);
        }
        Self {
            channels,
            seen: vec![false; layout.channels.len()],
            others: BTreeSet::new(),
            current: String::new(),
        }
    }

    /// Whether the row whose cell names this channel has a value that is wanted.
    pub fn takes(&mut self, cell: &[u8]) -> bool {
        self.current = name(cell);
        match self.channels.get(&self.current) {
            Some(channels) => {
                channels.iter().for_each(|&at| self.seen[at] = true);
                true
            }
            None => {
                if self.others.len() < LISTED {
                    self.others.insert(self.current.clone());
                }
                false
            }
        }
    }

    /// Whether a row was of each channel.
    pub fn seen(&self) -> &[bool] {
        &self.seen
    }

    /// The channels that the current row has a value of.
    pub fn channels(&self) -> &[usize] {
        self.channels.get(&self.current).map_or(&[], Vec::as_slice)
    }

    /// Refuses a table without a row of a channel that must be there.
    pub fn check(&self, layout: &Layout, place: Place) -> Result<(), FileError> {
        let channels = layout.channels.iter().zip(&self.seen);
        let never = channels.filter(|(channel, seen)| !channel.optional && !**seen);
        let never: Vec<&str> = never.map(|(channel, _)| channel.column.as_str()).collect();
        if never.is_empty() {
            return Ok(());
        }
        let seen = self.channels.iter();
        let seen = seen.filter(|(_, channels)| channels.iter().any(|&at| self.seen[at]));
        let found: BTreeSet<&String> = seen.map(|(name, _)| name).chain(&self.others).collect();
        let found: Vec<String> = found.into_iter().cloned().collect();
        let note = " in the column that `[table]` declares for names";
        Err(columns::missing(place, never, &found, note))
    }
}
