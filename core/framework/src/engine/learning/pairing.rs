//! Which run of a node a truth belongs to.

use super::rows::Rows;
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
    runs: Rows,
    /// How many of them are kept that no later truth belongs to.
    past: usize,
    /// The number of the run after these, counted over all runs.
    number: u64,
    /// The number of the first run that is kept though no later truth belongs to it.
    needed: u64,
}

/// A run that a truth has been paired with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pair<'a> {
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
            runs: Rows::new(width),
            past: 0,
            number: 0,
            needed: u64::MAX,
        }
    }

    /// Writes a run down. Room is made by doubling until the number of runs within the horizon is known.
    ///
    /// # Panics
    /// When `parts` do not add up to the width.
    #[inline]
    pub fn run<'a>(&mut self, now: Instant, parts: impl IntoIterator<Item = &'a [f64]>) {
        self.forget_before(now - self.ahead);
        let mut row = self.runs.push(now);
        for part in parts {
            let (here, rest) = row.split_at_mut(part.len());
            here.copy_from_slice(part);
            row = rest;
        }
        assert!(row.is_empty(), "the parts of a row fill its width");
    }

    /// The run that a truth at `tau` belongs to. Instants asked for never go back.
    pub fn truth(&mut self, tau: Instant) -> Option<Pair<'_>> {
        let number = self.number_for(tau)?;
        Some(Pair {
            at: self.runs.time(self.past)?,
            number,
            row: self.last(),
        })
    }

    /// The number of that run.
    #[inline]
    pub(crate) fn number_for(&mut self, tau: Instant) -> Option<u64> {
        let due = tau - self.ahead;
        self.forget_before(due);
        let at = self.runs.time(self.past)?;
        (at <= due && due - at <= self.limit).then_some(self.number)
    }

    /// The run that the last truth was paired with.
    pub fn last(&self) -> &[f64] {
        self.runs.row(self.past)
    }

    /// The number of the run that the last truth was paired with.
    pub fn last_number(&self) -> u64 {
        self.number
    }

    /// Keeps all runs from one of them on, those too that no later truth belongs to; without a number none of these.
    pub(crate) fn keep_from(&mut self, number: Option<u64>) {
        self.needed = number.unwrap_or(u64::MAX);
    }

    /// What was written down of a run, if it is kept.
    #[inline]
    pub(crate) fn row_of(&self, number: u64) -> Option<&[f64]> {
        let nth = number.checked_sub(self.first())?;
        let nth = usize::try_from(nth).ok()?;
        (nth < self.runs.len()).then(|| self.runs.row(nth))
    }

    /// Goes on from another that pairs alike; false where it does not.
    pub(crate) fn go_on_from(&mut self, other: &Self) -> bool {
        let of = |pairing: &Self| (pairing.ahead, pairing.limit, pairing.runs.width());
        let counts = other.past <= other.runs.len() && other.past as u64 <= other.number;
        let takes = of(self) == of(other) && counts;
        if takes {
            self.clone_from(other);
            self.runs.reserve();
        }
        takes
    }

    /// Forgets all runs: the next one belongs to another segment.
    pub fn clear(&mut self) {
        self.number += (self.runs.len() - self.past) as u64;
        self.past = 0;
        self.runs.clear();
    }

    /// The number of the first run that is kept.
    #[inline]
    fn first(&self) -> u64 {
        self.number - self.past as u64
    }

    /// Forgets the runs before the last one at or before `due`, but those that are needed.
    #[inline]
    fn forget_before(&mut self, due: Instant) {
        while self
            .runs
            .time(self.past + 1)
            .is_some_and(|next| next <= due)
        {
            self.past += 1;
            self.number += 1;
        }
        while self.past > 0 && self.first() < self.needed {
            self.runs.pop();
            self.past -= 1;
        }
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
        assert!(pairing.runs.len() <= 302, "{}", pairing.runs.len());
        assert_eq!(pairing.truth(s(100_100)).map(|p| p.number), Some(99_800));
    }
}
