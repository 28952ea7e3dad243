//! What a kind's JSON Schema allows of its parameters, and where a table goes beyond it: bounds of numbers, durations and
//! quantities, and the lengths of lists.

use std::borrow::Cow;

use serde_json::Value as Json;

use crate::diagnostic::{Place, counted};
use crate::document::{Data, Value};
use crate::quantity::Quantity;
use crate::time::Duration;

/// A parameter, or a part of one, as the schema describes it.
#[derive(Debug, Clone, Copy)]
pub struct ParameterPart<'a> {
    /// The way to it: `solver`, `alpha`. The places of a list are numbers.
    pub path: &'a [Cow<'a, str>],
    /// What stands there; none where it is left out.
    pub value: Option<&'a Value>,
    /// What it may be as a number.
    pub range: Range,
    /// What the schema says of it, the form chosen that its value has.
    schema: &'a Json,
    /// The same with all its forms.
    declared: &'a Json,
    definitions: &'a Json,
    /// The definition that it refers to.
    name: Option<&'a str>,
}

/// Bounds of a number. Of a duration they are in seconds, of a quantity in its own unit.
///
/// They are those of JSON Schema, which allows them beside any type: `#[schemars(extend("exclusiveMinimum" = 0))]` of a
/// duration says that it is greater than 0. They hold for each value of a list too. NaN and infinity are in no range.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Range {
    /// The smallest value.
    pub min: Option<f64>,
    /// The value that it must exceed.
    pub above: Option<f64>,
    /// The largest value.
    pub max: Option<f64>,
    /// The value that it must not reach.
    pub below: Option<f64>,
}

impl Range {
    /// The bounds that a schema states itself.
    fn of(schema: &Json) -> Self {
        let bound = |key: &str| schema[key].as_f64();
        Self {
            min: bound("minimum"),
            above: bound("exclusiveMinimum"),
            max: bound("maximum"),
            below: bound("exclusiveMaximum"),
        }
    }

    /// Whether a number is finite and within the bounds.
    #[must_use]
    pub fn contains(&self, value: f64) -> bool {
        value.is_finite()
            && self.min.is_none_or(|min| value >= min)
            && self.above.is_none_or(|above| value > above)
            && self.max.is_none_or(|max| value <= max)
            && self.below.is_none_or(|below| value < below)
    }
}

impl std::fmt::Display for Range {
    /// As it ends the sentence "it must be …".
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if let (None, Some(min), None, Some(max)) = (self.above, self.min, self.below, self.max) {
            return write!(f, "from {min} to {max}");
        }
        let above = self.above.map(|above| format!("greater than {above}"));
        let low = above.or_else(|| Some(format!("{} or more", self.min?)));
        let below = self.below.map(|below| format!("less than {below}"));
        let high = below.or_else(|| Some(format!("at most {}", self.max?)));
        match (low, high) {
            (Some(low), Some(high)) => write!(f, "{low} and {high}"),
            (Some(one), None) | (None, Some(one)) => f.write_str(&one),
            (None, None) => f.write_str("a finite number"),
        }
    }
}

/// Every value of a table that the schema of its kind does not allow: its place, and a sentence on it.
///
/// The table has been read as the kind's parameters, so that every value is of a type that the schema takes.
#[must_use]
pub fn out_of_range(schema: &Json, table: &Value) -> Vec<(Place, String)> {
    let mut wrong = Vec::new();
    each_parameter(schema, table, &mut |part| {
        if let (Some(value), Some(mistake)) = (part.value, part.mistake()) {
            wrong.push((value.place, mistake));
        }
    });
    wrong
}

/// Calls for the parameters of a kind and all their parts, as a table has them.
pub fn each_parameter(schema: &Json, table: &Value, visit: &mut dyn FnMut(ParameterPart<'_>)) {
    let mut walk = Walk {
        definitions: &schema["$defs"],
        path: Vec::new(),
        visit,
    };
    walk.properties(schema, Some(table));
}

impl ParameterPart<'_> {
    /// The name of the parameter, without places in lists.
    #[must_use]
    pub fn name(&self) -> &str {
        let mut names = self.path.iter().rev();
        let name = names.find(|name| name.parse::<usize>().is_err());
        name.map_or("", |name| name)
    }

    /// Whether it is written as a text of this type: `Duration` or `Quantity`.
    #[must_use]
    pub fn is_text(&self, name: &str) -> bool {
        self.name == Some(name)
    }

    /// Whether it may be of a type of JSON Schema.
    #[must_use]
    pub fn is(&self, name: &str) -> bool {
        is_of(self.schema, name)
    }

    /// The words that it may be, true and false of a switch, and the tables that need no more than the tag that tells them
    /// apart.
    #[must_use]
    pub fn choices(&self) -> Vec<Json> {
        let mut choices = Vec::new();
        self.choices_of(self.declared, &mut choices);
        choices
    }

    fn choices_of(&self, schema: &Json, choices: &mut Vec<Json>) {
        let schema = resolved(schema, self.definitions);
        for form in forms(schema) {
            self.choices_of(form, choices);
        }
        if is_of(schema, "boolean") {
            choices.extend([false, true].map(Json::Bool));
        }
        choices.extend(schema["enum"].as_array().into_iter().flatten().cloned());
        let word = &schema["const"];
        choices.extend((!word.is_null()).then(|| word.clone()));
        let tags = schema["properties"].as_object().into_iter().flatten();
        let tags = tags.filter(|(_, property)| !property["const"].is_null());
        let tag = |(name, property): (&String, &Json)| (name.clone(), property["const"].clone());
        let table: serde_json::Map<String, Json> = tags.map(tag).collect();
        let mut required = schema["required"].as_array().into_iter().flatten();
        let is_tag = |name: &Json| name.as_str().is_some_and(|name| table.contains_key(name));
        if !table.is_empty() && required.all(is_tag) {
            choices.push(Json::Object(table));
        }
    }

    fn mistake(&self) -> Option<String> {
        let (name, value) = (self.name(), self.value?);
        let (number, shown) = match &value.data {
            Data::List(list) => {
                let least = self.schema["minItems"].as_u64().unwrap_or(0);
                let found = counted(list.len(), "value");
                return ((list.len() as u64) < least)
                    .then(|| format!("`{name}` has {found} and must have {least} or more"));
            }
            Data::Integer(number) => (*number as f64, number.to_string()),
            Data::Float(number) => (*number, number.to_string()),
            Data::Text(text) if self.is_text("Duration") => {
                let duration: Duration = text.parse().ok()?;
                (duration.secs(), duration.to_string())
            }
            Data::Text(text) if self.is_text("Quantity") => {
                let quantity: Quantity = text.parse().ok()?;
                (quantity.value, quantity.to_string())
            }
            _ => return None,
        };
        let range = self.range;
        (!range.contains(number)).then(|| format!("`{name}` is {shown} and must be {range}"))
    }
}

struct Walk<'a, 'v> {
    definitions: &'a Json,
    path: Vec<Cow<'a, str>>,
    visit: &'v mut dyn FnMut(ParameterPart<'_>),
}

impl<'a> Walk<'a, '_> {
    fn properties(&mut self, schema: &'a Json, table: Option<&'a Value>) {
        let table = table.and_then(Value::as_table);
        for (name, property) in schema["properties"].as_object().into_iter().flatten() {
            let value = table.and_then(|table| table.get(name));
            self.path.push(Cow::from(name));
            self.enter(property, property, Range::default(), value);
            self.path.pop();
        }
    }

    /// A value, and what the schemas about it say of its range.
    fn enter(
        &mut self,
        declared: &'a Json,
        schema: &'a Json,
        outer: Range,
        value: Option<&'a Value>,
    ) {
        let own = Range::of(schema);
        let range = if own == Range::default() { outer } else { own };
        let name = referred(schema);
        let schema = resolved(schema, self.definitions);
        if let Some(form) = self.form(schema, value) {
            return self.enter(declared, form, range, value);
        }
        (self.visit)(ParameterPart {
            path: &self.path,
            value,
            range,
            schema,
            declared,
            definitions: self.definitions,
            name,
        });
        // What stands in a table that is left out cannot be set alone.
        if value.is_some() {
            self.properties(schema, value);
        }
        let list = value.and_then(Value::as_list).into_iter().flatten();
        let places = schema["prefixItems"].as_array().into_iter().flatten();
        let items = places.chain(std::iter::repeat(&schema["items"]));
        for (place, (value, item)) in list.zip(items).enumerate() {
            self.path.push(Cow::from(place.to_string()));
            self.enter(item, item, range, Some(value));
            self.path.pop();
        }
    }

    /// Of several forms that a schema allows, that of the value; of nothing, the first that is anything.
    fn form(&self, schema: &'a Json, value: Option<&Value>) -> Option<&'a Json> {
        match value {
            Some(value) => forms(schema).find(|form| self.fits(form, value)),
            None => forms(schema).find(|form| form["type"] != "null"),
        }
    }

    /// Whether a value is of the form that a schema describes.
    fn fits(&self, schema: &'a Json, value: &Value) -> bool {
        let schema = resolved(schema, self.definitions);
        if self.form(schema, Some(value)).is_some() {
            return true;
        }
        let is = |name: &str| is_of(schema, name);
        match &value.data {
            Data::Bool(_) => is("boolean"),
            Data::Integer(_) => is("integer") || is("number"),
            Data::Float(_) => is("number"),
            Data::Text(text) | Data::Time(text) => {
                let words = schema["enum"].as_array();
                let is_word = words.is_none_or(|words| words.iter().any(|word| word == text));
                is("string") && is_word && (schema["const"].is_null() || schema["const"] == **text)
            }
            Data::List(_) => is("array"),
            Data::Table(table) => {
                let properties = &schema["properties"];
                let of_tag = |(name, of): (&String, &Json)| {
                    of["const"].is_null()
                        || table.get(name).and_then(Value::as_text) == of["const"].as_str()
                };
                is("object")
                    && table.keys().all(|key| !properties[key].is_null())
                    && properties.as_object().into_iter().flatten().all(of_tag)
            }
        }
    }
}

/// A schema, or what it refers to.
fn resolved<'a>(schema: &'a Json, definitions: &'a Json) -> &'a Json {
    referred(schema).map_or(schema, |name| &definitions[name])
}

/// The forms that a schema allows, where it allows several.
fn forms(schema: &Json) -> impl Iterator<Item = &Json> {
    let several = ["anyOf", "oneOf"].map(|key| schema[key].as_array());
    several.into_iter().flatten().flatten()
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
