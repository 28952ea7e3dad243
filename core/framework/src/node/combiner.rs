//! Decides what the author of a combiner implements: one prediction from several.

use std::fmt::Debug;

use super::{InputPort, Kept, KindFacts, Mistake, Restored, State};
use crate::time::{Duration, Instant};

/// A node that makes one prediction of several for the same instant.
///
/// The framework holds votes and their ages, and hands over truths only when the embargo lets them through. The ports are
/// `voters`, `truth` where the combiner learns from errors, and `state` where it goes by one. A whole combiner, the median of the votes at hand:
///
/// ```
/// use athermal_core::node::prelude::*;
///
/// /// The median of the votes.
/// #[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
/// #[serde(deny_unknown_fields)]
/// pub struct Middle {}
///
/// impl Combiner for Middle {
///     fn inputs() -> &'static [InputPort] {
///         const { &[InputPort::held("voters", "predictions of the same truth")] }
///     }
///
///     fn build(&self, _voters: usize) -> Box<dyn Combine> {
///         Box::new(Median)
///     }
/// }
///
/// struct Median;
///
/// impl Combine for Median {
///     fn combine(&self, votes: Votes<'_>) -> f64 {
///         let below = |v: f64| votes.present().filter(|&(_, w)| w < v).count();
///         let count = votes.present().count();
///         let middle = votes.present().find(|&(_, v)| below(v) <= count / 2 && count / 2 < below(v) + 1);
///         middle.map_or(f64::NAN, |(_, v)| v)
///     }
/// }
///
/// athermal_core::register!(Middle, Combiner, "middle");
/// # fn main() {}
/// ```
#[diagnostic::on_unimplemented(
    message = "`{Self}` is no combiner",
    label = "implement `athermal_core::node::Combiner` for it, or register it in the role that it has"
)]
pub trait Combiner: Debug + Send + Sync {
    /// The input ports: `voters`, `truth` where it learns, and `state` where it goes by one.
    fn inputs() -> &'static [InputPort]
    where
        Self: Sized;

    /// What reports ask of the kind.
    fn facts() -> KindFacts
    where
        Self: Sized,
    {
        KindFacts::default()
    }

    /// Mistakes between parameters. The compiler has checked the ranges of the schema.
    fn mistakes(&self) -> Vec<Mistake> {
        Vec::new()
    }

    /// Whether its answer is a sum of votes by weights, which the port `weights` then shows. Where all voters tell their
    /// standard deviation, the port `std_dev` combines them by these weights: `√Σ w_i (σ_i² + (ŷ_i − ŷ)²)`.
    fn has_weights(&self) -> bool {
        false
    }

    /// Whether it gives a reason for what it does: a number, which the port `reason` shows.
    fn has_reason(&self) -> bool {
        false
    }

    /// Whether it goes by how far the regressors of each voter are outside of those of its fit: see [`Combine::heed`].
    fn heeds_novelty(&self) -> bool {
        false
    }

    /// The share of truths that its intervals are to cover, for kinds that give intervals: the ports `lower` and `upper`.
    fn coverage(&self) -> Option<f64> {
        None
    }

    /// How long what was learned counts; the engine keeps so much of the past for warming up.
    fn memory(&self) -> Duration {
        Duration::ZERO
    }

    /// What it keeps of the past in memory, where truths come each `every`: see [`Feature::keeps`](super::Feature::keeps). By default that is a
    /// number and an instant of each voter, for as long as [`memory`](Self::memory).
    fn keeps(&self, voters: usize, every: Duration) -> Vec<Kept> {
        Kept::past(self.memory(), every, 16 * voters)
    }

    /// Whether what was learned counts for ever, or for so many truths however long they take to come, so that no length of the past
    /// brings it back: [`memory`](Self::memory) is then what warms it best.
    fn is_endless(&self) -> bool {
        false
    }

    /// What runs, for this many voters.
    fn build(&self, voters: usize) -> Box<dyn Combine>;
}

/// A running combiner.
pub trait Combine: Send {
    /// The combined prediction; NaN where none can be given.
    fn combine(&self, votes: Votes<'_>) -> f64;

    /// The weights by which these votes would be combined, for kinds that weigh; NaN for a vote that is not there.
    fn weights(&self, _votes: Votes<'_>, _weights: &mut [f64]) {}

    /// Both ends of the interval about the combination of these votes, for kinds that give intervals; NaN where there is none.
    fn interval(&self, _votes: Votes<'_>) -> [f64; 2] {
        [f64::NAN; 2]
    }

    /// What must be known of an interval that is given now when its truth comes, beside its ends: no NaN.
    fn extent(&self) -> f64 {
        0.0
    }

    /// A truth, both ends of the interval that was given for it, and what [`extent`](Combine::extent) said then, for kinds that give
    /// intervals: called before [`observe`](Combine::observe).
    fn judge(&mut self, _interval: [f64; 2], _extent: f64, _truth: f64) {}

    /// Why these votes are combined as they are, for kinds that give reasons; the kind's documentation says what each
    /// number means.
    fn reason(&self, _votes: Votes<'_>) -> f64 {
        f64::NAN
    }

    /// Called before [`combine`](Combine::combine), for kinds with an input `state`: its value, NaN where there is none.
    fn state(&mut self, _now: Instant, _state: f64) {}

    /// Called before [`combine`](Combine::combine), for kinds that [heed](Combiner::heeds_novelty) it: how far the regressors of
    /// each voter are outside of those of its fit, 1 at the edge; NaN where that is not known.
    fn heed(&mut self, _novelty: &[f64]) {}

    /// A truth and the votes that were cast for it. `arrived` is when the truth was measured.
    fn observe(&mut self, _votes: Votes<'_>, _truth: f64, _arrived: Instant) {}

    /// Called before [`combine`](Combine::combine): truths up to `newest` have been handed over, none later will count.
    fn advance(&mut self, _newest: Instant) {}

    /// The next tick belongs to another segment of the data, whose clock is `shift` ahead of a seamless continuation.
    ///
    /// What was learned stays; instants that are kept move by `shift`.
    fn segment(&mut self, _shift: Duration) {}

    /// How many truths it goes by at present, and how many it takes to do what it is for; none for a combiner that does it
    /// without any. `athermal evaluate` tells of one that hardly ever has enough.
    fn evidence(&self) -> Option<Evidence> {
        None
    }

    /// All that was learned; none for a combiner that learns nothing.
    fn snapshot(&self) -> Option<Box<dyn State>> {
        None
    }

    /// Goes on from what a combiner of this kind learned of the same voters, maybe with other parameters or in an older form.
    fn restore(&mut self, _state: Box<dyn State>) -> Restored {
        Restored::cold("the combiner learns nothing")
    }
}

/// How many truths a combiner goes by.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Evidence {
    /// The truths that count at present.
    pub truths: f64,
    /// How many it takes.
    pub needed: f64,
    /// What lets more of them count, as the beginning of a sentence: "a longer `memory`".
    pub remedy: &'static str,
}

/// The votes for one instant, in the order of the `voters` port; NaN where a voter has none.
#[derive(Debug, Clone, Copy)]
pub struct Votes<'a>(pub &'a [f64]);

impl<'a> Votes<'a> {
    /// The votes that are there, each with its voter's index.
    pub fn present(self) -> impl Iterator<Item = (usize, f64)> + Clone + 'a {
        self.0
            .iter()
            .copied()
            .enumerate()
            .filter(|(_, vote)| !vote.is_nan())
    }
}
