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
            for number in &mut self.row {
                *number = self
                    .state
                    .rows
                    .pop_front()
                    .expect("a row is withheld with each truth");
            }
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
