//! How durations, units and quantities describe themselves in the JSON Schema of graph files.

use std::borrow::Cow;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};

use crate::quantity::Quantity;
use crate::time::Duration;
use crate::unit::Unit;

impl JsonSchema for Duration {
    fn schema_name() -> Cow<'static, str> {
        "Duration".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "type": "string",
            "description": "A duration: \"150s\", \"5min\", \"1h30m\", \"250ms\"; \"2 samples\" where the time base is a sample number.",
            "pattern": "^\\s*\\.?[0-9]",
            "examples": ["5min", "150s", "1h30m"]
        })
    }
}

impl JsonSchema for Unit {
    fn schema_name() -> Cow<'static, str> {
        "Unit".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "type": "string",
            "description": "A unit in UCUM: \"nm/min\", \"mK/min\", \"Cel\"; \"degC\" and \"µm\" are understood.",
            "examples": ["nm/min", "mK/min", "Cel"]
        })
    }
}

impl JsonSchema for Quantity {
    fn schema_name() -> Cow<'static, str> {
        "Quantity".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "type": "string",
            "description": "A number with its unit: \"150 nm/min\", \"-20 Cel\".",
            "pattern": "^\\s*[-+]?\\.?[0-9]",
            "examples": ["150 nm/min", "-20 Cel"]
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whether a text begins as a pattern says of the form `^\s*[signs]?\.?[0-9]`.
    fn begins_as(schema: &Schema, text: &str) -> bool {
        let signs = match schema.get("pattern").and_then(|of| of.as_str()) {
            Some(r"^\s*\.?[0-9]") => &[][..],
            Some(r"^\s*[-+]?\.?[0-9]") => &['-', '+'][..],
            other => panic!("{other:?}"),
        };
        let text = text.trim_start();
        let text = text.strip_prefix(signs).unwrap_or(text);
        let text = text.strip_prefix('.').unwrap_or(text);
        text.starts_with(|c: char| c.is_ascii_digit())
    }

    #[test]
    fn the_schema_takes_every_beginning_that_is_read() {
        let mut generator = SchemaGenerator::default();
        let duration = Duration::json_schema(&mut generator);
        let quantity = Quantity::json_schema(&mut generator);
        for sign in ["", "+", "-", "--", "\u{2212}"] {
            for number in ["5", "0.5", ".5", "5.", ".", "..5", "", "x"] {
                for space in ["", " "] {
                    let text = format!("{space}{sign}{number} s");
                    let is_read = text.parse::<Duration>().is_ok();
                    assert_eq!(is_read, begins_as(&duration, &text), "{text:?}");
                    let is_read = text.parse::<Quantity>().is_ok();
                    assert_eq!(is_read, begins_as(&quantity, &text), "{text:?}");
                }
            }
        }
    }
}
