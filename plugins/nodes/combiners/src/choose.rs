//! Combiners that pass one vote on: the best of late, or the first that is there.

use athermal_core::node::{Combine, Combiner, Duty, InputPort, Kept, KindFacts, Votes};
use athermal_core::time::Duration;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::errors::{ByErrors, Errors, Rule};
use crate::memory::Memory;

const VOTERS: InputPort = InputPort::held("voters", "predictions of the same truth");

/// The vote of the voter with the smallest recent root mean square error.
///
/// `ŷ = ŷ_k`, with `k` the voter whose `RMSE_k = √(Σ (y − ŷ_k)² / n)` over the truths in memory is the smallest. A
/// voter without errors in memory is taken only while none has any, the first one first. The port `weights` shows whose
/// vote it is, and the port `std_dev` its standard deviation where all voters have one. The error of a voter whose
/// `novelty` is above 1 counts as so many times as large.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Best {
    /// How long an error is remembered, counted from when the embargo lets its truth through: `"15min"`, `{ truths = 12 }`, or
    /// ever less by `{ half_life = "15min" }`, and not at all after ten half-lives.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub memory: Memory,
}

/// The first vote that is there, in the order of the voters.
///
/// `ŷ = ŷ_k`, with `k` the first voter that has one. The port `weights` shows whose it is, and the port `std_dev` its
/// standard deviation where all voters have one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Fallback {}

impl Combiner for Best {
    fn inputs() -> &'static [InputPort] {
        const {
            &[
                VOTERS,
                InputPort::truth("what the voters predict, for their errors"),
            ]
        }
    }

    fn has_weights(&self) -> bool {
        true
    }

    fn heeds_novelty(&self) -> bool {
        true
    }

    fn memory(&self) -> Duration {
        self.memory.longest()
    }

    fn keeps(&self, voters: usize, every: Duration) -> Vec<Kept> {
        self.memory.keeps(voters, every)
    }

    fn is_endless(&self) -> bool {
        self.memory.is_endless()
    }

    fn build(&self, voters: usize) -> Box<dyn Combine> {
        Box::new(ByErrors::new(OfLate, voters, self.memory))
    }
}

/// Passes on the vote with the smallest mean square error in memory.
struct OfLate;

impl Rule for OfLate {
    fn combine(&self, errors: &Errors, votes: Votes<'_>) -> f64 {
        chosen(errors, votes).map_or(f64::NAN, |(_, vote)| vote)
    }

    fn weights(&self, errors: &Errors, votes: Votes<'_>, weights: &mut [f64]) {
        all_on(chosen(errors, votes), votes, weights);
    }
}

fn chosen(errors: &Errors, votes: Votes<'_>) -> Option<(usize, f64)> {
    let trust = |voter: usize| errors.trust().map_or(1.0, |trust| trust[voter]);
    let error =
        |voter: usize| errors.means()[voter].map_or(f64::INFINITY, |mean| mean / trust(voter));
    votes.present().reduce(|best, next| {
        if error(next.0) < error(best.0) {
            next
        } else {
            best
        }
    })
}

/// All weight on one vote.
pub(crate) fn all_on(one: Option<(usize, f64)>, votes: Votes<'_>, weights: &mut [f64]) {
    let chosen = one.map(|(voter, _)| voter);
    for (voter, _) in votes.present() {
        weights[voter] = if Some(voter) == chosen { 1.0 } else { 0.0 };
    }
}

impl Combiner for Fallback {
    fn facts() -> KindFacts {
        KindFacts::of(Duty::Fallback)
    }

    fn inputs() -> &'static [InputPort] {
        const { &[VOTERS] }
    }

    fn has_weights(&self) -> bool {
        true
    }

    fn build(&self, _voters: usize) -> Box<dyn Combine> {
        Box::new(First)
    }
}

/// Passes on the first vote.
struct First;

impl Combine for First {
    fn combine(&self, votes: Votes<'_>) -> f64 {
        votes.present().next().map_or(f64::NAN, |(_, vote)| vote)
    }

    fn weights(&self, votes: Votes<'_>, weights: &mut [f64]) {
        all_on(votes.present().next(), votes, weights);
    }
}

athermal_core::register!(Best, Combiner, "best");
athermal_core::register!(Fallback, Combiner, "fallback");

#[cfg(test)]
mod tests {
    use super::*;
    use athermal_core::time::Instant;

    fn s(seconds: i64) -> Instant {
        Instant::from_ns(seconds * 1_000_000_000)
    }

    #[test]
    fn the_best_of_late_is_passed_on_until_another_is_better() {
        let ten_minutes = Memory::Time(Duration::from_ns(600_000_000_000));
        let mut best = Best {
            memory: ten_minutes,
        }
        .build(2);
        assert_eq!(best.combine(Votes(&[1.0, 2.0])), 1.0);
        best.observe(Votes(&[5.0, 1.0]), 0.0, s(0));
        assert_eq!(best.combine(Votes(&[1.0, 2.0])), 2.0);
        best.advance(s(600));
        assert_eq!(best.combine(Votes(&[1.0, 2.0])), 1.0);
    }

    #[test]
    fn the_first_vote_that_is_there_is_the_fallback() {
        let fallback = Fallback {}.build(3);
        assert_eq!(fallback.combine(Votes(&[f64::NAN, 4.0, 5.0])), 4.0);
        let mut weights = [f64::NAN; 3];
        fallback.weights(Votes(&[f64::NAN, 4.0, 5.0]), &mut weights);
        assert!(weights[0].is_nan() && weights[1..] == [1.0, 0.0]);
    }
}
