//! Decides when a combiner is told of a truth; not what it makes of it.

use std::collections::VecDeque;

use super::gather::Gathered;
use super::pairing::Pairing;
use super::state::NodeState;
use crate::channel::ABSENT;
use crate::compile::TruthLink;
use crate::node::{Combine, Restored, Votes};
use crate::time::{Duration, Instant};
use serde::{Deserialize, Serialize};

/// A combiner in a running plan, with the truths that the embargo still withholds from it.
pub(crate) struct Vote {
    combine: Box<dyn Combine>,
    learning: Option<Learning>,
}

struct Learning {
    link: TruthLink,
    pairing: Pairing,
    /// Arrival and value of truths not yet handed over, and the votes cast for each.
    withheld: VecDeque<(Instant, f64)>,
    votes: VecDeque<f64>,
    row: Vec<f64>,
}

impl Vote {
    pub(crate) fn new(combine: Box<dyn Combine>, voters: usize, link: Option<TruthLink>) -> Self {
        let learning = link.map(|link| Learning {
            link,
            pairing: Pairing::new(&link, voters),
            withheld: VecDeque::new(),
            votes: VecDeque::new(),
            row: vec![0.0; voters],
        });
        Self { combine, learning }
    }

    /// Hands over what the embargo lets through at `now`.
    pub(crate) fn release(&mut self, now: Instant) {
        if let Some(learning) = &mut self.learning {
            let newest = now - learning.link.embargo();
            learning.release(newest, &mut *self.combine);
            self.combine.advance(newest);
        }
    }

    /// Combines the votes of this tick: the result and its stamp.
    pub(crate) fn run(&mut self, votes: &Gathered, now: Instant) -> (f64, Instant) {
        let combined = self.combine.combine(Votes(&votes.values));
        let combined = if combined.is_infinite() {
            ABSENT
        } else {
            combined
        };
        if let Some(learning) = &mut self.learning {
            learning.pairing.run(now, [&votes.values[..]]);
        }
        (combined, votes.oldest().unwrap_or(now))
    }

    /// The weights by which the votes of this tick are combined.
    pub(crate) fn weights(&self, votes: &Gathered, weights: &mut [f64]) {
        weights.fill(f64::NAN);
        self.combine.weights(Votes(&votes.values), weights);
    }

    /// Asks for the answer to any votes, all of them and all but the first.
    #[cfg(feature = "testkit")]
    pub(crate) fn ask_idly(&self, mut votes: Vec<f64>) {
        self.combine.combine(Votes(&votes));
        self.combine
            .weights(Votes(&votes), &mut vec![f64::NAN; votes.len()]);
        if let Some(first) = votes.first_mut() {
            *first = f64::NAN;
        }
        self.combine.combine(Votes(&votes));
    }

    /// The truth to look at after all outputs, if any.
    pub(crate) fn truth(&self) -> Option<usize> {
        self.learning.as_ref().map(|learning| learning.link.slot)
    }

    /// Takes a truth that has just been measured.
    pub(crate) fn observe(&mut self, truth: f64, now: Instant) {
        let Some(learning) = &mut self.learning else {
            return;
        };
        if let Some(paired) = learning.pairing.truth(now) {
            learning.withheld.push_back((now, truth));
            learning.votes.extend(paired.row);
        }
    }

    /// Goes over into another segment, which starts `shift` later than a seamless continuation would.
    pub(crate) fn segment(&mut self, last: Instant) {
        if let Some(learning) = &mut self.learning {
            // The embargo guards predictions of the segment that has ended; none of them is still to come.
            learning.release(last, &mut *self.combine);
            learning.pairing.clear();
        }
    }

    /// What the combiner knows, and what is still withheld from it.
    pub(crate) fn snapshot(&self) -> NodeState {
        let mut state = NodeState::pack(self.combine.snapshot());
        state.learning = self.learning.as_ref().map(|learning| LearningState {
            pairing: learning.pairing.clone(),
            withheld: learning.withheld.clone(),
            votes: learning.votes.clone(),
        });
        state
    }

    /// Goes on from the state of a combiner of the same voters.
    pub(crate) fn restore(&mut self, state: &NodeState) -> Restored {
        let answer = match state.unpack() {
            Ok(Some(own)) => self.combine.restore(own),
            Ok(None) => Restored::Accepted,
            Err(cold) => cold,
        };
        if let (Some(learning), Some(from)) = (&mut self.learning, &state.learning)
            && !matches!(answer, Restored::Cold { .. })
        {
            learning.pairing.clone_from(&from.pairing);
            learning.withheld.clone_from(&from.withheld);
            learning.votes.clone_from(&from.votes);
            // The engine thread must not have to make room.
            learning.withheld.reserve(learning.withheld.len().max(16));
            learning.votes.reserve(learning.votes.len().max(64));
        }
        answer
    }

    /// Moves what is remembered to the clock of the segment that begins.
    pub(crate) fn shift(&mut self, shift: Duration) {
        self.combine.segment(shift);
    }
}

/// The truths that are withheld from a combiner, and the runs that later ones may be paired with.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct LearningState {
    pairing: Pairing,
    withheld: VecDeque<(Instant, f64)>,
    votes: VecDeque<f64>,
}

impl Learning {
    fn release(&mut self, newest: Instant, combine: &mut dyn Combine) {
        while let Some(&(arrived, truth)) = self.withheld.front() {
            if arrived > newest {
                break;
            }
            self.withheld.pop_front();
            for vote in &mut self.row {
                *vote = self
                    .votes
                    .pop_front()
                    .expect("as many votes are withheld as truths times voters");
            }
            combine.observe(Votes(&self.row), truth, arrived);
        }
    }
}
