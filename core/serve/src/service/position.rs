//! How far a sink is: where its rows end, and after how many ticks that was.

use std::io;
use std::path::{Path, PathBuf};

use athermal_run::live::store::write_whole;
use serde::{Deserialize, Serialize};

use crate::connector::Place;

/// How far a sink is, as the state folder keeps it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Position {
    /// Where its rows end: see [`Kept::end`](crate::connector::Kept::end). None of a command, and where it was never opened.
    #[serde(default)]
    pub(super) place: Option<Place>,
    /// All rows of so many ticks, beats, breaks and freezes stand before.
    pub(super) happenings: u64,
    /// What a command had applied; none of a log.
    #[serde(default)]
    pub(super) applied: Vec<Option<f64>>,
}

impl Position {
    /// What a command had applied; NaN where that is not known.
    pub(super) fn applied(&self) -> Vec<f64> {
        let value = |of: &Option<f64>| of.unwrap_or(f64::NAN);
        self.applied.iter().map(value).collect()
    }
}

/// The file of a sink's position.
#[derive(Debug, Clone)]
pub(super) struct PositionFile(PathBuf);

impl PositionFile {
    /// That of a sink in a state folder.
    pub(super) fn new(folder: &Path, sink: &str) -> Self {
        Self(folder.join("sinks").join(format!("{sink}.json")))
    }

    /// The position; none where there is no file, or one that cannot be read.
    pub(super) fn read(&self) -> Option<Position> {
        let text = std::fs::read(&self.0).ok()?;
        serde_json::from_slice(&text).ok()
    }

    /// Keeps a position, whole or not at all.
    pub(super) fn write(&self, position: &Position) -> io::Result<()> {
        if let Some(folder) = self.0.parent() {
            std::fs::create_dir_all(folder)?;
        }
        let text = serde_json::to_vec(position)?;
        write_whole(&self.0, &text)
    }
}
