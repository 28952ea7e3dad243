//! Decides when a combiner is told of a truth; not what it makes of it.

use super::gather::Gathered;
use super::state::NodeState;
use super::withheld::{Released, Withheld};
use crate::compile::TruthLink;
use crate::node::{Combine, Restored, Votes};
use crate::time::{Duration, Instant};

/// A combiner in a running plan, with the truths that the embargo still withholds from it.
pub(crate) struct Vote {
    combine: Box<dyn Combine>,
    withheld: Option<Withheld>,
    reasons: bool,
}

impl Vote {
    pub(crate) fn new(
        combine: Box<dyn Combine>,
        voters: usize,
        link: Option<TruthLink>,
        reasons: bool,
    ) -> Self {
        Self {
            combine,
            withheld: link.map(|link| Withheld::new(link, voters)),
            reasons,
        }
    }

    /// Tells the combiner the state that it goes by.
    pub(crate) fn go_by(&mut self, state: f64, now: Instant) {
        self.combine.state(now, state);
    }

    /// Whether it gives reasons.
    pub(crate) fn reasons(&self) -> bool {
        self.reasons
    }

    /// Why the votes of this tick are combined as they are.
    pub(crate) fn reason(&self, votes: &Gathered) -> f64 {
        self.combine.reason(Votes(&votes.values))
    }

    /// Hands over what the embargo lets through at `now`.
    pub(crate) fn release(&mut self, now: Instant) {
        let Self {
            combine, withheld, ..
        } = self;
        if let Some(withheld) = withheld {
            let newest = withheld.newest(now);
            withheld.release(newest, |released| tell(&mut **combine, released));
            combine.advance(newest);
        }
    }

    /// Combines the votes of this tick: the result and its stamp.
    pub(crate) fn run(&mut self, votes: &Gathered, now: Instant) -> (f64, Instant) {
        let combined = self.combine.combine(Votes(&votes.values));
        if let Some(withheld) = &mut self.withheld {
            withheld.run(now, [&votes.values[..]]);
        }
        (combined, votes.oldest().unwrap_or(now))
    }

    /// The weights by which the votes of this tick are combined.
    pub(crate) fn weights(&self, votes: &Gathered, weights: &mut [f64]) {
        weights.fill(f64::NAN);
        self.combine.weights(Votes(&votes.values), weights);
    }

    /// The truth to look at after all outputs, if any.
    pub(crate) fn truth(&self) -> Option<usize> {
        Some(self.withheld.as_ref()?.link().slot)
    }

    /// Takes a truth that has just been measured.
    pub(crate) fn observe(&mut self, truth: f64, now: Instant) {
        if let Some(withheld) = &mut self.withheld {
            withheld.observe(truth, now);
        }
    }

    /// The segment has ended with this tick.
    pub(crate) fn segment(&mut self, last: Instant) {
        let Self {
            combine, withheld, ..
        } = self;
        if let Some(withheld) = withheld {
            withheld.end_segment(last, |released| tell(&mut **combine, released));
        }
    }

    /// What the combiner knows, and what is still withheld from it.
    pub(crate) fn snapshot(&self) -> NodeState {
        let mut state = NodeState::pack(self.combine.snapshot());
        state.learning = self.withheld.as_ref().map(Withheld::state);
        state
    }

    /// Goes on from the state of a combiner of the same voters.
    pub(crate) fn restore(&mut self, state: &NodeState) -> Restored {
        let answer = match state.unpack() {
            Ok(Some(own)) => self.combine.restore(own),
            Ok(None) => Restored::Accepted,
            Err(cold) => cold,
        };
        if let (Some(withheld), Some(from)) = (&mut self.withheld, &state.learning)
            && !matches!(answer, Restored::Cold { .. })
        {
            withheld.restore(from);
        }
        answer
    }

    /// Moves what is remembered to the clock of the segment that begins.
    pub(crate) fn shift(&mut self, shift: Duration) {
        self.combine.segment(shift);
    }
}

fn tell(combine: &mut dyn Combine, released: Released<'_>) {
    combine.observe(Votes(released.row), released.truth, released.arrived);
}
