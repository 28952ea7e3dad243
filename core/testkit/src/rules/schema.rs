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
    /// One of these values.
    Choice(Vec<Json>),
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

/// What stands for a parameter that is left out, and for each part of it, as the schema has it: also for those of tables within
/// the parameters.
pub(super) fn defaults(schema: &Json) -> Vec<Leaf> {
    let mut walk = Walk {
        definitions: &schema["$defs"],
        leaves: Vec::new(),
    };
    let definitions = schema["$defs"].as_object().into_iter().flatten();
    for table in std::iter::once(schema).chain(definitions.map(|(_, table)| table)) {
        let of = |choice: &str| table[choice].as_array().into_iter().flatten();
        for table in std::iter::once(table).chain(of("oneOf")).chain(of("anyOf")) {
            for (name, property) in table["properties"].as_object().into_iter().flatten() {
                if !property["default"].is_null() {
                    walk.enter(property, &property["default"], &mut vec![name.clone()]);
                }
            }
        }
    }
    walk.leaves
}

impl Leaf {
    /// Whether the schema allows the value that it has.
    pub(super) fn is_allowed(&self) -> bool {
        match &self.sort {
            Sort::Number { low, high, .. } => self.value.as_f64().is_none_or(|value| {
                let above = match *low {
                    Bound::None => true,
                    Bound::Inclusive(low) => value >= low,
                    Bound::Exclusive(low) => value > low,
                };
                let below = match *high {
                    Bound::None => true,
                    Bound::Inclusive(high) => value <= high,
                    Bound::Exclusive(high) => value < high,
                };
                above && below
            }),
            Sort::Duration | Sort::Quantity | Sort::Choice(_) => true,
        }
    }
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
        let choices = self.choices(schema);
        if !choices.is_empty() {
            self.leaves.push(Leaf {
                path: path.clone(),
                sort: Sort::Choice(choices),
                value: value.clone(),
            });
        }
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

    /// The words that a schema lists, true and false where it is a switch, and the tables that need no more than the tag by which
    /// they are told apart.
    fn choices(&self, schema: &'a Json) -> Vec<Json> {
        if is_of(schema, "boolean") {
            return [false, true].map(Json::Bool).into();
        }
        let options = ["anyOf", "oneOf"].map(|choice| schema[choice].as_array());
        let options = options.into_iter().flatten().flatten();
        let mut choices = Vec::new();
        for option in std::iter::once(schema).chain(options) {
            let option = self.resolved(option);
            choices.extend(option["enum"].as_array().into_iter().flatten().cloned());
            if !option["const"].is_null() {
                choices.push(option["const"].clone());
            }
            let properties = option["properties"].as_object();
            let tags = properties.into_iter().flatten();
            let tags = tags.filter(|(_, property)| !property["const"].is_null());
            let tag: serde_json::Map<String, Json> = tags
                .map(|(name, property)| (name.clone(), property["const"].clone()))
                .collect();
            let mut required = option["required"].as_array().into_iter().flatten();
            let is_tag = |name: &Json| name.as_str().is_some_and(|name| tag.contains_key(name));
            if !tag.is_empty() && required.all(is_tag) {
                choices.push(Json::Object(tag));
            }
        }
        choices.retain(|choice| !choice.is_null());
        choices
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

/// Whether a schema is of a type, or of that among others.
fn is_of(schema: &Json, name: &str) -> bool {
    match &schema["type"] {
        Json::String(sort) => sort == name,
        Json::Array(sorts) => sorts.iter().any(|sort| sort == name),
        _ => false,
    }
}

fn number(schema: &Json) -> Option<Sort> {
    let is = |name: &str| is_of(schema, name);
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
