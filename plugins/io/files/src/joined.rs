//! Whether rows of one time are one, and the row that was read to find out. The reader puts them together.

use crate::{FileError, Row};

/// What became of a row that was put together with one of its time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Joined {
    /// It had values where the other had none.
    More,
    /// It had nothing that the other had not.
    Nothing,
    /// Both have a value of this channel, and not the same; nothing was taken.
    Contradicts(usize),
}

/// Takes the values of a row where the other has none, unless the two contradict each other.
pub(crate) fn join(row: &mut [f64], other: &[f64]) -> Joined {
    let pairs = || row.iter().zip(other).enumerate();
    let differ = |(of, other): (&f64, &f64)| !of.is_nan() && !other.is_nan() && of != other;
    if let Some((channel, _)) = pairs().find(|(_, pair)| differ(*pair)) {
        return Joined::Contradicts(channel);
    }
    let mut joined = Joined::Nothing;
    for (of, &other) in row.iter_mut().zip(other) {
        if of.is_nan() && !other.is_nan() {
            *of = other;
            joined = Joined::More;
        }
    }
    joined
}

/// What was read to find out whether it belongs to the row before.
#[derive(Default)]
pub(crate) struct Lookahead {
    /// The row, if it is one.
    pub row: Row,
    /// What came of reading it; nothing where it was given.
    pub read: Option<Result<bool, FileError>>,
}

impl Lookahead {
    /// Gives what was read, if anything was; the end stays the end.
    pub fn give(&mut self, row: &mut Row) -> Option<Result<bool, FileError>> {
        let read = self.read.take()?;
        match read {
            Ok(true) => std::mem::swap(row, &mut self.row),
            Ok(false) => self.read = Some(Ok(false)),
            Err(_) => {}
        }
        Some(read)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NONE: f64 = f64::NAN;

    #[test]
    fn values_are_put_together_where_no_two_contradict_each_other() {
        for (row, other, joined, values) in [
            ([1.0, NONE], [NONE, 2.0], Joined::More, [1.0, 2.0]),
            ([1.0, NONE], [1.0, 2.0], Joined::More, [1.0, 2.0]),
            ([1.0, 2.0], [1.0, NONE], Joined::Nothing, [1.0, 2.0]),
            ([1.0, NONE], [NONE, NONE], Joined::Nothing, [1.0, NONE]),
            ([1.0, NONE], [1.5, 2.0], Joined::Contradicts(0), [1.0, NONE]),
        ] {
            let mut of = row;
            assert_eq!(join(&mut of, &other), joined, "{row:?} {other:?}");
            assert_eq!(of.map(f64::to_bits), values.map(f64::to_bits));
        }
    }
}
