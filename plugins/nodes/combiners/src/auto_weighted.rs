//! The vote that weighs each estimator by its recent error.

use std::cell::{RefCell, RefMut};

use athermal_core::node::{Combine, Combiner, InputPort, Kept, Mistake, Votes};
use athermal_core::time::Duration;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::errors::{ByErrors, Errors, Rule};
use crate::memory::Memory;
use crate::share::{raise, shrink};

/// Auto-weighted voting: each voter counts by its recent root mean square error.
///
/// `ŷ = Σ w_i ŷ_i` with `w_i ∝ RMSE_i^(−power)`, normalised, over the truths that the embargo let through within `memory`:
/// only those count whose window does not overlap the predicted one. A voter without errors in memory takes the mean weight of the
/// others that are there; if none of these has any, all weights are equal. A voter without a prediction drops out and the rest are
/// renormalised, so that the vote goes on when a sensor dies. The port `weights` shows them.
///
/// Recent errors are few and rank the voters only roughly. So `shrinkage` draws the weights towards equal ones (after
/// Stock and Watson 2004): `(1 − shrinkage) · w_i + shrinkage / n` of `n` voters that are there. Then `floor` lifts
/// every weight to at least that much, at the cost of the larger ones.
///
/// A voter that steps outside of its fit loses its vote at once: where its `novelty` is above 1, its weight is
/// divided by the square of that. The port `novelty` is the mean of the voters' by their weights.
///
/// Where all voters have a standard deviation, the port `std_dev` is that of their mixture,
/// `√Σ w_i (σ_i² + (ŷ_i − ŷ)²)` (Hoeting, Madigan, Raftery and Volinsky 1999). It is rather too large than too small,
/// since it takes one of the voters to be right.
///
/// After Mandelli, Dankwart and Napoli, section 3.4, whose printed formula `(RMSE_i / Σ RMSE_j)²` favours the worst voter;
/// it is there for comparison.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AutoWeighted {
    /// How long an error is remembered, counted from when the embargo lets its truth through: `"15min"` or `{ truths = 12 }`.
    /// With `{ half_life = "15min" }` it counts ever less, and not at all after ten half-lives: a voter without a newer one has none.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub memory: Memory,
    /// How strongly errors count: 0 not at all, 2, which is the default, as inverse variances do; at most 16.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 16.0))]
    pub power: Option<f64>,
    /// How errors become weights.
    #[serde(default)]
    pub weights: Weighting,
    /// How far the weights are drawn towards equal ones: 0 not at all, 1 all the way.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub shrinkage: f64,
    /// The least weight of a voter that is there, 0 to 1; where that is more than an equal share, all weights are equal.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub floor: f64,
}

/// The power where none is stated.
const INVERSE_VARIANCE: f64 = 2.0;

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
        if self.power.is_some() && self.weights != Weighting::InversePower {
            let message = "`power` is for weights by inverse powers of errors";
            let help = "leave it out, or use `weights = \"inverse_power\"`";
            let mistake = Mistake::at("power", message).help(help);
            mistakes.push(mistake);
        }
        for (name, value) in [("shrinkage", self.shrinkage), ("floor", self.floor)] {
            if value > 0.0 && self.weights == Weighting::AsPrintedRaw {
                let message = format!("`{name}` is for weights that add up to 1");
                let help = "leave it out, or use `weights = \"as_printed\"`";
                let mistake = Mistake::at(name, message).help(help);
                mistakes.push(mistake);
            }
        }
        mistakes
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
        let weigher = Weigher {
            parameters: self.clone(),
            last: RefCell::new(Weighed::new(voters)),
        };
        Box::new(ByErrors::new(weigher, voters, self.memory))
    }
}

/// Weighs votes by the errors in memory.
struct Weigher {
    parameters: AutoWeighted,
    last: RefCell<Weighed>,
}

/// The weights of votes, which are the same until a truth comes or another vote drops out.
struct Weighed {
    /// Of each vote; NaN where there was none.
    weights: Vec<f64>,
    /// What they are to be divided by.
    total: f64,
    /// Which errors they follow from.
    changes: Option<u64>,
}

impl Weighed {
    fn new(voters: usize) -> Self {
        Self {
            weights: vec![f64::NAN; voters],
            total: f64::NAN,
            changes: None,
        }
    }

    fn is_of(&self, errors: &Errors, votes: Votes<'_>) -> bool {
        let mut both = self.weights.iter().zip(votes.0);
        self.changes == Some(errors.changes())
            && both.all(|(weight, vote)| weight.is_nan() == vote.is_nan())
    }
}

/// The mean squares of the voters that are there and known.
fn known<'a>(errors: &'a Errors, votes: Votes<'a>) -> impl Iterator<Item = f64> + 'a {
    votes
        .present()
        .filter_map(|(voter, _)| errors.means()[voter])
}

impl Weigher {
    /// The weights of these votes, worked out anew where they are not those of the last.
    fn weighed(&self, errors: &Errors, votes: Votes<'_>) -> RefMut<'_, Weighed> {
        let mut last = self.last.borrow_mut();
        if !last.is_of(errors, votes) {
            let Weighed {
                weights,
                total,
                changes,
            } = &mut *last;
            weights.fill(f64::NAN);
            *total = self.weigh(errors, votes, weights);
            *changes = Some(errors.changes());
            if let Some(trust) = errors.trust()
                && self.parameters.weights != Weighting::AsPrintedRaw
            {
                votes
                    .present()
                    .for_each(|(voter, _)| weights[voter] *= trust[voter]);
                *total = votes.present().map(|(voter, _)| weights[voter]).sum();
            }
        }
        last
    }

    /// Gives each vote that is there its weight; what they are to be divided by.
    fn weigh(&self, errors: &Errors, votes: Votes<'_>, weights: &mut [f64]) -> f64 {
        let power = self.parameters.power.unwrap_or(INVERSE_VARIANCE);
        let form = self.parameters.weights;
        // Relative to the best voter, so that nothing over- or underflows; an error of exactly zero counts as the smallest
        // number there is.
        let best = known(errors, votes)
            .fold(f64::INFINITY, f64::min)
            .max(f64::MIN_POSITIVE);
        let roots: f64 = match form {
            Weighting::InversePower => 0.0,
            Weighting::AsPrinted | Weighting::AsPrintedRaw => {
                known(errors, votes).map(f64::sqrt).sum()
            }
        };
        let weight = |mean_square: f64| match form {
            Weighting::InversePower => {
                let ratio = best / mean_square.max(f64::MIN_POSITIVE);
                if power == 2.0 {
                    ratio
                } else {
                    libm::pow(ratio, 0.5 * power)
                }
            }
            Weighting::AsPrinted | Weighting::AsPrintedRaw if roots > 0.0 => {
                mean_square / (roots * roots)
            }
            // As it is where all errors are the same, however small.
            Weighting::AsPrinted | Weighting::AsPrintedRaw => {
                (known(errors, votes).count() as f64).powi(-2)
            }
        };
        let (mut total, mut count, mut present) = (0.0, 0.0, 0.0);
        for (voter, _) in votes.present() {
            present += 1.0;
            if let Some(known) = errors.means()[voter] {
                weights[voter] = weight(known);
                total += weights[voter];
                count += 1.0;
            }
        }
        if count < present {
            let of_unknown = if count > 0.0 { total / count } else { 1.0 };
            total = 0.0;
            for (voter, _) in votes.present() {
                if errors.means()[voter].is_none() {
                    weights[voter] = of_unknown;
                }
                total += weights[voter];
            }
        }
        let AutoWeighted {
            shrinkage, floor, ..
        } = self.parameters;
        if form == Weighting::AsPrintedRaw && count > 0.0 {
            return 1.0;
        }
        if shrinkage > 0.0 || floor > 0.0 {
            shrink(weights, votes, shrinkage);
            raise(weights, votes, floor);
            return 1.0;
        }
        total
    }
}

impl Rule for Weigher {
    fn combine(&self, errors: &Errors, votes: Votes<'_>) -> f64 {
        let last = self.weighed(errors, votes);
        let (mut sum, mut any) = (0.0, false);
        for (weight, vote) in last.weights.iter().zip(votes.0) {
            if !vote.is_nan() {
                sum += weight * vote;
                any = true;
            }
        }
        if any && last.total != 0.0 {
            sum / last.total
        } else {
            f64::NAN
        }
    }

    fn weights(&self, errors: &Errors, votes: Votes<'_>, weights: &mut [f64]) {
        let last = self.weighed(errors, votes);
        for (voter, _) in votes.present() {
            weights[voter] = last.weights[voter] / last.total;
        }
    }
}

athermal_core::register!(AutoWeighted, Combiner, "auto_weighted");
