//! What outlives a run: its state, the graph that ran, and the locks on its files.

mod identity;
mod lock;
mod running_model;
mod whole_file;

pub use identity::OutputIdentity;
pub use lock::FileLock;
pub use whole_file::{copy_whole, write_whole};

use std::path::{Path, PathBuf};
use std::{fmt, io};

use crate::engine::{Engine, RestoreError};
use crate::model::Model;
use running_model::RunningModel;

/// The state of a run in a file, from one run to the next.
#[derive(Debug)]
pub struct StateStore {
    path: PathBuf,
    _lock: FileLock,
    /// The graph that runs, where that may be another than the one given.
    running: Option<RunningModel>,
    /// The revision of what ran when the state was last saved.
    revision: String,
}

impl StateStore {
    /// Locks a state. `with_model` keeps the running graph beside it: for runs whose graph may be replaced.
    ///
    /// # Errors
    /// When another run holds it.
    pub fn open(path: &Path, with_model: bool) -> Result<Self, StateError> {
        let path = path.to_owned();
        let Some(lock) = FileLock::acquire(&path) else {
            return Err(StateError::Held { path });
        };
        Ok(Self {
            running: with_model.then(|| RunningModel::beside(&path)),
            path,
            _lock: lock,
            revision: String::new(),
        })
    }

    /// The files beside a state in which a running graph is kept.
    #[must_use]
    pub fn model_paths(state: &Path) -> [PathBuf; 2] {
        RunningModel::beside(state).paths()
    }

    /// The file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The graph that ran last, where it is kept and the state is one of it.
    #[must_use]
    pub fn last_model(&self) -> Option<Model> {
        self.running.as_ref()?.of_state(&self.path)
    }

    /// Lets an engine go on from the state; false where there is none yet.
    ///
    /// # Errors
    /// When the file cannot be read, or is the state of another graph or fit.
    pub fn restore(&self, engine: &mut Engine) -> Result<bool, StateError> {
        let path = self.path.clone();
        let bytes = match std::fs::read(&path) {
            Ok(bytes) => bytes,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(false),
            Err(error) => return Err(StateError::Unreadable { path, error }),
        };
        if let Err(error) = engine.restore(&bytes) {
            let error = Box::new(error);
            return Err(StateError::Foreign { path, error });
        }
        engine.count_afresh();
        Ok(true)
    }

    /// Whether the state was last saved of another graph than this one.
    #[must_use]
    pub fn is_outdated(&self, engine: &Engine) -> bool {
        engine.revision() != self.revision
    }

    /// Saves the state of an engine, and the model that it runs.
    ///
    /// # Errors
    /// When a file cannot be written.
    pub fn save(&mut self, engine: &Engine, model: &Model) -> Result<(), StateError> {
        engine.revision().clone_into(&mut self.revision);
        let written = |path: &Path, written: io::Result<()>| {
            let path = path.to_owned();
            written.map_err(|error| StateError::NotWritten { path, error })
        };
        if let Some(running) = &mut self.running {
            let saved = running.save(model, &self.revision);
            written(&running.paths()[0], saved)?;
        }
        let saved = write_whole(&self.path, &engine.snapshot());
        written(&self.path, saved)?;
        if let Some(running) = &self.running {
            running.remove_before();
        }
        Ok(())
    }
}

/// Why a state cannot be used.
#[derive(Debug)]
pub enum StateError {
    /// Another run holds it.
    Held {
        /// The file.
        path: PathBuf,
    },
    /// It is the state of another graph or fit.
    Foreign {
        /// The file.
        path: PathBuf,
        /// What differs.
        error: Box<RestoreError>,
    },
    /// It cannot be read.
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Why.
        error: io::Error,
    },
    /// It cannot be written.
    NotWritten {
        /// The file.
        path: PathBuf,
        /// Why.
        error: io::Error,
    },
}

impl fmt::Display for StateError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Held { path } => {
                write!(f, "{}: another run keeps its state there", path.display())
            }
            Self::Foreign { path, error } => write!(
                f,
                "cannot go on from {}: {error}; name another file to begin cold and keep this one",
                path.display()
            ),
            Self::Unreadable { path, error } => {
                write!(f, "cannot read {}: {error}", path.display())
            }
            Self::NotWritten { path, error } => {
                write!(f, "cannot write {}: {error}", path.display())
            }
        }
    }
}

impl std::error::Error for StateError {}
