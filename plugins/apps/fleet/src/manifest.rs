//! Decides what a folder of models remembers of a fleet: of each machine what it was fitted on and what came of it.

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, UNIX_EPOCH};

use athermal_run::live::store::write_whole;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::doubts::Doubt;
use crate::figure::Figure;
use crate::job::Unfitted;
use athermal_jobs::RowsId;
use athermal_jobs::blocks::Cut;
use athermal_jobs::data::Reading;

/// The file in a folder of models.
const NAME: &str = "_fleet.json";

/// The format that this version writes.
const FORMAT: u64 = 1;

/// Between two times that it is written pass so many times as long as that takes.
const SPARING: u32 = 20;

/// Why a manifest cannot be used.
#[derive(Debug, Error)]
pub enum ManifestError {
    /// The file cannot be read.
    #[error("cannot read {path}: {source}")]
    Unreadable {
        /// The file.
        path: String,
        /// Why.
        source: io::Error,
    },
    /// It is none.
    #[error(
        "{path} is no manifest of a fleet: {source}; name another folder, or remove it to fit all machines anew"
    )]
    NoManifest {
        /// The file.
        path: String,
        /// Why.
        source: serde_json::Error,
    },
    /// A newer version wrote it.
    #[error("{path} has format {format}, and this version knows up to {FORMAT}: update athermal")]
    TooNew {
        /// The file.
        path: String,
        /// Its format.
        format: u64,
    },
}

/// A fleet as it was fitted.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Manifest {
    athermal_fleet: u64,
    /// The graph, as it was given.
    pub graph: String,
    /// The checksum of its content.
    pub graph_hash: String,
    /// The date on the models that are fitted now.
    pub created: Option<String>,
    /// Whether all machines that were asked for have been tried.
    pub finished: bool,
    /// What came of each.
    pub machines: BTreeMap<String, Entry>,
}

/// What a machine was fitted on, and what came of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Entry {
    /// What came of it.
    pub outcome: Outcome,
    /// Why it failed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub error: Option<String>,
    /// The date on its model.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub created: Option<String>,
    /// The files, and how they were then.
    pub files: Vec<Stamp>,
    /// The rows in them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rows: Option<RowsId>,
    /// What it was made by.
    pub by: Maker,
    /// How well it fits: the error of each estimator on the rows of the fit.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub scores: Vec<Figure>,
    /// The nodes that could not be fitted.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub unfitted: Vec<Unfitted>,
    /// Outputs that are constant, since no voter has a regressor left.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub constant: Vec<String>,
    /// What may be wrong with the data.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub doubts: Vec<Doubt>,
}

/// Whether a machine has a model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// It has.
    Fitted,
    /// It has none, or an older one.
    Failed,
}

/// All beside the rows that a model depends on.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Maker {
    /// The version of the program.
    pub athermal: String,
    /// The checksum of the graph's content.
    pub graph_hash: String,
    /// How the files were read.
    pub reading: Reading,
    /// How rows were cut into blocks, where they were.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub blocks: Option<Cut>,
}

/// A file as it was when it was read.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Stamp {
    /// Its path.
    pub path: PathBuf,
    /// Its length.
    pub bytes: u64,
    /// When it was last written, in ns since 1970.
    pub modified_ns: u128,
}

impl Stamp {
    /// A file as it is; of one that cannot be looked at zeros, so that it is read, which then says why it cannot be.
    #[must_use]
    pub fn of(path: &Path) -> Self {
        let there = fs::metadata(path).ok();
        let modified = there.as_ref().and_then(|of| of.modified().ok());
        let since_1970 = modified.and_then(|at| at.duration_since(UNIX_EPOCH).ok());
        Self {
            path: path.to_owned(),
            bytes: there.map_or(0, |of| of.len()),
            modified_ns: since_1970.map_or(0, |of| of.as_nanos()),
        }
    }
}

impl Manifest {
    /// One of no machine yet.
    #[must_use]
    pub fn new(graph: String, graph_hash: String) -> Self {
        Self {
            athermal_fleet: FORMAT,
            graph,
            graph_hash,
            created: None,
            finished: false,
            machines: BTreeMap::new(),
        }
    }

    /// The file in a folder of models.
    #[must_use]
    pub fn path_in(folder: &Path) -> PathBuf {
        folder.join(NAME)
    }

    /// That of a folder; none where there is none.
    ///
    /// # Errors
    /// When there is one that cannot be used.
    pub fn read(folder: &Path) -> Result<Option<Self>, ManifestError> {
        let file = Self::path_in(folder);
        let path = file.display().to_string();
        let text = match fs::read_to_string(&file) {
            Ok(text) => text,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(source) => return Err(ManifestError::Unreadable { path, source }),
        };
        let read: Result<Self, _> = serde_json::from_str(&text);
        match read {
            Err(source) => Err(ManifestError::NoManifest { path, source }),
            Ok(of) if of.athermal_fleet > FORMAT => {
                let format = of.athermal_fleet;
                Err(ManifestError::TooNew { path, format })
            }
            Ok(of) => Ok(Some(of)),
        }
    }
}

/// A manifest and when it was last written.
#[derive(Debug)]
pub struct Writing {
    /// What is written.
    pub manifest: Manifest,
    /// Whether it says more than what was last written.
    pub is_new: bool,
    path: PathBuf,
    /// When it was last written, and how long that took.
    last: Option<(Instant, Duration)>,
}

impl Writing {
    /// Writes a manifest into this folder from now on.
    #[must_use]
    pub fn new(manifest: Manifest, folder: &Path) -> Self {
        let path = Manifest::path_in(folder);
        Self {
            manifest,
            is_new: true,
            path,
            last: None,
        }
    }

    /// Writes what is new, unless that was done just now and takes long: what a program that is killed has not written is fitted again.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn write_soon(&mut self) -> io::Result<()> {
        match self.last {
            _ if !self.is_new => Ok(()),
            Some((at, took)) if at.elapsed() < took * SPARING => Ok(()),
            _ => self.write(),
        }
    }

    /// Writes it whole: who reads it sees the old one or the new one.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn write(&mut self) -> io::Result<()> {
        let began = Instant::now();
        let text = serde_json::to_string_pretty(&self.manifest)? + "\n";
        write_whole(&self.path, text.as_bytes())?;
        self.last = Some((Instant::now(), began.elapsed()));
        self.is_new = false;
        Ok(())
    }
}
