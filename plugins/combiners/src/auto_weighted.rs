//! The vote that weighs each estimator by its recent error.

use athermal_core::node::{Combine, Combiner, InputPort, Mistake, Restored, State, Votes};
use athermal_core::time::{Duration, Instant};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::errors::Errors;

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

    fn weighs(&self) -> bool {
        true
    }

    fn memory(&self) -> Duration {
        self.memory
    }

    fn build(&self, voters: usize) -> Box<dyn Combine> {
        Box::new(Weigher {
            parameters: self.clone(),
            errors: Errors::new(voters, self.memory),
        })
    }
}

/// Weighs votes by the errors in memory.
struct Weigher {
    parameters: AutoWeighted,
    errors: Errors,
}

impl Weigher {
    /// The mean squares of the voters that are there and known.
    fn known<'a>(&'a self, votes: Votes<'a>) -> impl Iterator<Item = f64> + 'a {
        votes
            .present()
            .filter_map(|(voter, _)| self.errors.means()[voter])
    }

    /// Gives each vote that is there its weight, not yet normalised; whether any of the voters is known.
    fn weigh(&self, votes: Votes<'_>, mut give: impl FnMut(usize, f64, f64)) -> bool {
        let (power, form) = (self.parameters.power, self.parameters.weights);
        // Relative to the best voter, so that nothing over- or underflows; an error of exactly zero counts as the smallest
        // number there is.
        let best = self
            .known(votes)
            .fold(f64::INFINITY, f64::min)
            .max(f64::MIN_POSITIVE);
        let total: f64 = match form {
            Weighting::InversePower => 0.0,
            Weighting::AsPrinted | Weighting::AsPrintedRaw => {
                self.known(votes).map(f64::sqrt).sum()
            }
        };
        let weight = |mean_square: f64| match form {
            Weighting::InversePower => {
                let ratio = best / mean_square.max(f64::MIN_POSITIVE);
                if power == 2.0 {
                    ratio
                } else {
                    ratio.powf(0.5 * power)
                }
            }
            Weighting::AsPrinted | Weighting::AsPrintedRaw if total > 0.0 => {
                mean_square / (total * total)
            }
            Weighting::AsPrinted | Weighting::AsPrintedRaw => 1.0,
        };
        let (sum, count) = self.known(votes).fold((0.0, 0.0), |(sum, count), known| {
            (sum + weight(known), count + 1.0)
        });
        let of_unknown = if count > 0.0 { sum / count } else { 1.0 };
        for (voter, vote) in votes.present() {
            give(
                voter,
                vote,
                self.errors.means()[voter].map_or(of_unknown, weight),
            );
        }
        count > 0.0
    }

    /// Whether weights stay as they are rather than add up to one.
    fn is_raw(&self, any_known: bool) -> bool {
        self.parameters.weights == Weighting::AsPrintedRaw && any_known
    }
}

impl Combine for Weigher {
    fn combine(&self, votes: Votes<'_>) -> f64 {
        let (mut weighted, mut weights) = (0.0, 0.0);
        let any_known = self.weigh(votes, |_, vote, weight| {
            weighted += weight * vote;
            weights += weight;
        });
        if weights == 0.0 {
            f64::NAN
        } else if self.is_raw(any_known) {
            weighted
        } else {
            weighted / weights
        }
    }

    fn weights(&self, votes: Votes<'_>, weights: &mut [f64]) {
        let mut sum = 0.0;
        let any_known = self.weigh(votes, |voter, _, weight| {
            weights[voter] = weight;
            sum += weight;
        });
        if !self.is_raw(any_known) {
            weights.iter_mut().for_each(|weight| *weight /= sum);
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

athermal_core::register!(AutoWeighted, Combiner, "auto_weighted");
