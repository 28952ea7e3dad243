//! The state folder of a service: its journal, checkpoints and models, held by one process.

use std::fs::{self, File, TryLockError};
use std::io::{Read, Seek, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration as Wait, Instant as Clock};
use std::{fmt, io};

use athermal_run::live::store::write_whole;
use athermal_run::model::{Model, ModelError};

use crate::checkpoint::Checkpoints;

/// How long a process that is ending is waited for.
const ENDS: Wait = Wait::from_secs(1);

/// The state folder of a service. It is locked for as long as this lives; the lock goes with the process, however it ends.
#[derive(Debug)]
pub struct StateFolder {
    paths: StatePaths,
    /// None as long as it can be neither made nor locked.
    lock: Arc<Mutex<Option<File>>>,
}

/// Whether what keeps a disk from being written may pass: it is full, or may not be written. Then it is tried again, and no mistake.
#[must_use]
pub fn may_pass(error: &io::Error) -> bool {
    use io::ErrorKind::{
        AlreadyExists, InvalidFilename, InvalidInput, IsADirectory, NotADirectory,
    };
    let never = [
        AlreadyExists,
        InvalidFilename,
        InvalidInput,
        IsADirectory,
        NotADirectory,
    ];
    !never.contains(&error.kind())
}

/// What is where in a state folder. Whoever only reads needs no lock.
#[derive(Debug, Clone)]
pub struct StatePaths(PathBuf);

impl std::ops::Deref for StateFolder {
    type Target = StatePaths;

    fn deref(&self) -> &StatePaths {
        &self.paths
    }
}

impl StateFolder {
    /// Makes the folder where it is not there, and locks it. One on a disk that is full or may not be written is [prepared](Self::prepare)
    /// later.
    ///
    /// # Errors
    /// When another process holds it for more than a second, or it can never be one.
    pub fn open(path: &Path) -> Result<Self, FolderError> {
        let folder = Self {
            paths: StatePaths::new(path),
            lock: Arc::default(),
        };
        match folder.prepare() {
            Err(FolderError::NotWritten { error, .. }) if may_pass(&error) => {}
            prepared => prepared?,
        }
        Ok(folder)
    }

    /// Locks the folder, and makes what it lacks, as far as that has not been done.
    ///
    /// # Errors
    /// When another process holds it, or it cannot be written.
    pub fn prepare(&self) -> Result<(), FolderError> {
        let mut lock = self.lock.lock().unwrap_or_else(PoisonError::into_inner);
        if lock.is_none() {
            *lock = Some(locked(self.path())?);
        }
        for part in [
            self.journal(),
            self.checkpoints(),
            self.models(),
            self.swaps(),
        ] {
            fs::create_dir_all(&part).map_err(not_written(&part))?;
        }
        Ok(())
    }

    /// The same, for whoever does not have the folder.
    pub(crate) fn preparation(&self) -> impl FnMut() -> io::Result<()> + Send + 'static {
        let folder = Self {
            paths: self.paths.clone(),
            lock: Arc::clone(&self.lock),
        };
        move || folder.prepare().map_err(io::Error::other)
    }
}

fn not_written(path: &Path) -> impl Fn(io::Error) -> FolderError {
    let path = path.to_owned();
    move |error| FolderError::NotWritten {
        path: path.clone(),
        error: match error.kind() {
            io::ErrorKind::AlreadyExists => io::Error::new(
                error.kind(),
                "it is there and no folder: name another state folder",
            ),
            _ => error,
        },
    }
}

/// The lock of a folder, which is made where it is not there.
fn locked(path: &Path) -> Result<File, FolderError> {
    let lock = path.join("lock");
    fs::create_dir_all(path).map_err(not_written(path))?;
    let mut options = File::options();
    options.read(true).write(true).create(true).truncate(false);
    let opened = options.open(&lock);
    // One that may not be written can be locked all the same.
    let opened = opened.or_else(|error| File::open(&lock).map_err(|_| error));
    let mut file = opened.map_err(not_written(&lock))?;
    let began = Clock::now();
    while let Err(error) = file.try_lock() {
        match error {
            TryLockError::Error(error) => return Err(not_written(&lock)(error)),
            TryLockError::WouldBlock if began.elapsed() < ENDS => {
                std::thread::sleep(Wait::from_millis(20));
            }
            TryLockError::WouldBlock => {
                let mut by = String::new();
                let _ = file.read_to_string(&mut by);
                return Err(FolderError::Held {
                    path: path.to_owned(),
                    by: by.trim().parse().ok(),
                });
            }
        }
    }
    let id = std::process::id();
    // Who holds it is for people: a full disk does not know.
    let _ = file
        .set_len(0)
        .and_then(|()| file.rewind())
        .and_then(|()| writeln!(file, "{id}"));
    Ok(file)
}

impl StatePaths {
    /// Those of a folder.
    #[must_use]
    pub fn new(folder: &Path) -> Self {
        Self(folder.to_owned())
    }

    /// The folder.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.0
    }

    /// Where the journal is.
    #[must_use]
    pub fn journal(&self) -> PathBuf {
        self.0.join("journal")
    }

    /// Where checkpoints are.
    #[must_use]
    pub fn checkpoints(&self) -> PathBuf {
        self.0.join("checkpoints")
    }

    /// Where models are.
    #[must_use]
    pub fn models(&self) -> PathBuf {
        self.0.join("models")
    }

    /// Where graphs are as they were when they were committed: what a replay lets take over.
    #[must_use]
    pub fn swaps(&self) -> PathBuf {
        self.0.join("swaps")
    }

    /// Graphs as they were when they were committed; all are kept that the journal goes back to.
    #[must_use]
    pub fn commits(&self) -> Checkpoints {
        Checkpoints::new(self.swaps(), usize::MAX)
    }

    /// The revision of the graph that the service was given last and ran; none where that is not known.
    #[must_use]
    pub fn given(&self) -> Option<String> {
        fs::read_to_string(self.0.join("given")).ok()
    }

    /// Notes the revision of the graph that the service was given.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn note_given(&self, revision: &str) -> io::Result<()> {
        write_whole(&self.0.join("given"), revision.as_bytes())
    }

    /// Keeps a model by its revision, so that a checkpoint of it is of use.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn keep_model(&self, model: &Model, revision: &str) -> Result<(), FolderError> {
        let path = self.model_path(revision);
        if path.exists() {
            return Ok(());
        }
        let text = model.to_text().map_err(io::Error::other);
        text.and_then(|text| write_whole(&path, text.as_bytes()))
            .map_err(|error| FolderError::NotWritten { path, error })
    }

    /// The model of a revision.
    ///
    /// # Errors
    /// When it is not there, or cannot be read.
    pub fn model(&self, revision: &str) -> Result<Model, ModelError> {
        Model::load(self.model_path(revision))
    }

    fn model_path(&self, revision: &str) -> PathBuf {
        self.models().join(format!("{revision}.json"))
    }
}

/// Why a state folder cannot be used.
#[derive(Debug)]
pub enum FolderError {
    /// Another process holds it.
    Held {
        /// The folder.
        path: PathBuf,
        /// The number of the process, where it is known.
        by: Option<u32>,
    },
    /// It cannot be written.
    NotWritten {
        /// The file or folder.
        path: PathBuf,
        /// Why.
        error: io::Error,
    },
}

impl fmt::Display for FolderError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Held { path, by } => {
                write!(
                    f,
                    "{}: another service keeps its state there",
                    path.display()
                )?;
                by.map_or(Ok(()), |by| write!(f, " (process {by})"))
            }
            Self::NotWritten { path, error } => {
                write!(f, "cannot write {}: {error}", path.display())
            }
        }
    }
}

impl std::error::Error for FolderError {}
