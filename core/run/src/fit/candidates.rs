//! Decides which candidates a fit keeps: a sensor that is mostly dead costs its own column, not everybody's rows, and one that
//! never moved is not missed by a prediction.

use crate::channel::is_cold;

/// The share of rows, those with a cold window not counted, in which a candidate must have a value.
const NEEDED: f64 = 0.9;

/// In how many rows each candidate had a value.
#[derive(Debug, Clone, Default)]
pub(super) struct Validity {
    rows: u64,
    present: Vec<u64>,
    cold: Vec<u64>,
}

impl Validity {
    pub(super) fn new(candidates: usize) -> Self {
        Self {
            rows: 0,
            present: vec![0; candidates],
            cold: vec![0; candidates],
        }
    }

    /// Counts one row, given in parts.
    pub(super) fn count<'a>(&mut self, parts: impl IntoIterator<Item = &'a [f64]>) {
        self.rows += 1;
        for (i, value) in parts.into_iter().flatten().enumerate() {
            self.present[i] += u64::from(!value.is_nan());
            self.cold[i] += u64::from(is_cold(*value));
        }
    }

    /// Counts so many rows, each of which has these values.
    pub(super) fn count_alike(&mut self, row: impl Iterator<Item = f64>, rows: u64) {
        self.rows += rows;
        for (i, value) in row.enumerate() {
            self.present[i] += rows * u64::from(!value.is_nan());
            self.cold[i] += rows * u64::from(is_cold(value));
        }
    }

    /// Whether there was no row to judge candidates by.
    pub(super) fn knows_nothing(&self) -> bool {
        self.rows == 0
    }

    /// The share of rows in which a candidate had a value, those with a cold window not counted.
    pub(super) fn share(&self, candidate: usize) -> f64 {
        let warm = self.rows - self.cold[candidate];
        if warm == 0 {
            0.0
        } else {
            self.present[candidate] as f64 / warm as f64
        }
    }

    /// The candidates that are kept: all of them where no row speaks against any.
    pub(super) fn kept(&self) -> Vec<usize> {
        (0..self.present.len())
            .filter(|&candidate| self.knows_nothing() || self.share(candidate) >= NEEDED)
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::channel::{ABSENT, COLD};

    #[test]
    fn a_dead_candidate_is_dropped_and_a_cold_one_is_not() {
        let mut validity = Validity::new(3);
        for i in 0..100 {
            let late = if i < 50 { COLD } else { 1.0 };
            validity.count([&[1.0, late][..], &[if i < 20 { ABSENT } else { 1.0 }][..]]);
        }
        assert_eq!(validity.kept(), [0, 1]);
        assert!((validity.share(2) - 0.8).abs() < 1e-12);
    }

    #[test]
    fn without_a_row_no_candidate_is_dropped() {
        assert_eq!(Validity::new(2).kept(), [0, 1]);
    }

    #[test]
    fn a_candidate_that_never_warms_up_is_dropped() {
        let mut validity = Validity::new(1);
        validity.count([&[COLD][..]]);
        assert!(validity.kept().is_empty());
    }
}
