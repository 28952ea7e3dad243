//! How a service is run, and what is left of it.

use std::path::PathBuf;

use super::ChannelSamples;
use crate::host;
use crate::journal::JournalStatus;
use crate::time::Instant;

/// How a service is run.
#[derive(Debug, Clone)]
pub struct ServiceOptions {
    /// The state folder.
    pub state: PathBuf,
    /// Whether commands are not put out.
    pub is_dry: bool,
    /// Whether estimators learn nothing.
    pub frozen: bool,
    /// The machine file.
    pub machine: PathBuf,
    /// Asks for the host's time, where it is known to be right: [`host::synchronised`].
    pub host_time: fn() -> Option<Instant>,
}

impl ServiceOptions {
    /// A service that puts everything out and learns, with its state in a folder.
    #[must_use]
    pub fn new(state: PathBuf) -> Self {
        Self {
            state,
            is_dry: false,
            frozen: false,
            machine: PathBuf::new(),
            host_time: host::synchronised,
        }
    }
}

/// What is left of a service that has ended.
#[derive(Debug)]
pub struct Ended {
    /// What became of the samples of each channel.
    pub channels: Vec<ChannelSamples>,
    /// How many ticks samples made since the start.
    pub ticks: u64,
    /// How many ticks, beats, breaks and freezes there were, those of earlier runs included.
    pub happenings: u64,
    /// How many ticks were cut early because too many samples waited.
    pub hurried: u64,
    /// How the journal is.
    pub journal: JournalStatus,
    /// Whether the engine could not go on.
    pub has_failed: bool,
}
