//! Decides how orders are given to inputs: one for all, or one for each.

use athermal_core::node::Forms;
use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize};

/// An order of all inputs, or a list with one for each, in the order of the features.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum PerInput {
    /// A number for all.
    All(#[schemars(range(min = 0, max = 100))] usize),
    /// A list with one for each.
    Each(#[schemars(inner(range(min = 0, max = 100)))] Vec<usize>),
}

impl PerInput {
    /// One of each.
    pub(crate) fn one() -> Self {
        Self::All(1)
    }

    /// None of any.
    pub(crate) fn none() -> Self {
        Self::All(0)
    }

    /// That of one input.
    pub(super) fn of(&self, nth: usize) -> usize {
        match self {
            Self::All(order) => *order,
            Self::Each(orders) => orders.get(nth).copied().unwrap_or(0),
        }
    }
}

impl<'de> Deserialize<'de> for PerInput {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Forms::new("a whole number, or a list with one for each feature")
            .whole(Self::All)
            .list(Self::Each)
            .read(deserializer)
    }
}
