//! Decides how a number that may be missing stands in a model. For `#[serde(with = …)]`.

use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::number::Exact;

/// Writes a number as [`super::number`] does, or null.
///
/// # Errors
/// As the serialiser.
pub fn serialize<S: Serializer>(value: &Option<f64>, serializer: S) -> Result<S::Ok, S::Error> {
    value.map(Exact).serialize(serializer)
}

/// Reads it back.
///
/// # Errors
/// When there is neither a number nor null.
pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<f64>, D::Error> {
    Ok(Option::<Exact>::deserialize(deserializer)?.map(|exact| exact.0))
}
