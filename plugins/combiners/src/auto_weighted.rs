//! The vote that weighs each estimator by its recent error.

use std::collections::VecDeque;

use athermal_core::node::{Combine, Combiner, InputPort, Mistake, Restored, State, Votes};
use athermal_core::time::{Duration, Instant};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Auto-weighted voting: each voter counts by its recent root mean square error.
///
/// `ŷ = Σ w_i ŷ_i` with `w_i ∝ RMSE_i^(−power)`, normalised, over the truths that arrived within `memory`. Only truths
/// whose window does not overlap the predicted one count. A voter without errors in memory takes the mean weight of the
/// others; if no voter has any, all weights are equal. A voter without a prediction drops out and the rest are
/// renormalised, so that the vote goes on when a sensor dies.
///
/// After Mandelli, Dankwart and Napoli, section 3.4, whose printed formula `(RMSE_i / Σ RMSE_j)²` favours the worst voter;
/// it is there for comparison.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AutoWeighted {
    /// How long an error is remembered, counted from the arrival of its truth.
    pub memory: Duration,
    /// How strongly errors count: 0 not at all, 2 as inverse variances do; at most 16.
    #[serde(default = "two")]
    #[schemars(range(min = 0.0, max = 16.0))]
    pub power: f64,
    /// How errors become weights.
    #[serde(default)]
    pub weights: Weighting,
}

fn two() -> f64 {
    2.0
}

/// How errors become weights.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Weighting {
    /// `RMSE_i^(−power)`, normalised.
    #[default]
    InversePower,
    /// `(RMSE_i / Σ RMSE_j)²` as the article prints it, but normalised.
    AsPrinted,
    /// `(RMSE_i / Σ RMSE_j)²` exactly as the article prints it; the weights do not add up to 1.
    AsPrintedRaw,
}

impl Combiner for AutoWeighted {
    fn inputs() -> &'static [InputPort] {
        const {
            &[
                InputPort::held("voters", "predictions of the same truth"),
                InputPort::truth("what the voters predict, for their errors"),
            ]
        }
    }

    fn mistakes(&self) -> Vec<Mistake> {
        let mut mistakes = Vec::new();
        if self.memory <= Duration::ZERO {
            mistakes.push(Mistake::at(
                "memory",
                format!(
                    "`memory` is {} and must be longer than nothing",
                    self.memory
                ),
            ));
        }
        if !(0.0..=16.0).contains(&self.power) {
            mistakes.push(Mistake::at(
                "power",
                format!("`power` is {} and must be from 0 to 16", self.power),
            ));
        }
        mistakes
    }

    fn memory(&self) -> Duration {
        self.memory
    }

    fn build(&self, voters: usize) -> Box<dyn Combine> {
        Box::new(Weigher {
            parameters: self.clone(),
            memories: vec![VecDeque::new(); voters],
            mean_squares: vec![None; voters],
        })
    }
}

/// The memory of recent errors.
struct Weigher {
    parameters: AutoWeighted,
    /// For each voter the arrival and square of its errors, oldest first.
    memories: Vec<VecDeque<(Instant, f64)>>,
    /// For each voter the mean square of what it has in memory.
    mean_squares: Vec<Option<f64>>,
}

impl Weigher {
    /// The weights of the voters that are there, by the function, which is told of each mean square.
    ///
    /// The sum is taken afresh over what is in memory, so that an error of 10⁹ leaves no trace once it is forgotten.
    fn refresh(&mut self, voter: usize) {
        let memory = &self.memories[voter];
        let sum: f64 = memory.iter().map(|(_, squared)| squared).sum();
        self.mean_squares[voter] = (!memory.is_empty()).then(|| sum / memory.len() as f64);
    }

    /// Σ w ŷ and Σ w over the votes that are there, with the weight of each known voter given by `weigh`.
    fn sums(&self, votes: Votes<'_>, weigh: impl Fn(f64) -> f64) -> (f64, f64) {
        let (mut known, mut weights, mut weighted) = (0.0, 0.0, 0.0);
        let (mut new, mut sum_of_new) = (0.0, 0.0);
        for (voter, vote) in votes.present() {
            if let Some(mean_square) = self.mean_squares[voter] {
                let weight = weigh(mean_square);
                known += 1.0;
                weights += weight;
                weighted += weight * vote;
            } else {
                new += 1.0;
                sum_of_new += vote;
            }
        }
        let weight_of_new = if known > 0.0 { weights / known } else { 1.0 };
        (
            weighted + weight_of_new * sum_of_new,
            weights + weight_of_new * new,
        )
    }

    fn present_squares<'a>(&'a self, votes: Votes<'a>) -> impl Iterator<Item = f64> + 'a {
        self.mean_squares
            .iter()
            .zip(votes.0)
            .filter(|(_, vote)| !vote.is_nan())
            .filter_map(|(mean_square, _)| *mean_square)
    }
}

impl Combine for Weigher {
    fn combine(&self, votes: Votes<'_>) -> f64 {
        let power = self.parameters.power;
        let (weighted, weights) = match self.parameters.weights {
            Weighting::InversePower => {
                // Relative to the best voter, so that nothing over- or underflows; an error of exactly zero counts as
                // the smallest number there is.
                let best = self
                    .present_squares(votes)
                    .fold(f64::INFINITY, f64::min)
                    .max(f64::MIN_POSITIVE);
                self.sums(votes, |mean_square| {
                    let ratio = best / mean_square.max(f64::MIN_POSITIVE);
                    if power == 2.0 {
                        ratio
                    } else {
                        ratio.powf(0.5 * power)
                    }
                })
            }
            Weighting::AsPrinted | Weighting::AsPrintedRaw => {
                let total: f64 = self.present_squares(votes).map(f64::sqrt).sum();
                self.sums(votes, |mean_square| {
                    let share = if total > 0.0 {
                        mean_square.sqrt() / total
                    } else {
                        1.0
                    };
                    share * share
                })
            }
        };
        if weights == 0.0 {
            f64::NAN
        } else if self.parameters.weights == Weighting::AsPrintedRaw
            && self.present_squares(votes).next().is_some()
        {
            weighted
        } else {
            weighted / weights
        }
    }

    fn observe(&mut self, votes: Votes<'_>, truth: f64, arrived: Instant) {
        for (voter, vote) in votes.present() {
            self.memories[voter].push_back((arrived, (vote - truth) * (vote - truth)));
            self.refresh(voter);
        }
    }

    fn advance(&mut self, newest: Instant) {
        let forgotten = newest - self.parameters.memory;
        for voter in 0..self.memories.len() {
            let memory = &mut self.memories[voter];
            let before = memory.len();
            while memory
                .front()
                .is_some_and(|&(arrived, _)| arrived <= forgotten)
            {
                memory.pop_front();
            }
            if memory.len() < before {
                self.refresh(voter);
            }
        }
    }

    fn segment(&mut self, shift: Duration) {
        for (arrived, _) in self.memories.iter_mut().flatten() {
            *arrived = *arrived + shift;
        }
    }

    fn snapshot(&self) -> Option<Box<dyn State>> {
        Some(Box::new(Remembered {
            errors: self.memories.clone(),
        }))
    }

    fn restore(&mut self, state: Box<dyn State>) -> Restored {
        let remembered = match state.known::<Remembered>() {
            Ok(remembered) => remembered,
            Err(cold) => return cold,
        };
        if remembered.errors.len() != self.memories.len() {
            return Restored::cold("the number of voters differs");
        }
        self.memories = remembered.errors;
        for memory in &mut self.memories {
            // The engine thread must not have to make room.
            memory.reserve(memory.len().max(32));
        }
        for voter in 0..self.memories.len() {
            self.refresh(voter);
        }
        Restored::Accepted
    }
}

/// What a vote remembers: for each voter the arrival and square of its errors, oldest first.
#[derive(Debug, Serialize, Deserialize)]
struct Remembered {
    errors: Vec<VecDeque<(Instant, f64)>>,
}

athermal_core::state!(Remembered, "auto_weighted/1");

athermal_core::register!(AutoWeighted, Combiner, "auto_weighted");
