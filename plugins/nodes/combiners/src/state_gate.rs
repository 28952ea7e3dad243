//! A voter for each state of stability.

use athermal_core::node::{Combine, Combiner, InputPort, Restored, State, Votes};
use athermal_core::time::{Duration, Instant};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::choose::all_on;

/// Passes on the voter that is meant for the present state of stability: the first voter for state 0, the second for state 1, and so on.
///
/// `ŷ = ŷ_s`, with `s` the state. The input `state` is the number that a `stability` node gives. With
/// `inputs.voters = ["thermal", "both", "motion"]` temperatures speak while the machine is stable, both in between, and
/// its own past in a transient (Mandelli, Dankwart and Napoli, section 3.4). States beyond the last voter belong to
/// that one; numbers between are rounded, and what is below zero or absent is a state that is not known. The state and
/// the `dwell` are watched at every tick. Against going to and fro, the `stability` node has `hysteresis` and `dwell`;
/// a `dwell` here is for this gate alone.
///
/// Where the voter of the state is absent, the next one in order that has a vote speaks, then those before it; where the state is not known, the first. The port
/// `reason` says: 0 the voter of the state speaks, 1 another since that one is absent, 2 the state is not known. The port `weights` shows whose
/// vote it is, and the port `std_dev` its standard deviation where all voters have one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StateGate {
    /// How long another state must have lasted before its voter speaks; no time by default. A state that is not known is taken
    /// at once, and so is the first one that is known after it.
    #[serde(default)]
    pub dwell: Duration,
}

/// The numbers of the port `reason`.
mod reason {
    pub(super) const OWN: f64 = 0.0;
    pub(super) const INSTEAD: f64 = 1.0;
    pub(super) const UNKNOWN: f64 = 2.0;
}

impl Combiner for StateGate {
    fn inputs() -> &'static [InputPort] {
        const {
            &[
                InputPort::held(
                    "voters",
                    "predictions of the same truth, one for each state",
                ),
                InputPort::held("state", "the state of stability, as a number from 0 on")
                    .in_unit("1"),
            ]
        }
    }

    fn has_weights(&self) -> bool {
        true
    }

    fn has_reason(&self) -> bool {
        true
    }

    fn memory(&self) -> Duration {
        self.dwell
    }

    fn build(&self, _voters: usize) -> Box<dyn Combine> {
        Box::new(Gate {
            dwell: self.dwell,
            seen: Seen::default(),
        })
    }
}

struct Gate {
    dwell: Duration,
    seen: Seen,
}

/// The state that is followed: that of the gate.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
struct Seen {
    followed: Option<usize>,
    /// Another state, and since when it lasts.
    other: Option<(usize, Instant)>,
}

impl Gate {
    /// The vote that is passed on, and why.
    fn chosen(&self, votes: Votes<'_>) -> Option<(usize, f64, f64)> {
        let Some(state) = self.seen.followed else {
            let first = votes.present().next();
            return first.map(|(voter, vote)| (voter, vote, reason::UNKNOWN));
        };
        let own = state.min(votes.0.len().saturating_sub(1));
        let after = votes.present().find(|&(voter, _)| voter >= own);
        let (voter, vote) = after.or_else(|| votes.present().last())?;
        let why = if voter == own {
            reason::OWN
        } else {
            reason::INSTEAD
        };
        Some((voter, vote, why))
    }
}

impl Combine for Gate {
    fn combine(&self, votes: Votes<'_>) -> f64 {
        self.chosen(votes).map_or(f64::NAN, |(_, vote, _)| vote)
    }

    fn weights(&self, votes: Votes<'_>, weights: &mut [f64]) {
        let chosen = self.chosen(votes).map(|(voter, vote, _)| (voter, vote));
        all_on(chosen, votes, weights);
    }

    fn reason(&self, votes: Votes<'_>) -> f64 {
        self.chosen(votes).map_or(f64::NAN, |(_, _, why)| why)
    }

    fn state(&mut self, now: Instant, state: f64) {
        // What is no number of a state, below zero or absent, is not known.
        if state.is_nan() || state < 0.0 {
            self.seen = Seen::default();
            return;
        }
        let found = state.round() as usize;
        match (self.seen.followed, self.seen.other) {
            (Some(state), _) if state == found => self.seen.other = None,
            (Some(_), Some((other, since))) if other == found => {
                if now - since >= self.dwell {
                    (self.seen.followed, self.seen.other) = (Some(found), None);
                }
            }
            (Some(_), _) if self.dwell > Duration::ZERO => self.seen.other = Some((found, now)),
            _ => (self.seen.followed, self.seen.other) = (Some(found), None),
        }
    }

    fn segment(&mut self, _shift: Duration) {
        self.seen = Seen::default();
    }

    fn snapshot(&self) -> Option<Box<dyn State>> {
        Some(Box::new(self.seen.clone()))
    }

    fn restore(&mut self, state: Box<dyn State>) -> Restored {
        state.replace(&mut self.seen)
    }
}

athermal_core::state!(Seen, "state_gate/1");
athermal_core::register!(StateGate, Combiner, "state_gate");

#[cfg(test)]
mod tests {
    use super::*;

    fn s(seconds: i64) -> Instant {
        Instant::from_ns(seconds * 1_000_000_000)
    }

    fn gate(dwell: i64) -> Box<dyn Combine> {
        let dwell = Duration::from_ns(dwell * 1_000_000_000);
        StateGate { dwell }.build(3)
    }

    /// The vote and the reason, after a state.
    fn told(gate: &mut dyn Combine, at: i64, state: f64, votes: &[f64]) -> (f64, f64) {
        gate.state(s(at), state);
        (gate.combine(Votes(votes)), gate.reason(Votes(votes)))
    }

    #[test]
    fn each_state_has_its_voter_and_the_last_one_all_beyond() {
        let mut gate = gate(0);
        let votes = [10.0, 11.0, 12.0];
        assert_eq!(told(&mut *gate, 0, 0.0, &votes), (10.0, 0.0));
        assert_eq!(told(&mut *gate, 1, 2.0, &votes), (12.0, 0.0));
        assert_eq!(told(&mut *gate, 2, 9.0, &votes), (12.0, 0.0));
        assert_eq!(told(&mut *gate, 3, 1.0, &votes), (11.0, 0.0));
    }

    #[test]
    fn another_speaks_for_an_absent_voter_and_the_reason_tells() {
        let mut gate = gate(0);
        let absent = f64::NAN;
        assert_eq!(told(&mut *gate, 0, 0.0, &[absent, 11.0, 12.0]), (11.0, 1.0));
        assert_eq!(told(&mut *gate, 1, 2.0, &[10.0, 11.0, absent]), (11.0, 1.0));
        assert_eq!(
            told(&mut *gate, 2, absent, &[10.0, 11.0, 12.0]),
            (10.0, 2.0)
        );
        assert!(told(&mut *gate, 3, 1.0, &[absent; 3]).0.is_nan());
    }

    #[test]
    fn another_state_must_have_lasted_before_its_voter_speaks() {
        let mut gate = gate(60);
        let votes = [10.0, 11.0, 12.0];
        assert_eq!(told(&mut *gate, 0, 0.0, &votes).0, 10.0);
        assert_eq!(told(&mut *gate, 10, 2.0, &votes).0, 10.0);
        assert_eq!(told(&mut *gate, 69, 2.0, &votes).0, 10.0);
        assert_eq!(told(&mut *gate, 70, 2.0, &votes).0, 12.0);
        assert_eq!(told(&mut *gate, 80, 0.0, &votes).0, 12.0);
        assert_eq!(told(&mut *gate, 90, 2.0, &votes).0, 12.0);
        assert_eq!(told(&mut *gate, 140, 0.0, &votes).0, 12.0);
        assert_eq!(told(&mut *gate, 199, 0.0, &votes).0, 12.0);
        assert_eq!(told(&mut *gate, 200, 0.0, &votes).0, 10.0);
    }
}
