//! The embargo: truths wait until a prediction made now may know of them.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

use super::pairing::Pairing;
use crate::compile::TruthLink;
use crate::time::Instant;

/// The runs that truths may be paired with, and the pairs that the embargo still withholds.
#[derive(Debug)]
pub(crate) struct Embargo {
    link: TruthLink,
    state: EmbargoState,
}

/// What is withheld, as it is kept.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct EmbargoState {
    pairing: Pairing,
    withheld: VecDeque<PendingTruth>,
}

/// A truth not yet handed over.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
struct PendingTruth {
    arrived: Instant,
    truth: f64,
    note: f64,
    /// The run that it belongs to.
    run: u64,
}

/// A truth that the embargo lets through.
#[derive(Debug, Clone, Copy)]
pub(crate) struct DueTruth<'a> {
    /// What was written down of the run that it belongs to.
    pub(crate) row: &'a [f64],
    pub(crate) truth: f64,
    pub(crate) arrived: Instant,
    /// What was noted when it arrived.
    pub(crate) note: f64,
}

impl Embargo {
    /// Nothing yet, for runs of each of which `width` numbers are written down.
    pub(crate) fn new(link: TruthLink, width: usize) -> Self {
        Self {
            link,
            state: EmbargoState {
                pairing: Pairing::new(&link, width),
                withheld: VecDeque::new(),
            },
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

    /// Takes a truth that has just been measured, and a note, if there was a run for it.
    #[inline]
    pub(crate) fn observe(&mut self, truth: f64, now: Instant, note: f64) {
        let EmbargoState { pairing, withheld } = &mut self.state;
        if let Some(run) = pairing.number_for(now) {
            if withheld.is_empty() {
                pairing.keep_from(Some(run));
            }
            withheld.push_back(PendingTruth {
                arrived: now,
                truth,
                note,
                run,
            });
        }
    }

    /// The newest arrival that a prediction made at `now` may know of.
    pub(crate) fn newest(&self, now: Instant) -> Instant {
        now - self.link.embargo()
    }

    /// Hands over every truth that arrived up to `newest`, in order.
    #[inline]
    pub(crate) fn release(&mut self, newest: Instant, give: impl FnMut(DueTruth<'_>)) {
        let next = self.state.withheld.front();
        if next.is_some_and(|late| late.arrived <= newest) {
            self.release_some(newest, give);
        }
    }

    #[inline(never)]
    fn release_some(&mut self, newest: Instant, mut give: impl FnMut(DueTruth<'_>)) {
        let EmbargoState { pairing, withheld } = &mut self.state;
        while let Some(&late) = withheld.front()
            && late.arrived <= newest
        {
            withheld.pop_front();
            if let Some(row) = pairing.row_of(late.run) {
                give(DueTruth {
                    row,
                    truth: late.truth,
                    arrived: late.arrived,
                    note: late.note,
                });
            }
        }
        pairing.keep_from(withheld.front().map(|late| late.run));
    }

    /// Forgets the runs of a segment that has ended: none of its truths is still to come.
    pub(crate) fn clear(&mut self) {
        self.state.pairing.clear();
    }

    /// All that is withheld.
    pub(crate) fn state(&self) -> EmbargoState {
        self.state.clone()
    }

    /// Goes on from what was withheld of runs that are paired alike.
    pub(crate) fn restore(&mut self, state: &EmbargoState) {
        let own = &mut self.state;
        if own.pairing.go_on_from(&state.pairing) {
            own.withheld.clone_from(&state.withheld);
            own.pairing
                .keep_from(own.withheld.front().map(|late| late.run));
            // The engine thread must not have to make room.
            own.withheld.reserve(own.withheld.len().max(16));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::Duration;

    fn link() -> TruthLink {
        let minute = Duration::from_ns(60_000_000_000);
        TruthLink {
            slot: 0,
            ahead: Duration::ZERO,
            span: minute,
            limit: minute,
        }
    }

    #[test]
    fn each_truth_is_handed_over_with_the_whole_row_of_its_run() {
        let s = |seconds: i64| Instant::from_ns(seconds * 1_000_000_000);
        let mut withheld = Embargo::new(link(), 3);
        let mut handed = 0;
        for t in 0..1000 {
            let now = t as f64;
            withheld.release(withheld.newest(s(t)), |released| {
                let of = released.truth;
                assert_eq!(released.arrived, s(of as i64));
                assert_eq!(released.row, [of, of + 0.25, of + 0.5]);
                assert_eq!(released.note, 2.0 * of);
                handed += 1;
            });
            // Some ticks are left out, so that rows do not lie alike each time round.
            if t % 7 < 4 {
                withheld.run(s(t), [&[now, now + 0.25][..], &[now + 0.5]]);
                withheld.observe(now, s(t), 2.0 * now);
            }
        }
        assert!(handed > 500, "{handed}");
    }
}
