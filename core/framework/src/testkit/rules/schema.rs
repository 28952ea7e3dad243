//! Decides what the schema of a kind says of each of its parameters.

use serde_json::Value as Json;

/// A parameter, or a part of one, of which the schema says what it may be.
#[derive(Debug)]
pub(super) struct Leaf {
    /// The way to it: `solver`, `alpha`; the places of a list are numbers.
    pub(super) path: Vec<String>,
    pub(super) sort: Sort,
    /// Its present value; null where it is left out.
    pub(super) value: Json,
}

#[derive(Debug)]
pub(super) enum Sort {
    Number {
        integer: bool,
        low: Bound,
        high: Bound,
    },
    Duration,
    Quantity,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Bound {
    None,
    Inclusive(f64),
    Exclusive(f64),
}

/// The parameters that a schema bounds, with the values that they have.
pub(super) fn leaves(schema: &Json, parameters: &Json) -> Vec<Leaf> {
    let mut walk = Walk {
        definitions: &schema["$defs"],
        leaves: Vec::new(),
    };
    walk.enter(schema, parameters, &mut Vec::new());
    walk.leaves
}

struct Walk<'a> {
    definitions: &'a Json,
    leaves: Vec<Leaf>,
}

impl<'a> Walk<'a> {
    fn enter(&mut self, schema: &'a Json, value: &Json, path: &mut Vec<String>) {
        let sort = match referred(schema) {
            Some("Duration") => Some(Sort::Duration),
            Some("Quantity") => Some(Sort::Quantity),
            _ => number(schema),
        };
        if let Some(sort) = sort {
            self.leaves.push(Leaf {
                path: path.clone(),
                sort,
                value: value.clone(),
            });
            return;
        }
        let schema = self.resolved(schema);
        for choice in ["anyOf", "oneOf"] {
            let mut options = schema[choice].as_array().into_iter().flatten();
            let chosen = if value.is_null() {
                options.find(|option| option["type"] != "null")
            } else {
                options.find(|option| self.fits(option, value))
            };
            if let Some(option) = chosen {
                self.enter(option, value, path);
            }
        }
        for (name, property) in schema["properties"].as_object().into_iter().flatten() {
            // What stands in a part that is left out cannot be set alone.
            if path.is_empty() || !value.is_null() {
                path.push(name.clone());
                self.enter(property, &value[name.as_str()], path);
                path.pop();
            }
        }
        let places = schema["prefixItems"].as_array().into_iter().flatten();
        let items = places.chain(std::iter::repeat(&schema["items"]));
        for (place, (element, item)) in value
            .as_array()
            .into_iter()
            .flatten()
            .zip(items)
            .enumerate()
        {
            path.push(place.to_string());
            self.enter(item, element, path);
            path.pop();
        }
    }

    fn resolved(&self, schema: &'a Json) -> &'a Json {
        referred(schema).map_or(schema, |name| &self.definitions[name])
    }

    /// Whether a value is of the shape that one of several schemas describes.
    fn fits(&self, schema: &'a Json, value: &Json) -> bool {
        let schema = self.resolved(schema);
        if !schema["const"].is_null() {
            return schema["const"] == *value;
        }
        if let Some(words) = schema["enum"].as_array() {
            return words.contains(value);
        }
        let sort = schema["type"].as_str().unwrap_or_default();
        let right = match value {
            Json::Null => sort == "null",
            Json::Bool(_) => sort == "boolean",
            Json::Number(_) => matches!(sort, "number" | "integer"),
            Json::String(_) => sort == "string",
            Json::Array(_) => sort == "array",
            Json::Object(_) => sort == "object",
        };
        let mut properties = schema["properties"].as_object().into_iter().flatten();
        let known = |name: &String| !schema["properties"][name.as_str()].is_null();
        let keys = value
            .as_object()
            .is_none_or(|object| object.keys().all(known));
        right
            && keys
            && properties.all(|(name, property)| {
                let tag = &property["const"];
                tag.is_null() || *tag == value[name.as_str()]
            })
    }
}

/// The name of the definition that a schema refers to.
fn referred(schema: &Json) -> Option<&str> {
    schema["$ref"].as_str()?.rsplit('/').next()
}

fn number(schema: &Json) -> Option<Sort> {
    let is = |name: &str| match &schema["type"] {
        Json::String(sort) => sort == name,
        Json::Array(sorts) => sorts.iter().any(|sort| sort == name),
        _ => false,
    };
    let integer = is("integer");
    (integer || is("number")).then(|| {
        let bound = |inclusive: &str, exclusive: &str| {
            if let Some(bound) = schema[exclusive].as_f64() {
                Bound::Exclusive(bound)
            } else {
                schema[inclusive]
                    .as_f64()
                    .map_or(Bound::None, Bound::Inclusive)
            }
        };
        Sort::Number {
            integer,
            low: bound("minimum", "exclusiveMinimum"),
            high: bound("maximum", "exclusiveMaximum"),
        }
    })
}
