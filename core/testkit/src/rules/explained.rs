//! Decides whether a kind says what it is and what its parameters mean.

use serde_json::Value as Json;

use super::parameters::written;
use crate::diagnostic::{Place, SourceId};
use crate::document::Value;
use crate::node::{Kind, out_of_range};

/// The fewest characters that explain anything.
const WORDS: usize = 10;

/// Ends of names that hide a unit.
const HIDDEN_UNITS: [&str; 12] = [
    "_s", "_ms", "_sec", "_min", "_h", "_nm", "_um", "_mm", "_k", "_mk", "_c", "_degc",
];

/// All that a kind leaves unsaid.
pub(in super::super) fn explained(kind: &Kind) -> Vec<String> {
    let schema = (kind.schema)();
    let mut found = Vec::new();
    if kind.summary().len() < WORDS {
        found.push(format!(
            "the parameters' struct of `{}` has no documentation",
            kind.name
        ));
    }
    if schema["additionalProperties"] != false {
        found.push(
            "an unknown parameter would be taken without a word: the struct lacks #[serde(deny_unknown_fields)]".to_owned(),
        );
    }
    for port in (kind.inputs)()
        .iter()
        .filter(|port| port.summary.len() < WORDS)
    {
        found.push(format!("the input port `{}` has no summary", port.name));
    }
    let defaults = schema["properties"].as_object().into_iter().flatten();
    let defaults = defaults.map(|(name, of)| (name.clone(), written(&of["default"])));
    let defaults: Json = defaults.filter(|(_, value)| !value.is_null()).collect();
    if let Ok(defaults) = Value::from_json(&defaults, Place::new(SourceId(0), 0, 0)) {
        let wrong = out_of_range(schema, &defaults).into_iter();
        found.extend(wrong.map(|(_, mistake)| format!("by default {mistake}")));
    }
    parameters(schema, "", &mut found);
    for (name, definition) in schema["$defs"].as_object().into_iter().flatten() {
        parameters(definition, name, &mut found);
        for choice in ["anyOf", "oneOf"] {
            for option in definition[choice].as_array().into_iter().flatten() {
                parameters(option, name, &mut found);
            }
        }
    }
    found
}

fn parameters(schema: &Json, of: &str, found: &mut Vec<String>) {
    for (name, property) in schema["properties"].as_object().into_iter().flatten() {
        let of = if of.is_empty() {
            String::new()
        } else {
            format!(" of `{of}`")
        };
        // A tag says itself what it is.
        let tag = !property["const"].is_null();
        if !tag && property["description"].as_str().unwrap_or_default().len() < WORDS {
            found.push(format!("the parameter `{name}`{of} has no documentation"));
        }
        let sort = property["type"].as_str().unwrap_or_default();
        if matches!(sort, "number" | "integer")
            && HIDDEN_UNITS
                .iter()
                .any(|unit| name.to_lowercase().ends_with(unit))
        {
            found.push(format!(
                "the parameter `{name}`{of} is a bare number with a unit in its name"
            ));
        }
    }
}
