//! Decides the JSON Schema of graph files, for exactly the kinds that are linked in; what a kind's parameters are is decided by the kind.

use schemars::JsonSchema;
use schemars::generate::SchemaSettings;
use serde_json::{Map, Value, json};

use athermal_core::compile::EstimatorKeys;
use athermal_core::document::{TIME_UNITS, TableFormat};
use athermal_core::node::{InputPort, Kind, NodeKind, Read};
use athermal_core::quantity::Quantity;
use athermal_core::registry::{Sort, all};
use athermal_core::time::Duration;
use athermal_core::unit::Unit;
use athermal_serve::companion::CompanionKind;
use athermal_serve::connector::{ConnectorKind, Sink, Source};
use athermal_serve::deployment;
use athermal_trial::TestTable;

/// What is the same whatever kinds are linked in. What depends on them is empty there.
const FRAME: &str = include_str!("frame.json");

/// The JSON Schema (draft 7, which editors understand) of graph files, as text.
///
/// Each kind of node is an `if type … then …` of an `allOf`, so that an editor points at the value that is wrong and not at the node.
///
/// # Panics
/// Never: the frame is JSON.
#[must_use]
pub fn graph_schema() -> Value {
    let mut generator = SchemaSettings::draft07().into_generator();
    generator.subschema_for::<TestTable>();
    let framework = Value::from(EstimatorKeys::json_schema(&mut generator));
    generator.subschema_for::<Duration>();
    let format = Value::from(TableFormat::json_schema(&mut generator));
    generator.subschema_for::<Quantity>();
    generator.subschema_for::<Unit>();
    let format = as_draft_7(&format, &str::to_owned);
    let sections = deployment::schemas(&mut generator);
    let [runtime, source, sink] = sections.map(|schema| as_draft_7(&schema, &str::to_owned));
    let common = generator.take_definitions(true).into_iter();
    let common = common.map(|(name, schema)| (name, as_draft_7(&schema, &str::to_owned)));
    let mut definitions: Map<String, Value> = common.collect();
    let mut kinds: Vec<&Kind> = all::<NodeKind>().collect();
    kinds.dedup_by_key(|kind| kind.name);
    let node = |kind: &&Kind| node(kind, &framework, &mut definitions);
    let nodes: Value = kinds.iter().map(node).collect();
    let names: Vec<&str> = kinds.iter().map(|kind| kind.name).collect();
    let summaries: Vec<String> = kinds.iter().map(|kind| kind.summary()).collect();

    let mut schema: Value = serde_json::from_str(FRAME).expect("the frame is JSON");
    let frame = schema["description"].as_str().unwrap_or_default();
    schema["description"] = format!("{frame} Node types: {}.", names.join(", ")).into();
    schema["properties"]["time"]["properties"]["unit"]["enum"] = json!(TIME_UNITS);
    schema["properties"]["table"] = table(&format);
    schema["properties"]["runtime"] = runtime;
    for kind in all::<CompanionKind>().filter(|kind| !kind.name.is_empty()) {
        schema["properties"][kind.name] = adopt(kind.name, (kind.schema)(), &mut definitions);
    }
    let sources = connectors::<dyn Source>(&source, &mut definitions);
    schema["properties"]["sources"]["additionalProperties"] = sources;
    let sinks = connectors::<dyn Sink>(&sink, &mut definitions);
    schema["properties"]["sinks"]["additionalProperties"] = sinks;
    let node = &mut schema["definitions"]["Node"]["then"];
    node["properties"]["type"]["enum"] = json!(names);
    node["properties"]["type"]["x-taplo"]["docs"]["enumValues"] = json!(summaries);
    node["allOf"] = nodes;
    let inside = &mut schema["definitions"]["Module"]["properties"]["nodes"];
    let inside = &mut inside["additionalProperties"]["then"]["properties"];
    inside["type"]["anyOf"][0]["enum"] = json!(names);
    if let Value::Object(shared) = schema["definitions"].take() {
        definitions.extend(shared);
    }
    schema["definitions"] = definitions.into();
    schema
}

/// Takes the definitions of a kind over to `taken`, and gives its schema with references to them. A name that another kind has for
/// something else gets the kind's name in front.
fn adopt(kind: &str, schema: &Value, taken: &mut Map<String, Value>) -> Value {
    let mut schema = schema.clone();
    let own = schema["$defs"].take();
    let own: Vec<(&String, &Value)> = own.as_object().into_iter().flatten().collect();
    let clashes = |name: &str, schema: &Value| {
        let plain = as_draft_7(schema, &str::to_owned);
        taken.get(name).is_some_and(|taken| *taken != plain)
    };
    let clashing = own.iter().filter(|(name, schema)| clashes(name, schema));
    let clashing: Vec<&str> = clashing.map(|(name, _)| name.as_str()).collect();
    let rename = |name: &str| match clashing.contains(&name) {
        true => format!("{kind}.{name}"),
        false => name.to_owned(),
    };
    for (name, schema) in &own {
        taken.insert(rename(name), as_draft_7(schema, &rename));
    }
    as_draft_7(&schema, &rename)
}

/// A schema of draft 2020-12 as one of draft 7: definitions stand elsewhere, and nothing counts beside a `$ref`.
fn as_draft_7(schema: &Value, rename: &dyn Fn(&str) -> String) -> Value {
    match schema {
        Value::Array(list) => list.iter().map(|item| as_draft_7(item, rename)).collect(),
        Value::Object(keys) => {
            let mut made = Map::new();
            for (key, value) in keys
                .iter()
                .filter(|(key, _)| !["$schema", "$defs", "title"].contains(&key.as_str()))
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
fn node(kind: &Kind, framework: &Value, definitions: &mut Map<String, Value>) -> Value {
    let mut parameters = adopt(kind.name, (kind.schema)(), definitions);
    let mut properties = json!({
        "type": { "description": kind.documentation() },
        "each": {
            "description": "The set, or sets, over whose members the node is expanded; `{set}` in its texts is the member.",
            "anyOf": [{ "type": "string" }, { "type": "array", "items": { "type": "string" }, "minItems": 1 }]
        },
        "inputs": inputs(kind)
    });
    for &key in kind.framework_keys() {
        properties[key] = framework["properties"][key].clone();
    }
    if let Value::Object(own) = parameters["properties"].take() {
        for (key, schema) in own {
            properties[key] = schema;
        }
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
    let port = |port: &InputPort| {
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

/// A source or a sink: the keys that each has, and those of its kind behind its `type`.
fn connectors<S: ?Sized>(shared: &Value, definitions: &mut Map<String, Value>) -> Value
where
    ConnectorKind<S>: Sort,
{
    let kinds = all::<ConnectorKind<S>>();
    let names: Vec<&str> = kinds.clone().map(|kind| kind.name).collect();
    let texts: Vec<String> = kinds.clone().map(|kind| kind.summary()).collect();
    let choices = kinds.map(|kind| {
        let own = adopt(kind.name, (kind.schema)(), definitions);
        let mut properties = json!({ "type": { "description": kind.documentation() } });
        for keys in [shared, &own] {
            for (key, schema) in keys["properties"].as_object().into_iter().flatten() {
                properties[key] = schema.clone();
            }
        }
        json!({
            "if": { "properties": { "type": { "const": kind.name } }, "required": ["type"] },
            "then": { "properties": properties, "additionalProperties": false }
        })
    });
    let choices: Vec<Value> = choices.collect();
    let docs = json!({ "docs": { "enumValues": texts } });
    json!({
        "if": { "type": "boolean" },
        "then": { "description": "False removes an inherited one.", "const": false },
        "else": {
            "type": "object",
            "properties": { "type": { "description": "Its kind.", "enum": names, "x-taplo": docs } },
            "allOf": choices
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
