//! What can be wrong in a schedule file, and how that is worded.

use std::fmt;

use crate::machine::LONGEST_DAYS;

/// A mistake in a schedule file.
#[derive(Debug, Clone, PartialEq)]
pub struct ScheduleError {
    /// Its line, from 1.
    pub line: usize,
    /// What is wrong there.
    pub reason: Reason,
}

/// What can be wrong in a schedule file.
#[derive(Debug, Clone, PartialEq)]
pub enum Reason {
    /// There is no line of names.
    Empty,
    /// The first column is not a time.
    TimeColumn {
        /// Its name.
        found: String,
    },
    /// A column is not a set point of the machine.
    UnknownColumn {
        /// Its name.
        found: String,
        /// The columns that there can be.
        known: Vec<String>,
    },
    /// A column stands twice.
    RepeatedColumn {
        /// Its name.
        found: String,
    },
    /// No set point is set.
    NoSetPoint,
    /// There is no row of values.
    NoRow,
    /// A row has too few or too many cells.
    Cells {
        /// How many it has.
        found: usize,
        /// How many names there are.
        expected: usize,
    },
    /// A cell is not a finite number.
    Number {
        /// Its column.
        column: String,
        /// What stands there.
        found: String,
    },
    /// The first row is not at time 0.
    Start {
        /// Its time, in the unit of the file.
        found: String,
    },
    /// A time is not after the one before, or beyond the longest recording.
    Order {
        /// The time, in the unit of the file.
        found: String,
    },
    /// The first row leaves a set point open.
    Open {
        /// Its column.
        column: String,
    },
    /// A set point is outside what the machine takes.
    Range {
        /// Its column.
        column: String,
        /// What is asked for.
        found: f64,
        /// Lowest and highest value.
        range: [f64; 2],
    },
    /// The first row says `repeat`.
    NothingToRepeat,
    /// A row follows the one that says `repeat`.
    AfterRepeat,
}

impl fmt::Display for ScheduleError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "line {}: {}", self.line, self.reason)
    }
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Empty => f.write_str("no line of names, such as `time_h,chuck_degC`"),
            Self::TimeColumn { found } => write!(
                f,
                "the first column is `{found}`; it must be `time_s`, `time_min` or `time_h`"
            ),
            Self::UnknownColumn { found, known } => write!(
                f,
                "no set point has the column `{found}`; there are {}",
                known.join(", ")
            ),
            Self::RepeatedColumn { found } => write!(f, "the column `{found}` stands twice"),
            Self::NoSetPoint => f.write_str("no column sets anything"),
            Self::NoRow => f.write_str("no row of values follows the names"),
            Self::Cells { found, expected } => {
                write!(f, "{found} cells where {expected} are named")
            }
            Self::Number { column, found } => {
                write!(f, "`{found}` in `{column}` is not a finite number")
            }
            Self::Start { found } => write!(f, "the first row is at {found}; it must be at 0"),
            Self::Order { found } => write!(
                f,
                "the time {found} must be after that of the row before, and within {LONGEST_DAYS} days"
            ),
            Self::Open { column } => write!(f, "the first row must set `{column}`"),
            Self::Range {
                column,
                found,
                range: [low, high],
            } => write!(f, "{found} in `{column}` is outside {low} to {high}"),
            Self::NothingToRepeat => f.write_str("`repeat` needs a row of values before it"),
            Self::AfterRepeat => f.write_str("nothing may follow the row that says `repeat`"),
        }
    }
}

impl std::error::Error for ScheduleError {}
