//! Why a journal cannot be read or written.

use std::path::PathBuf;
use std::{fmt, io};

/// Why a journal cannot be read or written.
#[derive(Debug)]
pub enum JournalError {
    /// A file or the folder cannot be read.
    Unreadable {
        /// Which.
        path: PathBuf,
        /// Why.
        error: io::Error,
    },
    /// A file or the folder cannot be written.
    NotWritten {
        /// Which.
        path: PathBuf,
        /// Why.
        error: io::Error,
    },
    /// A file is not as it was written.
    Damaged(Damage),
    /// Records are missing between two files.
    Missing {
        /// The file before which they are missing.
        path: PathBuf,
        /// The number of the first.
        from: u64,
        /// That of the first which is there again.
        to: u64,
    },
    /// A file of a later release.
    Later {
        /// The file.
        path: PathBuf,
        /// Its format.
        version: u32,
    },
}

/// Where a file is not as it was written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Damage {
    /// The file.
    pub path: PathBuf,
    /// The byte at which the record begins.
    pub offset: u64,
    /// The number of the record.
    pub event: u64,
    /// What is wrong.
    pub kind: DamageKind,
}

/// What is wrong with a record.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DamageKind {
    /// The header of the file.
    Header,
    /// Its length goes beyond the file.
    Length,
    /// Its checksum differs.
    Checksum,
    /// No record is like this.
    Content,
}

impl fmt::Display for DamageKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Header => "its header is not one of a journal",
            Self::Length => "a record goes beyond its end",
            Self::Checksum => "a checksum differs",
            Self::Content => "no record is like this",
        })
    }
}

impl fmt::Display for Damage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            path,
            offset,
            event,
            kind,
        } = self;
        let path = path.display();
        write!(
            f,
            "{path} is damaged at byte {offset}, record {event}: {kind}"
        )
    }
}

impl fmt::Display for JournalError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unreadable { path, error } => {
                write!(f, "cannot read {}: {error}", path.display())
            }
            Self::NotWritten { path, error } => {
                write!(f, "cannot write {}: {error}", path.display())
            }
            Self::Damaged(damage) => write!(
                f,
                "{damage}; restore the file from a copy, or move it and all later ones away to go on from what is before"
            ),
            Self::Missing { path, from, to } => write!(
                f,
                "the journal lacks the records {from} to {} before {}; restore the files that hold them, \
                 or move {} and all later ones away",
                to - 1,
                path.display(),
                path.display()
            ),
            Self::Later { path, version } => write!(
                f,
                "{} has format {version}, which is of a later release; this one reads up to {}",
                path.display(),
                super::segment::VERSION
            ),
        }
    }
}

impl std::error::Error for JournalError {}
