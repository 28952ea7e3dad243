//! A table of the tree into a Rust type: all unknown keys and the first other mistake, each reported at its place.
//!
//! Structs are strict: a key that the struct does not have is reported with the nearest that it has, `deny_unknown_fields` or not.
//! Serde buffers internally tagged and untagged enums, so that strictness and places end at them: give such an enum
//! `#[serde(deny_unknown_fields)]`. A mistake inside is shown at the enum's table.

mod error;
mod tree;

use std::cell::RefCell;

use schemars::JsonSchema;
use serde::de::DeserializeOwned;

use super::tree::Value;
use crate::diagnostic::Diagnostics;
use crate::registry::first_paragraph;
use error::Mistake;
use tree::TreeDeserializer;

/// Reads `value` as a `T`; `None` where it has unknown keys or another mistake. `what` names the value in the texts, e.g.
/// `node "thermal"`.
pub fn decode<T: DeserializeOwned>(
    value: &Value,
    what: &str,
    diagnostics: &mut Diagnostics,
) -> Option<T> {
    decode_with(value, what, &[], &|_| None, diagnostics)
}

/// As [`decode`], with keys of the table that are read elsewhere and may be meant by an unknown one. Where a key is missing, its
/// documentation says what to write.
pub fn decode_beside<T: DeserializeOwned + JsonSchema>(
    value: &Value,
    what: &str,
    elsewhere: &[&str],
    diagnostics: &mut Diagnostics,
) -> Option<T> {
    let advice = |key: &str| {
        let schema = serde_json::Value::from(schemars::schema_for!(T));
        let description = schema["properties"][key]["description"].as_str()?;
        Some(format!("add `{key}`: {}", first_paragraph(description)))
    };
    decode_with(value, what, elsewhere, &advice, diagnostics)
}

fn decode_with<T: DeserializeOwned>(
    value: &Value,
    what: &str,
    elsewhere: &[&str],
    advice: &dyn Fn(&str) -> Option<String>,
    diagnostics: &mut Diagnostics,
) -> Option<T> {
    let unknown = RefCell::new(Vec::new());
    let read = T::deserialize(TreeDeserializer::new(value, &unknown));
    let unknown: Vec<Mistake> = unknown.into_inner();
    let is_whole = unknown.is_empty();
    let (read, first) = match read {
        Ok(read) => (Some(read), None),
        Err(error) => (None, Some(error.into_mistake(value.place))),
    };
    let is_misspelt = |missing: &Mistake| unknown.iter().any(|key| key.is_meant_for(missing));
    let first = first.filter(|mistake| !is_misspelt(mistake));
    for mistake in unknown.into_iter().chain(first) {
        mistake.report(what, elsewhere, advice, diagnostics);
    }
    read.filter(|_| is_whole)
}

#[cfg(test)]
mod tests;
