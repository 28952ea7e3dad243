//! Decides the JSON Schema of graph files, for exactly the kinds that are linked in; what a kind's parameters are is decided by the kind.

use std::collections::BTreeMap;

use schemars::generate::SchemaSettings;
use schemars::{JsonSchema, SchemaGenerator};
use serde_json::{Map, Value, json};

use athermal_core::compile::EstimatorKeys;
use athermal_core::document::{TIME_UNITS, TableFormat};
use athermal_core::node::{Kind, Read, kinds};
use athermal_trial::TestTable;

/// The JSON Schema (draft 7, which editors understand) of graph files, as text.
///
/// Each kind of node is an `if type … then …` of an `allOf`, so that an editor points at the value that is wrong and not at the node.
#[must_use]
pub fn graph_schema() -> Value {
    let mut generator = SchemaSettings::draft07().into_generator();
    let test = of::<TestTable>(&mut generator);
    let framework = Value::from(EstimatorKeys::json_schema(&mut generator));
    let all: Vec<&Kind> = kinds()
        .values()
        .filter_map(|same| same.first().copied())
        .collect();
    let names: Vec<&str> = all.iter().map(|kind| kind.name).collect();
    let summaries: Vec<String> = all.iter().map(|kind| kind.summary()).collect();
    let duration = of::<athermal_core::time::Duration>(&mut generator);
    let format = Value::from(TableFormat::json_schema(&mut generator));
    let format = as_draft_7(&format, &str::to_owned);
    let quantity = of::<athermal_core::quantity::Quantity>(&mut generator);
    let unit = of::<athermal_core::unit::Unit>(&mut generator);
    let mut definitions = Definitions::default();
    for (name, schema) in generator.take_definitions(true) {
        definitions
            .taken
            .insert(name, as_draft_7(&schema, &str::to_owned));
    }
    let nodes: Vec<Value> = all
        .iter()
        .map(|kind| node(kind, &framework, &mut definitions))
        .collect();
    let mut definitions = definitions.taken;
    definitions.insert(
        "References".to_owned(),
        json!({
            "description": "A reference, or a list of them: \"node\", \"node.channel\", \"node:port\", \"node:port.channel\"; `*`, `?` and `{a,b}` match channels.",
            "anyOf": [
                { "type": "string", "minLength": 1 },
                { "type": "array", "items": { "type": "string", "minLength": 1 }, "minItems": 1 }
            ]
        }),
    );
    definitions.insert("Input".to_owned(), input(&duration));
    definitions.insert(
        "Node".to_owned(),
        json!({
            "description": "A node, or false to remove an inherited one.",
            "if": { "type": "object" },
            "then": {
                "properties": {
                    "type": {
                        "description": "The kind of node.",
                        "enum": &names,
                        "x-taplo": { "docs": { "enumValues": summaries } }
                    },
                    "module": { "description": "The module that the node is an instance of, in place of `type`.", "type": "string" }
                },
                "allOf": nodes
            },
            "else": { "const": false }
        }),
    );
    definitions.insert("Module".to_owned(), module(&names));
    let members = json!({
        "description": "The members.",
        "type": "array",
        "items": { "type": "string", "pattern": "^[\\p{L}0-9][\\p{L}\\p{N}_-]*$" },
        "minItems": 1,
        "uniqueItems": true
    });
    json!({
        "$schema": "http://json-schema.org/draft-07/schema#",
        "title": "athermal graph",
        "description": format!("What is measured on a machine, which nodes compute what from it, and what comes out. Node types: {}.", names.join(", ")),
        "type": "object",
        "additionalProperties": false,
        "required": ["schema"],
        "properties": {
            "schema": { "description": "The version of the graph language.", "const": 1 },
            "name": { "description": "The graph's name.", "type": "string" },
            "description": { "description": "What the graph is for.", "type": "string" },
            "extends": { "description": "The file that this one changes, relative to this one.", "type": "string" },
            "sets": {
                "description": "Names to expand over, with `each`.",
                "type": "object",
                "propertyNames": names_of("A set's name."),
                "additionalProperties": members
            },
            "time": time(&duration),
            "table": table(&format),
            "signals": {
                "description": "What is measured.",
                "type": "object",
                "propertyNames": names_of("A signal's name."),
                "additionalProperties": signal(&unit, &quantity, &duration)
            },
            "modules": {
                "description": "Groups of nodes with inputs, outputs and parameters, for use by several nodes.",
                "type": "object",
                "propertyNames": names_of("A module's name."),
                "additionalProperties": { "$ref": "#/definitions/Module" }
            },
            "nodes": {
                "description": "What computes.",
                "type": "object",
                "propertyNames": names_of("A node's name."),
                "additionalProperties": { "$ref": "#/definitions/Node" }
            },
            "outputs": {
                "description": "What comes out.",
                "type": "object",
                "propertyNames": names_of("An output's name."),
                "additionalProperties": output(&quantity)
            },
            "tests": { "description": "What must hold, for `athermal test`.", "type": "array", "items": test },
            "source": { "description": "Where live measurements come from.", "type": "object" },
            "sinks": { "description": "Where live outputs go.", "type": "object", "additionalProperties": { "type": "object" } },
            "runtime": {
                "description": "How the graph runs live.",
                "type": "object",
                "properties": { "heartbeat": described(&duration, "The time between two empty ticks, so that silence is noticed.") },
                "additionalProperties": false
            },
            "model": { "description": "The fitted model that runs, relative to this file.", "type": "string" }
        },
        "definitions": definitions
    })
}

fn of<T: JsonSchema>(generator: &mut SchemaGenerator) -> Value {
    generator.subschema_for::<T>().into()
}

/// What several places of the schema share, by name.
#[derive(Default)]
struct Definitions {
    taken: Map<String, Value>,
}

impl Definitions {
    /// Takes the definitions of a kind over, and gives its schema with references to them. A name that another kind has for
    /// something else gets the kind's name in front.
    fn adopt(&mut self, kind: &Kind) -> Value {
        let mut schema = (kind.schema)().clone();
        let own = schema
            .as_object_mut()
            .and_then(|schema| schema.remove("$defs"));
        let own = match own {
            Some(Value::Object(own)) => own,
            _ => Map::new(),
        };
        let names: BTreeMap<String, String> = own
            .iter()
            .map(|(name, schema)| {
                let plain = as_draft_7(schema, &|name| name.to_owned());
                let clashes = self.taken.get(name).is_some_and(|taken| *taken != plain);
                let unique = if clashes {
                    format!("{}.{name}", kind.name)
                } else {
                    name.clone()
                };
                (name.clone(), unique)
            })
            .collect();
        let rename = |name: &str| names.get(name).cloned().unwrap_or_else(|| name.to_owned());
        for (name, schema) in &own {
            self.taken.insert(rename(name), as_draft_7(schema, &rename));
        }
        as_draft_7(&schema, &rename)
    }
}

/// A schema of draft 2020-12 as one of draft 7: definitions stand elsewhere, and nothing counts beside a `$ref`.
fn as_draft_7(schema: &Value, rename: &dyn Fn(&str) -> String) -> Value {
    match schema {
        Value::Array(list) => list.iter().map(|item| as_draft_7(item, rename)).collect(),
        Value::Object(keys) => {
            let mut made = Map::new();
            for (key, value) in keys
                .iter()
                .filter(|(key, _)| *key != "$schema" && *key != "title")
            {
                made.insert(key.clone(), as_draft_7(value, rename));
            }
            let target = keys.get("$ref").and_then(Value::as_str);
            if let Some(name) = target.and_then(|target| target.strip_prefix("#/$defs/")) {
                let reference = json!({ "$ref": format!("#/definitions/{}", rename(name)) });
                made.remove("$ref");
                if made.is_empty() {
                    return reference;
                }
                made.insert("allOf".to_owned(), json!([reference]));
            }
            if let Some(Value::Array(choices)) = made.get("oneOf")
                && let Some(decided) = by_name(choices).or_else(|| by_tag(choices))
            {
                made.remove("oneOf");
                made.extend(decided);
            }
            Value::Object(made)
        }
        other => other.clone(),
    }
}

/// Choices that are texts, as one list of them.
fn by_name(choices: &[Value]) -> Option<Map<String, Value>> {
    let mut names = Vec::new();
    let mut texts = Vec::new();
    for choice in choices {
        let text = choice["description"].as_str().unwrap_or_default();
        match (choice.get("const"), choice["enum"].as_array()) {
            (Some(name), _) => {
                names.push(name.clone());
                texts.push(text);
            }
            (None, Some(several)) => {
                names.extend(several.iter().cloned());
                texts.extend(several.iter().map(|_| text));
            }
            (None, None) => return None,
        }
    }
    let docs = json!({ "docs": { "enumValues": texts } });
    Some(Map::from_iter([
        ("enum".to_owned(), Value::Array(names)),
        ("x-taplo".to_owned(), docs),
    ]))
}

/// Choices that are tables which one key distinguishes, as an `if … then …` for each: what is wrong in a table is then reported where it
/// stands, not as "none of these".
fn by_tag(choices: &[Value]) -> Option<Map<String, Value>> {
    let first = choices.first()?["properties"].as_object()?;
    let (tag, _) = first
        .iter()
        .find(|(_, property)| property.get("const").is_some())?;
    let mut names = Vec::new();
    let mut texts = Vec::new();
    let mut decided = Vec::new();
    for choice in choices {
        let name = choice["properties"][tag].get("const")?;
        names.push(name.clone());
        texts.push(choice["description"].as_str().unwrap_or_default());
        decided.push(json!({
            "if": { "properties": { tag: { "const": name } }, "required": [tag] },
            "then": choice
        }));
    }
    let names = json!({ tag: { "enum": names, "x-taplo": { "docs": { "enumValues": texts } } } });
    Some(Map::from_iter([
        ("type".to_owned(), json!("object")),
        ("properties".to_owned(), names),
        ("required".to_owned(), json!([tag])),
        ("allOf".to_owned(), Value::Array(decided)),
    ]))
}

/// The keys of one kind, the framework's included.
fn node(kind: &Kind, framework: &Value, definitions: &mut Definitions) -> Value {
    let mut parameters = definitions.adopt(kind);
    let mut properties = Map::new();
    properties.insert(
        "type".to_owned(),
        json!({ "description": kind.documentation() }),
    );
    properties.insert(
        "each".to_owned(),
        json!({
            "description": "The set, or sets, over whose members the node is expanded; `{set}` in its texts is the member.",
            "anyOf": [{ "type": "string" }, { "type": "array", "items": { "type": "string" }, "minItems": 1 }]
        }),
    );
    properties.insert("inputs".to_owned(), inputs(kind));
    for &key in kind.framework_keys() {
        properties.insert(key.to_owned(), framework["properties"][key].clone());
    }
    let own = parameters["properties"].take();
    if let Value::Object(own) = own {
        properties.extend(own);
    }
    // Keys that a kind requires may be inherited from another file, so that none can be required of one file alone.
    json!({
        "if": { "properties": { "type": { "const": kind.name } }, "required": ["type"] },
        "then": {
            "description": kind.documentation(),
            "properties": properties,
            "additionalProperties": false
        }
    })
}

fn inputs(kind: &Kind) -> Value {
    let port = |port: &athermal_core::node::InputPort| {
        let read = match port.read {
            Read::Fresh => "new values only",
            Read::Held => "the last value, up to its maximum age",
            Read::Truth => "paired with predictions",
        };
        let description = format!("{} ({read})", port.summary);
        let schema =
            json!({ "description": description, "allOf": [{ "$ref": "#/definitions/Input" }] });
        (port.name.to_owned(), schema)
    };
    let ports: Map<String, Value> = (kind.inputs)().iter().map(port).collect();
    json!({ "description": "What the node reads.", "type": "object", "properties": ports, "additionalProperties": false })
}

/// A module, or what is laid over one of another file. Its nodes have parameters of the module in the place of any value, so that
/// little can be said of them here.
fn module(kinds: &[&str]) -> Value {
    let list = |what: &str| json!({ "description": what, "type": "array", "items": { "type": "string", "minLength": 1 }, "uniqueItems": true });
    json!({
        "type": "object",
        "additionalProperties": false,
        "properties": {
            "inputs": list("What it reads, named as `{input}` inside."),
            "required": list("Its parameters without a default."),
            "parameters": { "description": "Its parameters with a default, named as `{parameter}` inside.", "type": "object" },
            "outputs": {
                "description": "What it gives: a node inside, or a port of one. The first is the default.",
                "type": "object",
                "propertyNames": names_of("An output's name."),
                "additionalProperties": {
                    "description": "A node inside, or a port of one; or `false` for one that is inherited.",
                    "anyOf": [{ "type": "string", "minLength": 1 }, { "const": false }]
                }
            },
            "nodes": {
                "description": "Its nodes.",
                "type": "object",
                "propertyNames": names_of("A node's name."),
                "additionalProperties": {
                    "description": "A node; or `false` for one that is inherited.",
                    "if": { "type": "object" },
                    "then": {
                        "properties": {
                            "type": { "description": "The kind of node.", "anyOf": [{ "enum": kinds }, { "type": "string", "pattern": "\\{" }] },
                            "module": { "description": "The module that the node is an instance of, in place of `type`.", "type": "string" },
                            "inputs": { "description": "What the node reads.", "type": "object" }
                        }
                    },
                    "else": { "const": false }
                }
            },
            "modules": {
                "description": "Modules that its nodes see beside those of the graph.",
                "type": "object",
                "additionalProperties": { "$ref": "#/definitions/Module" }
            },
            "from": { "description": "The file that the module is taken from, relative to this one; other keys are laid over it.", "type": "string" },
            "module": { "description": "Its name in that file, if it is another.", "type": "string" }
        }
    })
}

fn names_of(what: &str) -> Value {
    json!({ "description": what, "pattern": "^\\p{L}[\\p{L}\\p{N}_-]*$" })
}

fn input(duration: &Value) -> Value {
    json!({
        "if": { "type": "object" },
        "then": {
            "properties": {
                "from": { "$ref": "#/definitions/References" },
                "max_age": described(duration, "How old a held value may be.")
            },
            "required": ["from"],
            "additionalProperties": false
        },
        "else": { "$ref": "#/definitions/References" }
    })
}

fn time(duration: &Value) -> Value {
    json!({
        "description": "How tabular sources give time.",
        "type": "object",
        "additionalProperties": false,
        "properties": {
            "column": {
                "description": "The column of the time of each row, or several in braces whose cells are put together.",
                "type": "string",
                "default": "time_s",
                "examples": ["time_ms", "{Date} {Time}"]
            },
            "unit": {
                "description": "The unit of its numbers, \"rfc3339\" for dates and times, or \"sample\" for sample numbers.",
                "enum": TIME_UNITS,
                "default": "s"
            },
            "step": described(duration, "The time from one sample number to the next."),
            "format": {
                "description": "How dates and times are written that are not as in RFC 3339, in the letters of strptime; `%z` is the offset from UTC.",
                "type": "string",
                "examples": ["%d.%m.%Y %H:%M:%S", "%m/%d/%Y %I:%M:%S %p", "%d.%m.%Y %H:%M:%S%.f"]
            },
            "zone": {
                "description": "Whose clock dates and times without an offset are read from: a zone of the tz database, or an offset from UTC.",
                "type": "string",
                "default": "UTC",
                "examples": ["Europe/Berlin", "America/New_York", "+01:00"]
            }
        }
    })
}

/// `[table]` with the keys of a file, which `[[table.files]]` has again beside the names that it is for.
fn table(format: &Value) -> Value {
    let mut file = format.clone();
    file["description"] = "What differs in some of several files.".into();
    file["properties"]["match"] = json!({
        "description": "The names of the files; `*`, `?` and `{a,b}` match.",
        "type": "string",
        "examples": ["temp*.csv"]
    });
    file["required"] = json!(["match"]);
    let mut table = format.clone();
    table["description"] =
        "How the text of a log is laid out; what is not declared is found in the file.".into();
    table["properties"]["files"] = json!({ "type": "array", "items": file });
    table
}

fn signal(unit: &Value, quantity: &Value, duration: &Value) -> Value {
    json!({
        "description": "A group of measured channels of one unit.",
        "type": "object",
        "additionalProperties": false,
        "properties": {
            "unit": described(unit, "The unit of the samples."),
            "channels": {
                "description": "The channels, or the set whose members they are.",
                "anyOf": [
                    { "type": "string" },
                    { "type": "array", "items": { "type": "string" }, "minItems": 1, "uniqueItems": true }
                ]
            },
            "column": { "description": "How tabular sources name a channel.", "type": "string", "default": "{channel}" },
            "range": {
                "description": "The lowest and highest value; one outside is absent, and counted.",
                "type": "array",
                "items": quantity,
                "minItems": 2,
                "maxItems": 2
            },
            "max_age": described(duration, "How long a held sample counts."),
            "optional": { "description": "Channels that the data may lack.", "type": "array", "items": { "type": "string" } }
        }
    })
}

fn output(quantity: &Value) -> Value {
    json!({
        "if": { "type": "object" },
        "then": {
            "properties": {
                "from": { "$ref": "#/definitions/References" },
                "blend": described(quantity, "When a graph is swapped, the rate at which the output passes from the old to the new.")
            },
            "required": ["from"],
            "additionalProperties": false
        },
        "else": {
            "if": { "type": "boolean" },
            "then": { "description": "False removes an inherited output.", "const": false },
            "else": { "$ref": "#/definitions/References" }
        }
    })
}

/// A shared schema with a description of its own; draft 7 reads nothing beside a `$ref`.
fn described(schema: &Value, description: &str) -> Value {
    json!({ "description": description, "allOf": [schema] })
}
