//! Checkpoints: what an engine knew after so many ticks, so that the journal need not be read from its beginning.

use std::fmt;
use std::fs;
use std::io;
use std::ops::RangeBounds;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

use athermal_run::live::store::write_whole;

use crate::compile::Plan;
use crate::engine::{Engine, EngineState};
use crate::journal::sync_folder;
use crate::time::Instant;

const MAGIC: &[u8; 8] = b"athermC\n";

/// What an engine knew.
#[derive(Debug, Clone)]
pub struct Checkpoint {
    /// After how many ticks, beats, breaks and freezes.
    pub happenings: u64,
    /// The revision of its graph.
    pub revision: String,
    /// The engine's snapshot.
    pub snapshot: Vec<u8>,
}

impl Checkpoint {
    /// That of an engine after so many ticks, beats, breaks and freezes.
    #[must_use]
    pub fn of(engine: &Engine, happenings: u64) -> Self {
        Self::of_state(&engine.state(), happenings)
    }

    pub(crate) fn of_state(state: &EngineState, happenings: u64) -> Self {
        Self {
            happenings,
            revision: state.revision().to_owned(),
            snapshot: state.to_bytes(),
        }
    }

    fn to_bytes(&self) -> Vec<u8> {
        let release = env!("CARGO_PKG_VERSION");
        let mut bytes = MAGIC.to_vec();
        bytes.extend([0; 4]);
        bytes.extend(self.happenings.to_le_bytes());
        bytes.push(release.len() as u8);
        bytes.extend(release.as_bytes());
        bytes.extend(&self.snapshot);
        let crc = crc32fast::hash(&bytes[12..]);
        bytes[8..12].copy_from_slice(&crc.to_le_bytes());
        bytes
    }

    fn read(path: &Path) -> Result<Self, CheckpointError> {
        let path = path.to_owned();
        let bytes = match fs::read(&path) {
            Ok(bytes) => bytes,
            Err(error) => return Err(CheckpointError::Unreadable { path, error }),
        };
        let rest = bytes.strip_prefix(MAGIC);
        let Some((crc, rest)) = rest.and_then(|rest| rest.split_first_chunk()) else {
            return Err(CheckpointError::Damaged { path });
        };
        let parts = (crc32fast::hash(rest).to_le_bytes() == *crc).then(|| {
            let (happenings, rest) = rest.split_first_chunk()?;
            let (length, rest) = rest.split_first()?;
            let (release, snapshot) = rest.split_at_checked(usize::from(*length))?;
            Some((u64::from_le_bytes(*happenings), release, snapshot))
        });
        let Some((happenings, release, snapshot)) = parts.flatten() else {
            return Err(CheckpointError::Damaged { path });
        };
        if release != env!("CARGO_PKG_VERSION").as_bytes() {
            let release = String::from_utf8_lossy(release).into_owned();
            return Err(CheckpointError::OtherRelease { path, release });
        }
        match EngineState::from_bytes(snapshot) {
            Ok(state) => Ok(Self {
                happenings,
                revision: state.revision().to_owned(),
                snapshot: snapshot.to_vec(),
            }),
            Err(error) => Err(CheckpointError::Refused {
                path,
                reason: error.to_string(),
            }),
        }
    }
}

/// What an engine knew, as the engine thread leaves it for the control thread, which makes a checkpoint of it.
#[derive(Debug)]
pub(crate) struct LeftState {
    /// After how many ticks, beats, breaks and freezes.
    pub(crate) happenings: u64,
    pub(crate) state: EngineState,
    pub(crate) plan: Arc<Plan>,
    pub(crate) last: Option<Instant>,
}

impl LeftState {
    /// That of an engine after so many ticks, beats, breaks and freezes.
    pub(crate) fn of(engine: &Engine, happenings: u64) -> Self {
        Self {
            happenings,
            state: engine.state(),
            plan: Arc::clone(engine.plan()),
            last: engine.last(),
        }
    }
}

/// Where it is asked for, and left.
#[derive(Debug, Default)]
pub(crate) struct StateDesk {
    is_asked: AtomicBool,
    left: Mutex<Option<LeftState>>,
}

impl StateDesk {
    /// Asks for what the engine knows now.
    pub(crate) fn ask(&self) {
        self.is_asked.store(true, Ordering::Release);
    }

    /// What was left, once.
    pub(crate) fn take(&self) -> Option<LeftState> {
        self.left.lock().ok()?.take()
    }

    pub(crate) fn is_asked(&self) -> bool {
        self.is_asked.load(Ordering::Acquire)
    }

    /// Leaves what an engine knows, unless somebody is looking at this moment: then it is asked again.
    pub(crate) fn leave(&self, engine: &Engine, happenings: u64) {
        if let Ok(mut left) = self.left.try_lock() {
            *left = Some(LeftState::of(engine, happenings));
            self.is_asked.store(false, Ordering::Release);
        }
    }
}

/// The checkpoints of a folder.
#[derive(Debug, Clone)]
pub struct Checkpoints {
    pub(crate) folder: PathBuf,
    keep: usize,
    needed: Arc<AtomicU64>,
}

impl Checkpoints {
    /// Those of a folder, of which so many are kept.
    #[must_use]
    pub fn new(folder: PathBuf, keep: usize) -> Self {
        Self {
            folder,
            keep: keep.max(1),
            needed: Arc::new(AtomicU64::new(u64::MAX)),
        }
    }

    /// Up to how many ticks, beats, breaks and freezes all is put out: from there on they may be stepped again. The newest one from
    /// before is kept beside the others.
    pub fn need(&self, happenings: u64) {
        self.needed.store(happenings, Ordering::Relaxed);
    }

    /// Saves one, and removes the oldest beyond those that are kept. It has its name once it is on the disk.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn save(&self, checkpoint: &Checkpoint) -> Result<(), CheckpointError> {
        let path = self.folder.join(name(checkpoint.happenings));
        let saved = write_whole(&path, &checkpoint.to_bytes());
        let saved = saved.and_then(|()| sync_folder(&self.folder));
        saved.map_err(|error| CheckpointError::NotWritten { path, error })?;
        let files = self.files()?;
        let needed = self.needed.load(Ordering::Relaxed);
        let needed = files.iter().rposition(|(of, _)| *of <= needed);
        let old = files.len().saturating_sub(self.keep);
        for (nth, (_, path)) in files.iter().enumerate().take(old) {
            if Some(nth) != needed {
                let _ = fs::remove_file(path);
            }
        }
        Ok(())
    }

    /// Removes all but those taken after so many ticks, beats, breaks and freezes. One that stays does no harm.
    pub fn retain(&self, happenings: impl RangeBounds<u64>) {
        let files = self.files().unwrap_or_default();
        for (_, path) in files.iter().filter(|(of, _)| !happenings.contains(of)) {
            let _ = fs::remove_file(path);
        }
    }

    /// All that can be used, newest first, and why others cannot.
    ///
    /// # Errors
    /// When the folder cannot be read.
    pub fn read(
        &self,
    ) -> Result<impl Iterator<Item = Result<Checkpoint, CheckpointError>>, CheckpointError> {
        let files = self.files()?;
        let newest_first = files.into_iter().rev();
        Ok(newest_first.map(|(_, path)| Checkpoint::read(&path)))
    }

    /// Those taken after so many ticks, beats, breaks and freezes or more that can be used, oldest first, each read when it is its
    /// turn.
    pub(crate) fn since(&self, happenings: u64) -> impl Iterator<Item = Checkpoint> + use<> {
        let files = self.files().unwrap_or_default().into_iter();
        let files = files.skip_while(move |(of, _)| *of < happenings);
        files.filter_map(|(_, path)| Checkpoint::read(&path).ok())
    }

    /// After how many ticks, beats, breaks and freezes the oldest one was taken that a start may need: the journal is needed from there.
    ///
    /// # Errors
    /// When the folder cannot be read.
    pub fn oldest(&self) -> Result<Option<u64>, CheckpointError> {
        let files = self.files()?;
        let oldest = files.iter().nth_back(self.keep - 1).or(files.first());
        Ok(oldest.map(|(happenings, _)| *happenings))
    }

    fn files(&self) -> Result<Vec<(u64, PathBuf)>, CheckpointError> {
        let unreadable = |error| CheckpointError::Unreadable {
            path: self.folder.clone(),
            error,
        };
        let mut files = Vec::new();
        let entries = match fs::read_dir(&self.folder) {
            // One that could not be made yet.
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(files),
            entries => entries.map_err(unreadable)?,
        };
        for entry in entries {
            let entry = entry.map_err(unreadable)?;
            let happenings = entry.file_name().to_str().and_then(|name| {
                let digits = name.strip_prefix("checkpoint-")?.strip_suffix(".state")?;
                digits.parse().ok().filter(|_| digits.len() == 20)
            });
            files.extend(happenings.map(|happenings| (happenings, entry.path())));
        }
        files.sort_unstable();
        Ok(files)
    }
}

fn name(happenings: u64) -> String {
    format!("checkpoint-{happenings:020}.state")
}

/// Why a checkpoint cannot be used.
#[derive(Debug)]
pub enum CheckpointError {
    /// It cannot be read.
    Unreadable {
        /// The file or folder.
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
    /// It is not as it was written.
    Damaged {
        /// The file.
        path: PathBuf,
    },
    /// It is of another release.
    OtherRelease {
        /// The file.
        path: PathBuf,
        /// The release.
        release: String,
    },
    /// An engine does not go on from it.
    Refused {
        /// The file, or the folder where the model was looked for.
        path: PathBuf,
        /// Why.
        reason: String,
    },
}

impl fmt::Display for CheckpointError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unreadable { path, error } => {
                write!(f, "cannot read {}: {error}", path.display())
            }
            Self::NotWritten { path, error } => {
                write!(f, "cannot write {}: {error}", path.display())
            }
            Self::Damaged { path } => write!(f, "{} is damaged", path.display()),
            Self::OtherRelease { path, release } => write!(
                f,
                "{} is of release {release}, this is {}",
                path.display(),
                env!("CARGO_PKG_VERSION")
            ),
            Self::Refused { path, reason } => write!(f, "{}: {reason}", path.display()),
        }
    }
}

impl std::error::Error for CheckpointError {}
