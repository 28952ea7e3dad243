//! Exponential weights with a bound on what is lost to the best voter.

use std::cell::RefCell;

use athermal_core::node::{Combine, Combiner, InputPort, Restored, State, Votes};
use athermal_core::time::{Duration, Instant};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::memory::Fading;
use crate::share::{raise, trust};

/// Exponential weights: a vote that loses little to the best voter in hindsight, whatever comes.
///
/// `ŷ = Σ w_i ŷ_i` with `w_i ∝ exp(−η L_i)`, where `L_i` is the sum of the squared errors of a voter (Freund and Schapire 1997). Where
/// `auto_weighted` follows the last quarter of an hour, `hedge` goes by all that it has seen, and soon gives most weight to the voter that
/// is best over all.
///
/// Without `rate` the rate is found on the way: `η = ln n / Δ` (AdaHedge: de Rooij, van Erven, Grünwald and Koolen
/// 2014). `Δ` is the sum of what the weighted mean of the errors has lost to `−ln(Σ w_i exp(−η ℓ_i)) / η`. It needs
/// no scale: errors in nm or in mm give the same weights. After `T` truths the squared errors of the vote add up to
/// no more than those of the best of `n` voters and `2 √(V ln n) + S (4/3 ln n + 2)`. `S` is the largest difference
/// between squared errors at any one truth. `V`, at most `T S² / 4`, sums up their variance under the weights (their
/// theorem 6). That holds where each truth is known before the next vote; a horizon or embargo that holds back `d`
/// truths multiplies it by about `d + 1` (Joulani, György and Szepesvári 2013).
///
/// With `rate`, `η = rate / S`: errors are scaled by their own size so far, and the bound is `S ln n / rate + rate · T S / 8` once that has shown
/// (Cesa-Bianchi and Lugosi 2006, theorem 2.2).
///
/// One wild truth sets the scale of errors: what follows hardly counts beside it, until `half_life` forgets it. So screen truths, such as by
/// `hampel`. A truth from which a vote lies so far that the square of its error is beyond all numbers, some 1e154, is passed over.
///
/// A voter without a prediction drops out, the rest are renormalised, and what it is owed neither grows nor shrinks while it is away (Freund, Schapire,
/// Singer and Warmuth 1997). Before the first truth all weights are equal. The port `weights` shows them.
/// A voter that steps outside of its fit loses its vote at once, as in `auto_weighted`; what it is owed stays.
/// Where all voters have a standard deviation, the port `std_dev` is that of their mixture, as of `auto_weighted`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Hedge {
    /// How fast weights follow errors that are scaled by their own size, above 0, up to 100; without it, the rate is found on the way.
    #[serde(default)]
    #[schemars(range(max = 100.0), extend("exclusiveMinimum" = 0.0))]
    pub rate: Option<f64>,
    /// The time after which an error counts half, for voters that take turns at being best; without it nothing is forgotten, and
    /// only then do the bounds hold.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub half_life: Option<Duration>,
    /// The least weight of a voter that is there, 0 to 1, so that one that was bad can come back quickly. Where that is more than an equal
    /// share, all weights are equal.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub floor: f64,
}

impl Combiner for Hedge {
    fn inputs() -> &'static [InputPort] {
        const {
            &[
                InputPort::held("voters", "predictions of the same truth"),
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
        let half_life = self.half_life.unwrap_or_default();
        Fading { half_life }.longest()
    }

    fn is_endless(&self) -> bool {
        self.half_life.is_none()
    }

    fn build(&self, voters: usize) -> Box<dyn Combine> {
        Box::new(Hedging {
            parameters: self.clone(),
            losses: Losses {
                sums: vec![0.0; voters],
                gap: 0.0,
                widest: 0.0,
                last: None,
            },
            trust: vec![1.0; voters],
            room: RefCell::new(vec![0.0; voters]),
        })
    }
}

struct Hedging {
    parameters: Hedge,
    losses: Losses,
    /// What each voter counts by its novelty.
    trust: Vec<f64>,
    /// Room for the weights.
    room: RefCell<Vec<f64>>,
}

/// What the voters have lost: the state of the vote.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Losses {
    /// For each voter the sum of its squared errors, less that of the best.
    sums: Vec<f64>,
    /// `Δ`: what the weighted means of the losses have lost to the logarithmic ones.
    gap: f64,
    /// `S`: the largest difference between the losses of voters at one truth.
    widest: f64,
    /// When the last truth arrived.
    last: Option<Instant>,
}

impl Hedging {
    /// The rate; infinite while voters that are not the best deserve nothing.
    fn rate(&self) -> f64 {
        let Losses { gap, widest, .. } = self.losses;
        match self.parameters.rate {
            Some(rate) => rate / widest,
            None => libm::log(self.losses.sums.len() as f64) / gap,
        }
    }

    /// Weighs the votes that are there, without the floor: at one rate, and relative to the best, so that nothing underflows for all.
    fn weigh(&self, votes: Votes<'_>, rate: f64, weights: &mut [f64]) {
        let sums = &self.losses.sums;
        let best = votes.present().map(|(voter, _)| sums[voter]);
        let best = best.fold(f64::INFINITY, f64::min);
        let mut total = 0.0;
        for (voter, _) in votes.present() {
            weights[voter] = match sums[voter] - best {
                0.0 => 1.0,
                behind => libm::exp(-rate * behind),
            };
            total += weights[voter];
        }
        for (voter, _) in votes.present() {
            weights[voter] /= total;
        }
    }

    /// The weights of these votes, with the floor and by their novelty.
    fn share(&self, votes: Votes<'_>, weights: &mut [f64]) {
        self.weigh(votes, self.rate(), weights);
        raise(weights, votes, self.parameters.floor);
        if self.trust.iter().any(|&trust| trust != 1.0) {
            votes
                .present()
                .for_each(|(voter, _)| weights[voter] *= self.trust[voter]);
            let total: f64 = votes.present().map(|(voter, _)| weights[voter]).sum();
            votes
                .present()
                .for_each(|(voter, _)| weights[voter] /= total);
        }
    }

    /// Adds losses, absent voters at what the vote of the others lost.
    fn lose(&mut self, votes: Votes<'_>, truth: f64) {
        let loss = |vote: f64| (vote - truth) * (vote - truth);
        let (least, most) = votes.present().fold(
            (f64::INFINITY, f64::NEG_INFINITY),
            |(least, most), (_, vote)| (least.min(loss(vote)), most.max(loss(vote))),
        );
        // No vote was there, or one so wild that its square is beyond all numbers.
        if !(most - least).is_finite() {
            return;
        }
        self.losses.widest = self.losses.widest.max(most - least);
        let rate = self.rate();
        let weights = &mut *self.room.borrow_mut();
        self.weigh(votes, rate, weights);
        let mean: f64 = votes
            .present()
            .map(|(voter, vote)| weights[voter] * (loss(vote) - least))
            .sum();
        let sums = &self.losses.sums;
        let before = mix(votes.present().map(|(voter, _)| sums[voter]), rate);
        let lost = |(voter, vote)| sums[voter] + (loss(vote) - least);
        let after = mix(votes.present().map(lost), rate);
        // What is lost by no voter is not lost by their mixture, however the logarithms round.
        let mixed = (after - before).max(0.0);
        self.losses.gap += (mean - mixed).max(0.0);
        let sums = &mut self.losses.sums;
        for (sum, vote) in sums.iter_mut().zip(votes.0) {
            *sum += if vote.is_nan() {
                mixed
            } else {
                loss(*vote) - least
            };
        }
        let best = sums.iter().copied().fold(f64::INFINITY, f64::min);
        sums.iter_mut().for_each(|sum| *sum -= best);
    }
}

/// `−ln(Σ exp(−rate · sum)) / rate` of at least one sum, taken relative to the least, so that not all terms underflow; with an
/// infinite rate the least.
fn mix(sums: impl Iterator<Item = f64> + Clone, rate: f64) -> f64 {
    let least = sums.clone().fold(f64::INFINITY, f64::min);
    let terms = sums.map(|sum| match sum - least {
        0.0 => 1.0,
        behind => libm::exp(-rate * behind),
    });
    least - libm::log(terms.sum::<f64>()) / rate
}

impl Losses {
    fn is_sound(&self) -> bool {
        let mut all = self.sums.iter().chain([&self.gap, &self.widest]);
        all.all(|value| value.is_finite() && *value >= 0.0)
    }
}

impl Combine for Hedging {
    fn combine(&self, votes: Votes<'_>) -> f64 {
        if votes.present().next().is_none() {
            return f64::NAN;
        }
        let weights = &mut *self.room.borrow_mut();
        self.share(votes, weights);
        let terms = votes.present().map(|(voter, vote)| weights[voter] * vote);
        terms.sum()
    }

    fn weights(&self, votes: Votes<'_>, weights: &mut [f64]) {
        self.share(votes, weights);
    }

    fn heed(&mut self, novelty: &[f64]) {
        for (trusted, &novelty) in self.trust.iter_mut().zip(novelty) {
            *trusted = trust(novelty);
        }
    }

    fn observe(&mut self, votes: Votes<'_>, truth: f64, arrived: Instant) {
        if let (Some(half_life), Some(last)) = (self.parameters.half_life, self.losses.last) {
            let left = Fading { half_life }.left(arrived - last);
            self.losses.gap *= left;
            self.losses.widest *= left;
            self.losses.sums.iter_mut().for_each(|sum| *sum *= left);
        }
        self.losses.last = Some(arrived);
        self.lose(votes, truth);
    }

    fn segment(&mut self, shift: Duration) {
        self.losses.last = self.losses.last.map(|last| last + shift);
    }

    fn snapshot(&self) -> Option<Box<dyn State>> {
        Some(Box::new(self.losses.clone()))
    }

    fn restore(&mut self, state: Box<dyn State>) -> Restored {
        state.accept(|losses: Losses| {
            if losses.sums.len() != self.losses.sums.len() {
                return Err("the number of voters differs");
            }
            if !losses.is_sound() {
                return Err("its losses are not all numbers from 0 on");
            }
            self.losses = losses;
            Ok(())
        })
    }
}

athermal_core::state!(Losses, "hedge/1");
athermal_core::register!(Hedge, Combiner, "hedge");
