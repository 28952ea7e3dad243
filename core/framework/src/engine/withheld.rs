//! Decides when a truth may be told to whoever learns from it; not what is made of it.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

use super::pairing::Pairing;
use crate::compile::TruthLink;
use crate::time::Instant;

/// The runs that truths may be paired with, and the pairs that the embargo still withholds.
#[derive(Debug)]
pub(crate) struct Withheld {
    link: TruthLink,
    state: LearningState,
    row: Vec<f64>,
}

/// What is withheld, as it is kept.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct LearningState {
    pairing: Pairing,
    /// Arrival and value of truths not yet handed over.
    withheld: VecDeque<(Instant, f64)>,
    /// What was written down of the run that each of them belongs to.
    rows: VecDeque<f64>,
}

/// A truth that the embargo lets through, and what was written down of the run that it belongs to.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Released<'a> {
    pub(crate) row: &'a [f64],
    pub(crate) truth: f64,
    pub(crate) arrived: Instant,
}

impl Withheld {
    /// Nothing yet, for runs of each of which `width` numbers are written down.
    pub(crate) fn new(link: TruthLink, width: usize) -> Self {
        Self {
            link,
            state: LearningState {
                pairing: Pairing::new(&link, width),
                withheld: VecDeque::new(),
                rows: VecDeque::new(),
            },
            row: vec![0.0; width],
        }
    }

    /// The truth and how it is paired.
    pub(crate) fn link(&self) -> &TruthLink {
        &self.link
    }

    /// Writes a run down.
    pub(crate) fn run<'a>(&mut self, now: Instant, parts: impl IntoIterator<Item = &'a [f64]>) {
        self.state.pairing.run(now, parts);
    }

    /// Takes a truth that has just been measured, if there was a run for it: the last number of its row.
    pub(crate) fn observe(&mut self, truth: f64, now: Instant) -> Option<&mut f64> {
        let LearningState {
            pairing,
            withheld,
            rows,
        } = &mut self.state;
        let paired = pairing.truth(now)?;
        withheld.push_back((now, truth));
        rows.extend(paired.row);
        rows.back_mut()
    }

    /// The newest arrival that a prediction made at `now` may know of.
    pub(crate) fn newest(&self, now: Instant) -> Instant {
        now - self.link.embargo()
    }

    /// Hands over every truth that arrived up to `newest`, in order.
    #[inline]
    pub(crate) fn release(&mut self, newest: Instant, tell: impl FnMut(Released<'_>)) {
        let next = self.state.withheld.front();
        if next.is_some_and(|&(arrived, _)| arrived <= newest) {
            self.release_some(newest, tell);
        }
    }

    #[inline(never)]
    fn release_some(&mut self, newest: Instant, mut tell: impl FnMut(Released<'_>)) {
        while let Some(&(arrived, truth)) = self.state.withheld.front() {
            if arrived > newest {
                break;
            }
            self.state.withheld.pop_front();
            let (rows, width) = (&mut self.state.rows, self.row.len());
            let (begin, rest) = rows.as_slices();
            let (of_begin, of_rest) = self.row.split_at_mut(width.min(begin.len()));
            of_begin.copy_from_slice(&begin[..of_begin.len()]);
            of_rest.copy_from_slice(&rest[..of_rest.len()]);
            rows.drain(..width);
            tell(Released {
                row: &self.row,
                truth,
                arrived,
            });
        }
    }

    /// Hands over all, up to the last tick of a segment that has ended.
    pub(crate) fn end_segment(&mut self, last: Instant, tell: impl FnMut(Released<'_>)) {
        // The embargo guards predictions of the segment that has ended; none of them is still to come.
        self.release(last, tell);
        self.state.pairing.clear();
    }

    /// All that is withheld.
    pub(crate) fn state(&self) -> LearningState {
        self.state.clone()
    }

    /// Goes on from what was withheld of runs that are paired alike.
    pub(crate) fn restore(&mut self, state: &LearningState) {
        if !self.state.pairing.pairs_like(&state.pairing) {
            return;
        }
        self.state.clone_from(state);
        // The engine thread must not have to make room.
        let Self { state, row, .. } = self;
        state.withheld.reserve(state.withheld.len().max(16));
        state.rows.reserve(state.rows.len().max(16 * row.len()));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::Duration;

    #[test]
    fn each_truth_is_handed_over_with_the_whole_row_of_its_run() {
        let s = |seconds: i64| Instant::from_ns(seconds * 1_000_000_000);
        let minute = Duration::from_ns(60_000_000_000);
        let link = TruthLink {
            slot: 0,
            ahead: Duration::ZERO,
            span: minute,
            limit: minute,
        };
        let mut withheld = Withheld::new(link, 3);
        let mut handed = 0;
        for t in 0..1000 {
            let now = t as f64;
            withheld.release(withheld.newest(s(t)), |released| {
                let of = released.truth;
                assert_eq!(released.arrived, s(of as i64));
                assert_eq!(released.row, [of, of + 0.25, of + 0.5]);
                handed += 1;
            });
            // Some ticks are left out, so that rows do not lie alike each time round.
            if t % 7 < 4 {
                withheld.run(s(t), [&[now, now + 0.25][..], &[now + 0.5]]);
                withheld.observe(now, s(t));
            }
        }
        assert!(handed > 500, "{handed}");
    }
}
