//! How much of a journal is kept.

use std::fs;
use std::path::Path;
use std::time::{Duration, SystemTime};

use super::JournalError;
use super::log::files;
use super::segment::Segment;

/// How much of a journal is kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Keep {
    /// How old a file may become.
    pub age: Duration,
    /// How many bytes all files may have.
    pub at_most: u64,
}

/// Removes the oldest files beyond what is kept, and returns how many. None goes that is needed to go on after so many ticks, beats,
/// breaks and freezes, nor the last one.
///
/// # Errors
/// When the folder or a file cannot be read, or a file cannot be removed.
pub fn retire(folder: &Path, keep: Keep, needed: u64) -> Result<usize, JournalError> {
    let files = files(folder)?;
    let facts = |path: &Path| {
        let facts = fs::metadata(path);
        facts.map_err(|error| JournalError::Unreadable {
            path: path.to_owned(),
            error,
        })
    };
    let mut size = 0;
    for (_, path) in &files {
        size += facts(path)?.len();
    }
    let now = SystemTime::now();
    for (nth, pair) in files.windows(2).enumerate() {
        let [(_, path), (_, next)] = pair else { break };
        let of = facts(path)?;
        let age = of
            .modified()
            .ok()
            .and_then(|of| now.duration_since(of).ok());
        let is_too_old = age.is_some_and(|age| age > keep.age);
        if !is_too_old && size <= keep.at_most || Segment::open(next)?.begin.happenings > needed {
            return Ok(nth);
        }
        fs::remove_file(path).map_err(|error| JournalError::NotWritten {
            path: path.clone(),
            error,
        })?;
        size -= of.len();
    }
    Ok(files.len().saturating_sub(1))
}

/// How many ticks, beats, breaks and freezes there were before the journal of a folder begins; none where there is no journal.
///
/// # Errors
/// When its first file cannot be read.
pub fn oldest(folder: &Path) -> Result<Option<u64>, JournalError> {
    let first = files(folder)?.into_iter().next();
    let begin = |(_, path): (_, std::path::PathBuf)| Ok(Segment::open(&path)?.begin.happenings);
    first.map(begin).transpose()
}
