//! Combiners that pass one vote on: the best of late, the first that is there, or none that does harm.

use athermal_core::node::{Combine, Combiner, InputPort, Mistake, Restored, State, Votes};
use athermal_core::time::{Duration, Instant};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::errors::Errors;

const VOTERS: InputPort = InputPort::held("voters", "predictions of the same truth");

/// The vote of the voter with the smallest recent root mean square error.
///
/// A voter without errors in memory is taken only while none has any, the first one first.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Best {
    /// How long an error is remembered, counted from the arrival of its truth.
    pub memory: Duration,
}

/// The first vote that is there, in the order of the voters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Fallback {}

/// Passes a prediction on only while it does no harm: while its recent error is below that of predicting zero.
///
/// Otherwise it predicts zero, and the port `weights` says 0 rather than 1. Before any truth has been compared, nothing is
/// known to do harm and the prediction passes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Guard {
    /// How long an error is remembered, counted from the arrival of its truth.
    pub memory: Duration,
    /// How many truths must be in memory before a prediction is held back; 1 or more.
    #[serde(default = "five")]
    #[schemars(range(min = 1))]
    pub min_truths: usize,
}

fn five() -> usize {
    5
}

fn memory_mistakes(memory: Duration) -> Vec<Mistake> {
    if memory > Duration::ZERO {
        return Vec::new();
    }
    let message = format!("`memory` is {memory} and must be longer than nothing");
    vec![Mistake::at("memory", message)]
}

impl Combiner for Best {
    fn inputs() -> &'static [InputPort] {
        const {
            &[
                VOTERS,
                InputPort::truth("what the voters predict, for their errors"),
            ]
        }
    }

    fn mistakes(&self) -> Vec<Mistake> {
        memory_mistakes(self.memory)
    }

    fn weighs(&self) -> bool {
        true
    }

    fn memory(&self) -> Duration {
        self.memory
    }

    fn build(&self, voters: usize) -> Box<dyn Combine> {
        Box::new(Choosing {
            errors: Errors::new(voters, self.memory),
        })
    }
}

impl Combiner for Fallback {
    fn inputs() -> &'static [InputPort] {
        const { &[VOTERS] }
    }

    fn weighs(&self) -> bool {
        true
    }

    fn build(&self, voters: usize) -> Box<dyn Combine> {
        // Nobody's errors are ever known, so the first one is taken.
        Box::new(Choosing {
            errors: Errors::new(voters, Duration::ZERO),
        })
    }
}

/// Passes on the vote with the smallest mean square error in memory.
struct Choosing {
    errors: Errors,
}

impl Choosing {
    fn chosen(&self, votes: Votes<'_>) -> Option<(usize, f64)> {
        let error = |voter: usize| self.errors.means()[voter].unwrap_or(f64::INFINITY);
        votes.present().reduce(|best, next| {
            if error(next.0) < error(best.0) {
                next
            } else {
                best
            }
        })
    }
}

impl Combine for Choosing {
    fn combine(&self, votes: Votes<'_>) -> f64 {
        self.chosen(votes).map_or(f64::NAN, |(_, vote)| vote)
    }

    fn weights(&self, votes: Votes<'_>, weights: &mut [f64]) {
        let chosen = self.chosen(votes).map(|(voter, _)| voter);
        for (voter, _) in votes.present() {
            weights[voter] = if Some(voter) == chosen { 1.0 } else { 0.0 };
        }
    }

    fn observe(&mut self, votes: Votes<'_>, truth: f64, arrived: Instant) {
        self.errors.observe(votes, truth, arrived);
    }

    fn advance(&mut self, newest: Instant) {
        self.errors.advance(newest);
    }

    fn segment(&mut self, shift: Duration) {
        self.errors.shift(shift);
    }

    fn snapshot(&self) -> Option<Box<dyn State>> {
        Some(Box::new(self.errors.clone()))
    }

    fn restore(&mut self, state: Box<dyn State>) -> Restored {
        self.errors.restore(state)
    }
}

impl Combiner for Guard {
    fn inputs() -> &'static [InputPort] {
        const {
            &[
                InputPort::held("voters", "the prediction that is guarded"),
                InputPort::truth("what it predicts, for its errors"),
            ]
        }
    }

    fn mistakes(&self) -> Vec<Mistake> {
        let mut mistakes = memory_mistakes(self.memory);
        if self.min_truths == 0 {
            mistakes.push(Mistake::at(
                "min_truths",
                "`min_truths` is 0 and must be 1 or more",
            ));
        }
        mistakes
    }

    fn weighs(&self) -> bool {
        true
    }

    fn memory(&self) -> Duration {
        self.memory
    }

    fn build(&self, voters: usize) -> Box<dyn Combine> {
        Box::new(Guarding {
            min_truths: self.min_truths,
            // Behind the voters stands one that always predicts zero.
            errors: Errors::new(voters + 1, self.memory),
            voters,
        })
    }
}

/// Compares the mean of the votes with predicting zero.
struct Guarding {
    min_truths: usize,
    errors: Errors,
    voters: usize,
}

impl Guarding {
    /// Whether the votes have been worse than predicting zero of late.
    fn harms(&self) -> bool {
        let means = self.errors.means();
        let zero = means[self.voters];
        let known = self.errors.count(self.voters) >= self.min_truths;
        let worst = means[..self.voters]
            .iter()
            .flatten()
            .copied()
            .fold(f64::NEG_INFINITY, f64::max);
        known && zero.is_some_and(|zero| worst >= zero)
    }
}

impl Combine for Guarding {
    fn combine(&self, votes: Votes<'_>) -> f64 {
        let (sum, count) = votes.present().fold((0.0, 0.0), |(sum, count), (_, vote)| {
            (sum + vote, count + 1.0)
        });
        if count == 0.0 {
            f64::NAN
        } else if self.harms() {
            0.0
        } else {
            sum / count
        }
    }

    fn weights(&self, votes: Votes<'_>, weights: &mut [f64]) {
        let passes = if self.harms() { 0.0 } else { 1.0 };
        let count = votes.present().count() as f64;
        for (voter, _) in votes.present() {
            weights[voter] = passes / count;
        }
    }

    fn observe(&mut self, votes: Votes<'_>, truth: f64, arrived: Instant) {
        self.errors.observe(votes, truth, arrived);
        if votes.present().next().is_some() {
            self.errors.observe_one(self.voters, 0.0, truth, arrived);
        }
    }

    fn advance(&mut self, newest: Instant) {
        self.errors.advance(newest);
    }

    fn segment(&mut self, shift: Duration) {
        self.errors.shift(shift);
    }

    fn snapshot(&self) -> Option<Box<dyn State>> {
        Some(Box::new(self.errors.clone()))
    }

    fn restore(&mut self, state: Box<dyn State>) -> Restored {
        self.errors.restore(state)
    }
}

athermal_core::register!(Best, Combiner, "best");
athermal_core::register!(Fallback, Combiner, "fallback");
athermal_core::register!(Guard, Combiner, "guard");

#[cfg(test)]
mod tests {
    use super::*;

    fn s(seconds: i64) -> Instant {
        Instant::from_ns(seconds * 1_000_000_000)
    }

    fn minutes(count: i64) -> Duration {
        Duration::from_ns(count * 60_000_000_000)
    }

    #[test]
    fn the_best_of_late_is_passed_on_until_another_is_better() {
        let mut best = Best {
            memory: minutes(10),
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

    #[test]
    fn a_guard_predicts_zero_while_the_prediction_does_harm_and_says_so() {
        let mut guard = Guard {
            memory: minutes(10),
            min_truths: 2,
        }
        .build(1);
        assert_eq!(guard.combine(Votes(&[7.0])), 7.0);
        guard.observe(Votes(&[7.0]), 1.0, s(0));
        assert_eq!(guard.combine(Votes(&[7.0])), 7.0, "one truth is not enough");
        guard.observe(Votes(&[7.0]), 1.0, s(60));
        assert_eq!(guard.combine(Votes(&[7.0])), 0.0);
        let mut weights = [f64::NAN];
        guard.weights(Votes(&[7.0]), &mut weights);
        assert_eq!(weights, [0.0]);
        guard.advance(s(700));
        assert_eq!(
            guard.combine(Votes(&[7.0])),
            7.0,
            "what is forgotten does not count"
        );
    }
}
