//! The settings in which a kind is tried to see its output ports: one with all required parameters, and those in which one parameter
//! is another.

use athermal::core::node::{Kind, NodeSpec};
use serde_json::{Map, Value, json};

/// Of required parameters so many combinations are tried until one can be read.
const MOST_TRIED: usize = 1000;
/// How deep values lie in each other that are tried.
const DEEPEST: usize = 4;

/// The specifications of a kind in these settings; none where no setting fits its schema.
pub fn settings(kind: &Kind) -> Vec<Box<dyn NodeSpec>> {
    let schema = (kind.schema)();
    let values = Values {
        definitions: &schema["$defs"],
    };
    let Some((usual, spec)) = values.usual(schema, kind) else {
        return Vec::new();
    };
    let mut specs = vec![spec];
    for (name, property) in schema["properties"].as_object().into_iter().flatten() {
        for value in values.of(property, 0) {
            let mut other = usual.clone();
            other.insert(name.clone(), value);
            specs.extend(kind.given(&Value::Object(other)));
        }
    }
    specs
}

/// What values a schema takes.
struct Values<'a> {
    definitions: &'a Value,
}

impl Values<'_> {
    /// The first setting that can be read, with all that must be given.
    fn usual(
        &self,
        schema: &Value,
        kind: &Kind,
    ) -> Option<(Map<String, Value>, Box<dyn NodeSpec>)> {
        let mut all = vec![Map::new()];
        for (name, values) in self.required(schema, 0) {
            let with = |of: &Map<String, Value>, value: &Value| {
                let mut of = of.clone();
                of.insert(name.clone(), value.clone());
                of
            };
            let longer = all
                .iter()
                .flat_map(|of| values.iter().map(|value| with(of, value)));
            all = longer.take(MOST_TRIED).collect();
        }
        all.into_iter().find_map(|of| {
            let spec = kind.given(&Value::Object(of.clone()))?;
            Some((of, spec))
        })
    }

    /// The properties that must be given, with some of their values.
    fn required(&self, schema: &Value, depth: usize) -> Vec<(String, Vec<Value>)> {
        let names = schema["required"].as_array().into_iter().flatten();
        let names = names.filter_map(Value::as_str);
        names
            .map(|name| {
                let values = self.of(&schema["properties"][name], depth);
                (name.to_owned(), values)
            })
            .collect()
    }

    /// Some values, of each form one at least.
    fn of(&self, schema: &Value, depth: usize) -> Vec<Value> {
        if depth > DEEPEST {
            return Vec::new();
        }
        if let Some(name) = schema["$ref"]
            .as_str()
            .and_then(|path| path.rsplit('/').next())
        {
            return self.of(&self.definitions[name], depth);
        }
        if let Some(only) = schema.get("const") {
            return vec![only.clone()];
        }
        if let Some(all) = schema["enum"].as_array() {
            return all.clone();
        }
        let forms = ["oneOf", "anyOf", "allOf"].map(|of| schema[of].as_array());
        let forms = forms.into_iter().flatten().flatten();
        let mut values: Vec<Value> = forms.flat_map(|form| self.of(form, depth + 1)).collect();
        let types = match &schema["type"] {
            Value::Array(several) => several.iter().filter_map(Value::as_str).collect(),
            one => Vec::from_iter(one.as_str()),
        };
        for of in types {
            match of {
                "boolean" => values.extend([json!(false), json!(true)]),
                "integer" => values.extend([least(schema), 2.0].map(|one| json!(one as i64))),
                "number" => values.extend([0.5, least(schema)].map(|one| json!(one))),
                "string" => values.extend(["1min", "1 nm", "1 nm/min", "1"].map(|one| json!(one))),
                "array" => {
                    let items = self.of(&schema["items"], depth + 1);
                    values.extend(items.into_iter().map(|item| json!([item])));
                }
                "object" => {
                    let fields = self.required(schema, depth + 1);
                    let first = fields.into_iter().map(|(name, values)| {
                        let value = values.into_iter().next();
                        (name, value.unwrap_or_default())
                    });
                    values.push(Value::Object(first.collect()));
                }
                _ => {}
            }
        }
        values
    }
}

/// A number that is not too small.
fn least(schema: &Value) -> f64 {
    let bound = |key: &str| schema[key].as_f64();
    match (bound("minimum"), bound("exclusiveMinimum")) {
        (Some(least), _) => least,
        (_, Some(below)) => below + 1.0,
        _ => 1.0,
    }
}
