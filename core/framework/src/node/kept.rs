//! What a node keeps of the past, and how many bytes that takes.

use serde::Serialize;

use crate::time::Duration;

/// A stretch of the past that is kept in memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Kept {
    /// How long it is.
    pub back: Duration,
    /// As many rows lie in it.
    pub rows: u64,
    /// What it takes, beside what others of the node have already.
    pub bytes: u64,
}

impl Kept {
    /// So much of the past, of which a row that comes each `every` takes so many bytes, where room is made by doubling; nothing where none is
    /// kept.
    #[must_use]
    pub fn past(back: Duration, every: Duration, bytes_of_row: usize) -> Vec<Self> {
        let rows = Self::rows(back, every);
        let bytes = rows.next_power_of_two() * bytes_of_row as u64;
        let kept = (back > Duration::ZERO).then_some(Self { back, rows, bytes });
        kept.into_iter().collect()
    }

    /// The same where room is made by parts, so that little more is held than is full.
    #[must_use]
    pub fn in_parts(back: Duration, every: Duration, bytes_of_row: usize) -> Vec<Self> {
        let rows = Self::rows(back, every);
        let bytes = (rows + rows / 32 + 2) * bytes_of_row as u64;
        vec![Self { back, rows, bytes }]
    }

    /// How many rows that come each `every` lie in a window of this length, both ends included.
    #[must_use]
    pub fn rows(back: Duration, every: Duration) -> u64 {
        (back.as_ns().max(0) / every.as_ns().max(1)).cast_unsigned() + 1
    }
}
