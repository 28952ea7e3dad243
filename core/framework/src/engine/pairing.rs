//! Decides which run of a node a truth belongs to; not what is done with the pair.

use crate::compile::TruthLink;
use crate::time::{Duration, Instant};
use serde::{Deserialize, Serialize};

/// The runs that truths may still be paired with.
///
/// A truth at `τ` belongs to the last run at or before `τ − ahead`, and to none where that run lies longer before
/// `τ − ahead` than the truth's span. Fitting, scoring and learning all pair through here.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Pairing {
    ahead: Duration,
    limit: Duration,
    width: usize,
    times: Vec<Instant>,
    rows: Vec<f64>,
    first: usize,
    len: usize,
    /// The number of the first row kept, counted over all runs.
    number: u64,
}

/// A run that a truth has been paired with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Paired<'a> {
    /// When it ran.
    pub at: Instant,
    /// The number of the run, counted from the first.
    pub number: u64,
    /// What was written down of it.
    pub row: &'a [f64],
}

impl Pairing {
    /// Pairs runs, of each of which `width` numbers are written down, with the truths of a link.
    #[must_use]
    pub fn new(link: &TruthLink, width: usize) -> Self {
        Self {
            ahead: link.ahead,
            limit: link.limit,
            width,
            times: vec![Instant::MIN; 4],
            rows: vec![0.0; 4 * width],
            first: 0,
            len: 0,
            number: 0,
        }
    }

    /// Writes a run down. Room is made by doubling until the number of runs within the horizon is known.
    ///
    /// # Panics
    /// When `parts` do not add up to the width.
    pub fn run<'a>(&mut self, now: Instant, parts: impl IntoIterator<Item = &'a [f64]>) {
        self.forget_before(now - self.ahead);
        if self.len == self.times.len() {
            self.grow();
        }
        let index = self.index(self.len);
        self.times[index] = now;
        let mut row = &mut self.rows[index * self.width..(index + 1) * self.width];
        for part in parts {
            let (here, rest) = row.split_at_mut(part.len());
            here.copy_from_slice(part);
            row = rest;
        }
        assert!(row.is_empty(), "the parts of a row fill its width");
        self.len += 1;
    }

    /// The run that a truth at `tau` belongs to. Instants asked for never go back.
    pub fn truth(&mut self, tau: Instant) -> Option<Paired<'_>> {
        let due = tau - self.ahead;
        self.forget_before(due);
        let at = self.times[self.first];
        if self.len == 0 || at > due || due - at > self.limit {
            return None;
        }
        let row = &self.rows[self.first * self.width..(self.first + 1) * self.width];
        Some(Paired {
            at,
            number: self.number,
            row,
        })
    }

    /// The run that the last truth was paired with.
    pub(crate) fn last(&self) -> &[f64] {
        &self.rows[self.first * self.width..(self.first + 1) * self.width]
    }

    /// The number of the run that the last truth was paired with.
    pub(crate) fn last_number(&self) -> u64 {
        self.number
    }

    /// Whether truths are paired as in another, and as much is written down.
    pub(crate) fn pairs_like(&self, other: &Self) -> bool {
        (self.ahead, self.limit, self.width) == (other.ahead, other.limit, other.width)
    }

    /// Forgets all runs: the next one belongs to another segment.
    pub fn clear(&mut self) {
        self.number += self.len as u64;
        self.len = 0;
    }

    /// Forgets the runs before the last one at or before `due`.
    #[inline]
    fn forget_before(&mut self, due: Instant) {
        while self.len >= 2 {
            let second = self.index(1);
            if self.times[second] > due {
                break;
            }
            self.first = second;
            self.len -= 1;
            self.number += 1;
        }
    }

    fn index(&self, nth: usize) -> usize {
        (self.first + nth) & (self.times.len() - 1)
    }

    fn grow(&mut self) {
        let capacity = self.times.len();
        self.times.rotate_left(self.first);
        self.rows.rotate_left(self.first * self.width);
        self.first = 0;
        self.times.resize(2 * capacity, Instant::MIN);
        self.rows.resize(2 * capacity * self.width, 0.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn s(seconds: i64) -> Instant {
        Instant::from_ns(seconds * 1_000_000_000)
    }

    fn d(seconds: i64) -> Duration {
        Duration::from_ns(seconds * 1_000_000_000)
    }

    fn link(ahead: i64, limit: i64) -> TruthLink {
        TruthLink {
            slot: 0,
            ahead: d(ahead),
            span: d(limit),
            limit: d(limit),
        }
    }

    #[test]
    fn a_truth_belongs_to_the_last_run_at_or_before_its_horizon() {
        let mut pairing = Pairing::new(&link(300, 300), 1);
        for t in (0..=1000).step_by(10) {
            pairing.run(s(t), [&[t as f64][..]]);
        }
        assert_eq!(pairing.truth(s(1005)).map(|p| p.row[0]), Some(700.0));
        assert_eq!(pairing.truth(s(1010)).map(|p| p.row[0]), Some(710.0));
    }

    #[test]
    fn without_a_horizon_the_run_of_the_same_tick_counts() {
        let mut pairing = Pairing::new(&link(0, 300), 1);
        pairing.run(s(10), [&[1.0][..]]);
        pairing.run(s(20), [&[2.0][..]]);
        assert_eq!(pairing.truth(s(20)).map(|p| p.row[0]), Some(2.0));
    }

    #[test]
    fn a_run_too_long_ago_is_no_pair() {
        let mut pairing = Pairing::new(&link(0, 300), 1);
        pairing.run(s(0), [&[1.0][..]]);
        assert!(pairing.truth(s(300)).is_some());
        assert!(pairing.truth(s(301)).is_none());
    }

    #[test]
    fn before_the_horizon_has_passed_there_is_no_pair() {
        let mut pairing = Pairing::new(&link(300, 300), 2);
        assert!(pairing.truth(s(0)).is_none());
        pairing.run(s(0), [&[1.0][..], &[2.0][..]]);
        assert!(pairing.truth(s(299)).is_none());
        assert_eq!(
            pairing.truth(s(300)).map(|p| p.row.to_vec()),
            Some(vec![1.0, 2.0])
        );
    }

    #[test]
    fn only_the_runs_within_the_horizon_are_kept() {
        let mut pairing = Pairing::new(&link(300, 300), 1);
        for t in 0..100_000 {
            pairing.run(s(t), [&[t as f64][..]]);
        }
        assert!(pairing.times.len() <= 512, "{}", pairing.times.len());
        assert_eq!(pairing.truth(s(100_100)).map(|p| p.number), Some(99_800));
    }
}
