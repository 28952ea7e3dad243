//! Decides how orders are given to inputs: one for all, or one for each.

use std::fmt;

use schemars::JsonSchema;
use serde::de::{SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};

/// An order of all inputs, or a list with one for each, in the order of the features.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum PerInput {
    /// Of all.
    All(#[schemars(range(min = 0, max = 100))] usize),
    /// Of each.
    Each(Vec<usize>),
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

    pub(super) fn each(&self) -> impl Iterator<Item = usize> + '_ {
        let (one, list) = match self {
            Self::All(order) => (Some(*order), &[][..]),
            Self::Each(orders) => (None, &orders[..]),
        };
        one.into_iter().chain(list.iter().copied())
    }
}

// Not derived, since an untagged enum forgets what was wrong with either form.
impl<'de> Deserialize<'de> for PerInput {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Form;
        impl<'de> Visitor<'de> for Form {
            type Value = PerInput;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a whole number, or a list with one for each feature")
            }

            fn visit_u64<E: serde::de::Error>(self, order: u64) -> Result<PerInput, E> {
                Ok(PerInput::All(usize::try_from(order).unwrap_or(usize::MAX)))
            }

            fn visit_i64<E: serde::de::Error>(self, order: i64) -> Result<PerInput, E> {
                let whole = usize::try_from(order);
                let unexpected = serde::de::Unexpected::Signed(order);
                whole
                    .map(PerInput::All)
                    .map_err(|_| E::invalid_value(unexpected, &self))
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut orders: A) -> Result<PerInput, A::Error> {
                let mut each = Vec::new();
                while let Some(order) = orders.next_element()? {
                    each.push(order);
                }
                Ok(PerInput::Each(each))
            }
        }
        deserializer.deserialize_any(Form)
    }
}
