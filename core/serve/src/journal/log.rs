//! All files of a journal, read in order.

use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};

use super::segment::{Segment, first_event};
use super::{Begin, Damage, JournalError, Record};

/// A journal that is read.
#[derive(Debug)]
pub struct Log {
    /// The first record of each file, and its path.
    files: Vec<(u64, PathBuf)>,
    /// The next file to be opened.
    next: usize,
    segment: Option<Segment>,
    torn: Option<Torn>,
    gaps: Vec<Gap>,
}

/// What a log gives.
#[derive(Debug, Clone, PartialEq)]
pub enum Entry {
    /// A file begins.
    Begin(Box<Begin>),
    /// A record, and its number.
    Record(u64, Record),
}

/// A damaged end, behind which nothing had been synced.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Torn {
    /// Where, and how.
    pub damage: Damage,
    /// How many bytes are left out.
    pub bytes: u64,
}

/// Records that were never written, because the disk did not take them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Gap {
    /// The number of the first.
    pub from: u64,
    /// How many.
    pub records: u64,
}

impl fmt::Display for Torn {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { damage, bytes } = self;
        write!(
            f,
            "{damage}; its last {bytes} bytes are left out, which had not been synced"
        )
    }
}

impl fmt::Display for Gap {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { from, records } = self;
        let to = from + records.saturating_sub(1);
        write!(
            f,
            "the journal lacks the records {from} to {to}, which could not be written"
        )
    }
}

impl Log {
    /// Opens a folder, at its first file. A folder that is not there has none.
    ///
    /// # Errors
    /// When the folder cannot be read.
    pub fn open(folder: &Path) -> Result<Self, JournalError> {
        Ok(Self {
            files: files(folder)?,
            next: 0,
            segment: None,
            torn: None,
            gaps: Vec::new(),
        })
    }

    /// Opens a folder at the last file that begins with no more than so many ticks, beats, breaks and freezes before; at the first
    /// where there is none.
    ///
    /// # Errors
    /// When the folder or a file cannot be read.
    pub fn open_at(folder: &Path, happenings: u64) -> Result<Self, JournalError> {
        let mut log = Self::open(folder)?;
        for (nth, (_, path)) in log.files.iter().enumerate().rev() {
            if nth == 0 || Segment::open(path)?.begin.happenings <= happenings {
                log.next = nth;
                break;
            }
        }
        Ok(log)
    }

    /// Whether there is no file.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.files.is_empty()
    }

    /// The next entry; none at the end.
    ///
    /// # Errors
    /// When a file cannot be read, is damaged, or one between two others is missing.
    pub fn read(&mut self) -> Result<Option<Entry>, JournalError> {
        let Some(segment) = &mut self.segment else {
            return self.open_next();
        };
        let is_last = self.next == self.files.len();
        match segment.next() {
            Ok(Some(record)) => Ok(Some(Entry::Record(segment.event() - 1, record))),
            Ok(None) if is_last => Ok(None),
            Ok(None) => self.open_next(),
            // A file that could not be written to its end is followed by one that knows it.
            Err(_) if !is_last && Segment::open(&self.files[self.next].1)?.begin.after_failure => {
                self.open_next()
            }
            Err(damage) if !is_last || segment.was_synced_beyond() => {
                Err(JournalError::Damaged(damage))
            }
            Err(damage) => {
                let length = fs::metadata(segment.path()).map_or(0, |of| of.len());
                let bytes = length.saturating_sub(damage.offset);
                self.torn.get_or_insert(Torn { damage, bytes });
                Ok(None)
            }
        }
    }

    /// The damaged end, once it has been reached.
    #[must_use]
    pub fn torn(&self) -> Option<&Torn> {
        self.torn.as_ref()
    }

    /// What was never written, so far.
    #[must_use]
    pub fn gaps(&self) -> &[Gap] {
        &self.gaps
    }

    /// The number of the next record.
    #[must_use]
    pub fn event(&self) -> u64 {
        self.segment.as_ref().map_or(0, Segment::event)
    }

    /// Cuts the last file to what has been read of it, so that another can follow. For whoever holds the folder, at the end.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn seal(&self) -> Result<(), JournalError> {
        let Some(segment) = &self.segment else {
            return Ok(());
        };
        let cut = || {
            let file = fs::File::options().write(true).open(segment.path())?;
            if file.metadata()?.len() != segment.at() {
                file.set_len(segment.at())?;
                file.sync_all()?;
            }
            Ok(())
        };
        cut().map_err(|error| JournalError::NotWritten {
            path: segment.path().to_owned(),
            error,
        })
    }

    fn open_next(&mut self) -> Result<Option<Entry>, JournalError> {
        let Some((_, path)) = self.files.get(self.next) else {
            return Ok(None);
        };
        let segment = Segment::open(path)?;
        let begin = &segment.begin;
        if let Some(before) = &self.segment {
            let (from, to) = (before.event(), begin.event);
            if to != from && !(begin.after_failure && to > from) {
                let path = path.clone();
                return Err(JournalError::Missing { path, from, to });
            }
            if to > from {
                let records = to - from;
                self.gaps.push(Gap { from, records });
            }
        }
        let entry = Entry::Begin(Box::new(begin.clone()));
        self.segment = Some(segment);
        self.next += 1;
        Ok(Some(entry))
    }
}

/// The files of a folder, by their first records.
pub(super) fn files(folder: &Path) -> Result<Vec<(u64, PathBuf)>, JournalError> {
    let unreadable = |error| JournalError::Unreadable {
        path: folder.to_owned(),
        error,
    };
    let entries = match fs::read_dir(folder) {
        Ok(entries) => entries,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
        Err(error) => return Err(unreadable(error)),
    };
    let mut files = Vec::new();
    for entry in entries {
        let entry = entry.map_err(unreadable)?;
        if let Some(event) = entry.file_name().to_str().and_then(first_event) {
            files.push((event, entry.path()));
        }
    }
    files.sort_unstable();
    Ok(files)
}
