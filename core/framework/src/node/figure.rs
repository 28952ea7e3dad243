//! Decides the forms in which a fit tells programs what it found, by name; which figures there are is each kind's.

use std::collections::BTreeMap;

use indexmap::IndexMap;
use serde::{Deserialize, Serialize};

use crate::node::number::Exact;
use crate::node::numbers;

/// What a fit found, by name.
pub type Figures = BTreeMap<String, Figure>;

/// Something that a fit found, for programs: the sentences for people are made from the same values, and rounded.
///
/// In JSON it is a truth value, a number, a list, or a table of numbers by name; numbers that are not finite are texts, as
/// everywhere in a model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Figure {
    /// Whether something is so.
    Flag(bool),
    /// How many there are of something.
    Count(u64),
    /// A number; its unit belongs to its name.
    Number(Exact),
    /// Several of a kind, in their order.
    Numbers(#[serde(with = "numbers")] Vec<f64>),
    /// Names of what something is said of, such as regressors.
    Names(Vec<String>),
    /// A number for each of several names, such as voters.
    Named(IndexMap<String, Exact>),
}

impl Figure {
    /// A number for each of several names; of a name that comes again the last one counts.
    pub fn named<Name: Into<String>>(each: impl IntoIterator<Item = (Name, f64)>) -> Self {
        let each = each.into_iter();
        Self::Named(
            each.map(|(name, value)| (name.into(), Exact(value)))
                .collect(),
        )
    }

    /// Names of what something is said of.
    pub fn names<Name: Into<String>>(names: impl IntoIterator<Item = Name>) -> Self {
        Self::Names(names.into_iter().map(Into::into).collect())
    }
}

impl From<bool> for Figure {
    fn from(flag: bool) -> Self {
        Self::Flag(flag)
    }
}

impl From<u64> for Figure {
    fn from(count: u64) -> Self {
        Self::Count(count)
    }
}

impl From<usize> for Figure {
    fn from(count: usize) -> Self {
        Self::Count(count as u64)
    }
}

impl From<f64> for Figure {
    fn from(value: f64) -> Self {
        Self::Number(Exact(value))
    }
}

impl From<&[f64]> for Figure {
    fn from(values: &[f64]) -> Self {
        Self::Numbers(values.to_vec())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_stand_in_json_as_what_they_are_and_are_read_back() {
        let figures = Figures::from([
            ("converged".to_owned(), Figure::from(false)),
            ("outliers".to_owned(), Figure::from(3_usize)),
            ("scale".to_owned(), Figure::from(3.0)),
            ("returns_s".to_owned(), Figure::from(f64::INFINITY)),
            (
                "singular_values".to_owned(),
                Figure::from(&[0.1 + 0.2, 1.0][..]),
            ),
            ("constant".to_owned(), Figure::names(["x.stays"])),
            (
                "weights".to_owned(),
                Figure::named([("b", 0.25), ("a", f64::NAN)]),
            ),
        ]);
        let text = serde_json::to_string(&figures).unwrap();
        assert_eq!(
            text,
            concat!(
                r#"{"constant":["x.stays"],"converged":false,"outliers":3,"returns_s":"inf","scale":3.0,"#,
                r#""singular_values":[0.30000000000000004,1.0],"weights":{"b":0.25,"a":"NaN"}}"#
            )
        );
        let back: Figures = serde_json::from_str(&text).unwrap();
        assert_eq!(serde_json::to_string(&back).unwrap(), text);
        assert_eq!(back["scale"], Figure::from(3.0));
        assert_eq!(back["constant"], Figure::names(["x.stays"]));
    }
}
