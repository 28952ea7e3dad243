//! Why nothing of a prediction is scored.

use serde::Serialize;

use super::watch::{Prediction, Truth};
use crate::compile::Plan;
use crate::engine::Engine;

/// A prediction of which nothing is scored, with what there was of all that a score takes.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Unscored {
    /// The channel: `vote.Z1`.
    pub output: String,
    /// What it predicts.
    pub truth: String,
    /// Its horizon in seconds.
    pub ahead_s: f64,
    /// Ticks stepped.
    pub ticks: u64,
    /// How many truths there were.
    pub truths: usize,
    /// How many of them are within the limit, where there is one.
    pub within_limit: usize,
    /// At how many ticks it predicted something.
    pub predictions: u64,
    /// How many of the truths within the limit it predicted.
    pub pairs: usize,
    /// Where there was no truth or no prediction, the first of what that is made of that lacks a value.
    pub first_silent: Option<String>,
}

impl Unscored {
    /// `pairs` are those with the truths within the limit, of which there are so many.
    pub(super) fn of(
        plan: &Plan,
        engine: &Engine,
        ticks: u64,
        truth: &Truth,
        prediction: &Prediction,
        (within_limit, pairs): (usize, usize),
    ) -> Self {
        let silent = match (truth.values.is_empty(), prediction.given) {
            (true, _) => Some(truth.slot),
            (false, 0) => Some(prediction.slot),
            (false, _) => None,
        };
        Self {
            output: plan.channels[prediction.slot].name.clone(),
            truth: plan.channels[truth.slot].name.clone(),
            ahead_s: prediction.ahead.secs(),
            ticks,
            truths: truth.values.len(),
            within_limit,
            predictions: prediction.given,
            pairs,
            first_silent: silent.map(|slot| engine.first_silent(slot)),
        }
    }
}
