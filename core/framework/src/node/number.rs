//! Decides how a number stands in a model: as JSON, or in words where JSON has none for it. For `#[serde(with = …)]`.

use serde::de::{Error, Unexpected};
use serde::{Deserializer, Serializer};

use super::Forms;

/// Writes a number; one that is not finite as `"NaN"`, `"inf"` or `"-inf"`.
///
/// # Errors
/// As the serialiser.
pub fn serialize<S: Serializer>(value: &f64, serializer: S) -> Result<S::Ok, S::Error> {
    if value.is_finite() {
        serializer.serialize_f64(*value)
    } else {
        serializer.collect_str(value)
    }
}

/// Reads a number back.
///
/// # Errors
/// When there is neither a number nor one of the words.
pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    const EXPECTED: &str = "a number, \"NaN\", \"inf\" or \"-inf\"";
    let of_text = |text: String| match text.as_str() {
        "NaN" => Ok(f64::NAN),
        "inf" => Ok(f64::INFINITY),
        "-inf" => Ok(f64::NEG_INFINITY),
        _ => Err(text),
    };
    let read = Forms::new(EXPECTED).number(Ok).text(of_text);
    let invalid = |text: String| D::Error::invalid_value(Unexpected::Str(&text), &EXPECTED);
    read.read(deserializer)?.map_err(invalid)
}

/// A number that serde reads and writes in this form.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(transparent)]
pub struct Exact(#[serde(with = "self")] pub f64);
