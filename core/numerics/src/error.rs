//! What can be wrong with a request to this library. Does not decide how a caller words it for its own users.

use std::fmt;
use std::ops::Range;

/// Why statistics could not be combined or solved.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum NumericsError {
    /// Two things that must have the same number of regressors do not.
    Width {
        /// The width that was needed.
        expected: usize,
        /// The width that was given.
        found: usize,
    },
    /// What was stored has more or fewer numbers than the rest of it asks for.
    Length {
        /// The name of what was stored.
        name: &'static str,
        /// How many numbers are needed.
        expected: usize,
        /// How many there are.
        found: usize,
    },
    /// A column index is not below the number of regressors.
    Column {
        /// The index that was asked for.
        column: usize,
        /// The number of regressors.
        width: usize,
    },
    /// A column was asked for more than once.
    RepeatedColumn {
        /// The index that stands there twice.
        column: usize,
    },
    /// There are too few rows for what was asked.
    TooFewRows {
        /// How many rows are needed at least.
        needed: u64,
        /// How many there are.
        found: u64,
    },
    /// Too few stretches of rows without a gap, each so long that it has a past and a future, and the next row those too.
    TooFewStretches {
        /// How many rows a stretch has.
        length: usize,
        /// How many stretches are needed at least; they may overlap.
        needed: usize,
        /// How many there are.
        found: usize,
    },
    /// What was before tells nothing of the outputs beside what the inputs meanwhile do.
    NoStates,
    /// The statistics contain NaN or infinities.
    NotFinite,
    /// A column's scale is not a positive finite number.
    Scale {
        /// The column.
        column: usize,
        /// Its scale.
        scale: f64,
    },
    /// A parameter is out of its range.
    Parameter {
        /// The name of the parameter.
        name: &'static str,
        /// What was given.
        value: f64,
        /// What is allowed.
        allowed: &'static str,
    },
    /// Cross-validation needs at least two folds and a row in each.
    Folds {
        /// How many folds were asked for.
        folds: usize,
        /// How many rows there are.
        rows: u64,
    },
    /// A fold of which one row is all that is tested.
    FoldOfOneRow {
        /// How many folds were asked for.
        folds: usize,
        /// How many rows there are.
        rows: u64,
    },
    /// Enough rows for the folds, but they come in blocks that cannot be cut.
    FoldsOfBlocks {
        /// How many folds were asked for.
        folds: usize,
        /// How many rows there are.
        rows: u64,
        /// How many rows a block has.
        block: u64,
    },
    /// The same where blocks are stretches.
    FoldsOfStretches {
        /// How many folds were asked for.
        folds: usize,
        /// How many stretches have rows.
        stretches: usize,
    },
    /// What is left out beside a test leaves nothing to train on.
    FoldsApart {
        /// The rows that would be tested.
        test: Range<u64>,
        /// How many rows there are.
        rows: u64,
        /// The rows left out on either side.
        gap: u64,
        /// The rows left out after the test and its gap.
        embargo: u64,
    },
    /// A factorisation did not converge.
    NoConvergence,
}

impl fmt::Display for NumericsError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Width { expected, found } => {
                write!(f, "{found} regressors where {expected} are needed")
            }
            Self::Length {
                name,
                expected,
                found,
            } => write!(
                f,
                "the length of {name} is {found} where {expected} is needed"
            ),
            Self::Column { column, width } => {
                write!(f, "column {column} of {width} columns does not exist")
            }
            Self::RepeatedColumn { column } => write!(f, "column {column} is listed twice"),
            Self::TooFewRows { needed, found } => {
                write!(f, "{found} rows where at least {needed} are needed")
            }
            Self::TooFewStretches {
                length,
                needed,
                found,
            } => write!(
                f,
                "{found} stretches of {length} rows without a gap, and at least {needed} are needed"
            ),
            Self::NoStates => write!(
                f,
                "the past tells nothing of the outputs beside what the inputs meanwhile do"
            ),
            Self::NotFinite => write!(f, "the rows contain NaN or infinite values"),
            Self::Scale { column, scale } => write!(
                f,
                "the scale of column {column} is {scale}; it must be positive and finite"
            ),
            Self::Parameter {
                name,
                value,
                allowed,
            } => write!(f, "{name} is {value}; it must be {allowed}"),
            Self::Folds { folds, rows } => write!(
                f,
                "{rows} rows cannot be cut into {folds} folds; at least two folds and one row in each are needed"
            ),
            Self::FoldOfOneRow { folds, rows } => {
                write!(
                    f,
                    "in {folds} folds of {rows} rows some have one row, which has no R²; "
                )?;
                match rows / 3 {
                    0 | 1 => write!(f, "more rows are needed"),
                    most => write!(f, "take at most {most} folds"),
                }
            }
            Self::FoldsOfBlocks { folds, rows, block } => write!(
                f,
                "{rows} rows cannot be cut into {folds} folds, since they did not fit in memory and are summed in blocks of {block} rows"
            ),
            Self::FoldsOfStretches { folds, stretches } => write!(
                f,
                "{stretches} blocks cannot be cut into {folds} folds of whole blocks that leave some to train on; fit on shorter blocks, \
                 without them, on fewer folds, or on more data"
            ),
            Self::FoldsApart {
                test,
                rows,
                gap,
                embargo,
            } => {
                let (first, last) = (test.start + 1, test.end);
                write!(
                    f,
                    "of {rows} rows none is left to train on where rows {first} to {last} are tested, with a gap of {gap} rows"
                )?;
                if *embargo > 0 {
                    write!(f, " and an embargo of {embargo}")?;
                }
                Ok(())
            }
            Self::NoConvergence => write!(f, "the factorisation did not converge"),
        }
    }
}

impl std::error::Error for NumericsError {}
