//! The JSON Schema of what a machine file says of a service, for editors.

use schemars::{JsonSchema, SchemaGenerator};
use serde_json::Value;

use super::runtime::Runtime;
use super::sinks::SinkKeys;
use super::sources::SourceKeys;

/// The schemas of `[runtime]`, and of the keys that every source and every sink has. What they refer to is left with the generator.
pub fn schemas(generator: &mut SchemaGenerator) -> [Value; 3] {
    [
        Runtime::json_schema(generator).into(),
        SourceKeys::json_schema(generator).into(),
        SinkKeys::json_schema(generator).into(),
    ]
}
