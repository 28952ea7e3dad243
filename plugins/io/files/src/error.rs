//! What can be wrong with a file. Not which of these a lenient reader forgives.

use std::fmt;
use std::io;
use std::path::Path;
use std::sync::Arc;

use athermal_core::failure::Failure;

use crate::cell;
use crate::detect::LongFormat;
use crate::machines::MachineFault;
use crate::merge::MergeError;

mod message;

/// Longest piece of a file that a message repeats, in characters.
const EXCERPT: usize = 60;

/// A line of a file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Place {
    /// The name of the file as it was given, or `standard input`.
    pub file: Arc<str>,
    /// The line, or the row of what is no text, counted from 1; the first of a row that spans several. 0 is the file as a whole.
    pub line: u64,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.line {
            0 => f.write_str(&self.file),
            line => write!(f, "{}:{line}", self.file),
        }
    }
}

/// A column that is needed and not there.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MissingColumn {
    /// Its name.
    pub name: String,
    /// The most similar of the names that are there, if one is similar.
    pub nearest: Option<String>,
}

/// Why a row is not put together with the one before, whose time it has.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Again {
    /// Rows are taken as they come, and the one before has been given.
    Live,
    /// It has nothing that the one before has not.
    Nothing,
    /// Both have a value of this column, and not the same.
    Other(String),
}

/// What is wrong with a cell.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum CellFault {
    /// A value that is neither a number nor "no value".
    NoNumber,
    /// A number with another decimal mark than others.
    OtherMark {
        /// Their mark: `,` or `.`.
        mark: char,
        /// The line of the first of them; none where `[table]` declares the mark.
        since: Option<u64>,
    },
    /// A time beyond 64 bits of nanoseconds.
    TimeBeyond,
    /// A time that is not in the stated form.
    NoTime {
        /// What the cell should look like.
        expected: String,
    },
    /// An instant in a cell beside the time of the row, of which this is wrong.
    NoInstant(Box<Self>),
    /// A time that no clock of the stated zone has shown, since it was set forward over it.
    TimeSkipped {
        /// The zone, as it is stated.
        zone: String,
        /// How far the clock was from UTC before, in s, positive to the east.
        offset_s: i32,
    },
}

impl CellFault {
    /// Whether it is one of a value, or of a number, and not of the time of a row alone.
    #[must_use]
    pub fn is_of_value(&self) -> bool {
        matches!(
            self,
            Self::NoNumber | Self::OtherMark { .. } | Self::NoInstant(_)
        )
    }
}

/// What went wrong while a recording was read or written.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub enum FileError {
    /// The file could not be opened or created.
    Open {
        /// The name of the file.
        file: Arc<str>,
        /// What the system said.
        source: Arc<io::Error>,
    },
    /// Reading stopped in the middle of a file.
    Read {
        /// The line that was being read.
        place: Place,
        /// What the system said.
        source: Arc<io::Error>,
    },
    /// Writing failed.
    Write {
        /// The name of the file.
        file: Arc<str>,
        /// What the system said.
        source: Arc<io::Error>,
    },
    /// Standard input is one of several files to be joined.
    StandardInputInList,
    /// Several files are not one recording.
    Merge(Box<MergeError>),
    /// There is nothing in the file but blank lines and comments.
    Empty {
        /// The name of the file.
        file: Arc<str>,
    },
    /// The file is not text, or text of two bytes per character without the mark that says so.
    NotText {
        /// The header.
        place: Place,
    },
    /// A line, or a quoted cell, goes on beyond what a row of a recording can be.
    TooLong {
        /// Where it starts.
        place: Place,
        /// The longest row that is read, in bytes.
        limit: usize,
    },
    /// A quoted cell that does not end, in its line or soon after.
    UnclosedQuote {
        /// The row in which the cell starts.
        place: Place,
    },
    /// Two columns have one name.
    DuplicateColumn {
        /// The header, or the object.
        place: Place,
        /// The name.
        column: String,
        /// Where the columns stand, counted from 1.
        positions: [usize; 2],
    },
    /// Columns that are needed are not there.
    MissingColumns {
        /// The header, or the last line looked at.
        place: Place,
        /// All that are missing; never none.
        missing: Vec<MissingColumn>,
        /// The names that are there.
        found: Vec<String>,
        /// How these were read, where that may be why; to stand behind them.
        note: &'static str,
    },
    /// A cell that is not taken as it stands.
    BadCell {
        /// The row.
        place: Place,
        /// The name of the column.
        column: String,
        /// The text of the cell.
        found: String,
        /// What is wrong with it.
        fault: CellFault,
    },
    /// An instant that is that of the row before.
    TimeAgain {
        /// The row.
        place: Place,
        /// Its time, as the file gives it.
        time: String,
        /// Why the two are not one.
        why: Again,
    },
    /// An instant that is before the one before.
    TimeNotAfter {
        /// The row.
        place: Place,
        /// Its time, as the file gives it.
        time: String,
        /// The newest time before it.
        previous: String,
    },
    /// An instant that is far after the one before, and after the next one too, or the last.
    TimeLeaps {
        /// The row.
        place: Place,
        /// Its time, as the file gives it.
        time: String,
        /// The time before it; none where it is the first.
        previous: Option<String>,
        /// The time after it, if a row follows.
        next: Option<String>,
    },
    /// Rows one after the other that are left out; only reported while the recording is read.
    StillRefused {
        /// What is wrong with the newest of them.
        newest: Box<FileError>,
        /// How many they are.
        rows: u64,
    },
    /// A row within a recording that names its columns again.
    HeaderAgain {
        /// The row.
        place: Place,
        /// Whether wanted columns stand elsewhere than before.
        moved: bool,
        /// Those that must be there and are not; only when reading leniently.
        lacking: Vec<String>,
    },
    /// The file is otherwise than `[table]` declares.
    NotAsDeclared {
        /// The line.
        place: Place,
        /// The key that declares it.
        key: &'static str,
        /// What is found, as a clause.
        found: String,
    },
    /// A row that is of none of the machines that are read.
    Machine {
        /// The row.
        place: Place,
        /// The column that says which it is of.
        column: String,
        /// What is wrong.
        fault: MachineFault,
    },
    /// A row of a long layout whose time is before the one before.
    LongOutOfOrder {
        /// The row.
        place: Place,
        /// Its time, as the file gives it.
        time: String,
        /// The newest time before it.
        previous: String,
    },
    /// The log has a row for each value.
    LongFormat {
        /// The header.
        place: Place,
        /// What its columns are.
        long: LongFormat,
    },
    /// A row with more or fewer cells than the header.
    CellCount {
        /// The row.
        place: Place,
        /// The number of columns in the header.
        expected: usize,
        /// The number of cells in the row.
        found: usize,
    },
    /// A row that ends before its last columns.
    CellsLacking {
        /// The row.
        place: Place,
        /// The number of columns in the header.
        expected: usize,
        /// The number of cells in the row.
        found: usize,
    },
    /// A text behind the last column that has a name.
    CellBeyond {
        /// The row.
        place: Place,
        /// The text.
        found: String,
    },
    /// The file, or one of its columns, is of a kind that cannot be what is wanted of it.
    Unfit {
        /// The name of the file.
        file: Arc<str>,
        /// What it is, and what to do.
        reason: String,
    },
    /// A stretch of time that is asked for cannot be taken.
    Stretch {
        /// Why, and what to do.
        reason: String,
    },
    /// A table whose cells are parted by spaces.
    CellsOfSpaces {
        /// The header.
        place: Place,
    },
    /// A line that is not one JSON object.
    BadObject {
        /// The line.
        place: Place,
        /// What the parser said.
        reason: String,
    },
    /// A JSON array where objects are expected, one a line.
    JsonArray {
        /// The line with which it begins.
        place: Place,
    },
    /// A file that is to be gone on with is not one that was begun with these columns.
    NotBegun {
        /// The name of the file.
        file: Arc<str>,
        /// Why.
        reason: String,
    },
    /// A row to be written has not as many values as there are columns.
    ValueCount {
        /// The name of the file.
        file: Arc<str>,
        /// The number of value columns.
        expected: usize,
        /// The number of values.
        found: usize,
    },
}

impl FileError {
    /// That a file cannot be opened or created.
    pub(crate) fn cannot_open(path: &Path, source: io::Error) -> Self {
        Self::Open {
            file: path.display().to_string().into(),
            source: Arc::new(source),
        }
    }

    /// That a file, or one of its columns, cannot be what is wanted of it.
    pub(crate) fn unfit(path: &Path, reason: String) -> Self {
        let file = path.display().to_string().into();
        Self::Unfit { file, reason }
    }

    /// The line that it is about, where it is about one.
    #[must_use]
    pub fn place(&self) -> Option<&Place> {
        match self {
            Self::Open { .. }
            | Self::Write { .. }
            | Self::StandardInputInList
            | Self::Merge(_)
            | Self::Empty { .. }
            | Self::NotBegun { .. }
            | Self::Unfit { .. }
            | Self::Stretch { .. }
            | Self::ValueCount { .. } => None,
            Self::StillRefused { newest, .. } => newest.place(),
            Self::Read { place, .. }
            | Self::NotText { place }
            | Self::TooLong { place, .. }
            | Self::UnclosedQuote { place }
            | Self::DuplicateColumn { place, .. }
            | Self::MissingColumns { place, .. }
            | Self::BadCell { place, .. }
            | Self::TimeAgain { place, .. }
            | Self::TimeNotAfter { place, .. }
            | Self::TimeLeaps { place, .. }
            | Self::HeaderAgain { place, .. }
            | Self::NotAsDeclared { place, .. }
            | Self::Machine { place, .. }
            | Self::LongOutOfOrder { place, .. }
            | Self::LongFormat { place, .. }
            | Self::CellCount { place, .. }
            | Self::CellsLacking { place, .. }
            | Self::CellBeyond { place, .. }
            | Self::CellsOfSpaces { place }
            | Self::BadObject { place, .. }
            | Self::JsonArray { place } => Some(place),
        }
    }

    /// The column of a cell that cannot be read.
    #[must_use]
    pub fn column(&self) -> Option<&str> {
        match self {
            Self::BadCell { column, fault, .. } if fault.is_of_value() => Some(column),
            _ => None,
        }
    }

    /// Whether only one line cannot be read, and those after it can.
    pub(crate) fn is_of_line(&self) -> bool {
        matches!(self, Self::TooLong { .. } | Self::JsonArray { .. })
    }

    /// Whether whoever read the output went away, as `head` does: a reason to stop, but no failure.
    pub fn is_closed_pipe(&self) -> bool {
        matches!(self, Self::Write { source, .. } if source.kind() == io::ErrorKind::BrokenPipe)
    }
}

impl From<FileError> for Failure {
    fn from(error: FileError) -> Self {
        if error.is_closed_pipe() {
            // Whoever read our output has seen enough.
            return Self::Exit(0);
        }
        match error {
            FileError::Open { .. } | FileError::Read { .. } | FileError::Write { .. } => {
                Self::Outside(error.to_string())
            }
            other => Self::Request(other.to_string()),
        }
    }
}

athermal_core::register_error!(FileError);

impl std::error::Error for FileError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::Open { source, .. } | Self::Read { source, .. } | Self::Write { source, .. } => {
                Some(source.as_ref())
            }
            _ => None,
        }
    }
}

/// Bytes of a file as a message may repeat them.
pub(crate) fn excerpt(bytes: &[u8]) -> String {
    let text = cell::text(bytes);
    let mut short: String = text.chars().take(EXCERPT).collect();
    if text.chars().count() > EXCERPT {
        short.push('…');
    }
    short
}

/// Names as a message lists them.
pub(crate) fn quoted<'a>(names: impl IntoIterator<Item = &'a str>) -> String {
    let names: Vec<_> = names.into_iter().map(|name| format!("`{name}`")).collect();
    names.join(", ")
}

#[cfg(test)]
mod tests;
