//! Decides what a graph may say of training.

use athermal_core::node::Mistake;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How a network is trained: with Adam, on batches in random order, until a later part of the rows is predicted no better.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Training {
    /// How often all rows are gone through at most; 1 to 10,000.
    #[schemars(range(min = 1, max = 10_000))]
    pub epochs: usize,
    /// After how many epochs without a better prediction of the later rows training stops; 1 to 10,000.
    #[schemars(range(min = 1, max = 10_000))]
    pub patience: usize,
    /// How many rows make up a batch; 1 to 4096.
    #[schemars(range(min = 1, max = 4096))]
    pub batch: usize,
    /// The length of a step of Adam, above 0 and at most 1.
    #[schemars(range(max = 1.0), extend("exclusiveMinimum" = 0.0))]
    pub rate: f64,
    /// The share of the rows, the latest, that are only predicted, to know when to stop; above 0 and below 1.
    #[schemars(extend("exclusiveMinimum" = 0.0, "exclusiveMaximum" = 1.0))]
    pub validation: f64,
    /// Where the random numbers begin: of the first weights, and of the order of rows.
    pub seed: u64,
}

impl Default for Training {
    fn default() -> Self {
        Self {
            epochs: 40,
            patience: 5,
            batch: 64,
            rate: 5e-3,
            validation: 0.2,
            seed: 1,
        }
    }
}

impl Training {
    /// What is out of range, at a parameter called `training`.
    pub(crate) fn mistakes(&self) -> Vec<Mistake> {
        let mut mistakes = Vec::new();
        for (name, value, most) in [
            ("epochs", self.epochs, 10_000),
            ("patience", self.patience, 10_000),
            ("batch", self.batch, 4096),
        ] {
            if !(1..=most).contains(&value) {
                let message = format!("`{name}` is {value} and must be from 1 to {most}");
                mistakes.push(Mistake::at(format!("training.{name}"), message));
            }
        }
        // Written so that NaN fails too.
        if !(self.rate > 0.0 && self.rate <= 1.0) {
            let message = format!("`rate` is {} and must be above 0 and at most 1", self.rate);
            mistakes.push(Mistake::at("training.rate", message).help("1e-3 to 1e-2 is usual"));
        }
        if !(self.validation > 0.0 && self.validation < 1.0) {
            let found = self.validation;
            let message = format!("`validation` is {found} and must be above 0 and below 1");
            mistakes.push(Mistake::at("training.validation", message).help("0.2 is usual"));
        }
        mistakes
    }
}
