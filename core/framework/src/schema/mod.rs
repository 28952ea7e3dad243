//! Decides the JSON Schema of graph files, and how durations, units and quantities describe themselves in it; what they mean is decided with them.

mod graph;

pub use graph::graph_schema;

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
            "pattern": "^\\s*[0-9]",
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
            "pattern": "^\\s*[-+0-9.]",
            "examples": ["150 nm/min", "-20 Cel"]
        })
    }
}
