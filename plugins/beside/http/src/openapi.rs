//! The interface as OpenAPI describes it, made of what is declared: routes, and the types that they take and give.

use std::sync::LazyLock;

use athermal_serve::service::event_kinds;
use schemars::generate::{SchemaGenerator, SchemaSettings};
use serde_json::{Map, Value, json};

use crate::route::{Gives, Route, routes};

/// The description.
#[must_use]
pub fn openapi() -> &'static str {
    static TEXT: LazyLock<String> = LazyLock::new(|| format!("{:#}\n", description()));
    &TEXT
}

/// What may be answered besides: the status, what it means, and whether only orders are answered so.
const REFUSED: [(u16, &str, bool); 9] = [
    (400, "The request is not understood.", false),
    (401, "An order over TCP lacks the token.", true),
    (403, "`Host` or `Origin` is not right.", false),
    (408, "The body takes too long.", true),
    (409, "It cannot be done now; what runs is untouched.", true),
    (413, "The body has more than 8 MB.", true),
    (422, "The graph has mistakes; what runs is untouched.", true),
    (503, "Too many others wait, or the service ends.", false),
    (504, "The service does not answer in time.", false),
];

fn description() -> Value {
    let settings = SchemaSettings::draft2020_12().for_serialize();
    let settings = settings.with(|of| of.definitions_path = "/components/schemas".into());
    let mut generator = SchemaGenerator::new(settings);
    // What is taken may lack what has a usual value.
    let taken = SchemaSettings::draft2020_12().with(|of| of.inline_subschemas = true);
    let mut taken = SchemaGenerator::new(taken);
    let mut paths = Map::new();
    for route in routes() {
        let of =
            json!({ route.method.to_lowercase(): operation(route, &mut generator, &mut taken) });
        paths.entry(route.path).or_insert(of);
    }
    let events = events(&mut generator);
    let mut schemas = generator.take_definitions(false);
    let names: Vec<_> = event_kinds().map(|of| of.name).collect();
    if let Some(event) = schemas.get_mut("EventFacts") {
        event["properties"]["event"]["enum"] = json!(names);
        event["oneOf"] = json!(events);
    }
    schemas.insert("Error".to_owned(), error());
    json!({
        "openapi": "3.1.0",
        "info": {
            "title": "Control of a service of athermal",
            "version": "1",
            "description": "HTTP/1.1 on a Unix socket, and on loopback where the machine file asks for it. Over TCP `Host` is to be a literal loopback name, and orders need the token of the state folder.",
        },
        "paths": paths,
        "components": {
            "schemas": schemas,
            "securitySchemes": { "token": { "type": "http", "scheme": "bearer" } },
        },
    })
}

fn operation(route: &Route, generator: &mut SchemaGenerator, taken: &mut SchemaGenerator) -> Value {
    let is_order = route.method == "POST";
    let content = match route.gives {
        Gives::Json(schema) => json!({ "application/json": { "schema": schema(generator) } }),
        Gives::Text(of) => {
            json!({ of.split(';').next().unwrap_or(of): { "schema": { "type": "string" } } })
        }
    };
    let done = match is_order {
        true => "It is done, or will be before the next tick.",
        false => "As asked for.",
    };
    let mut responses = Map::new();
    responses.insert(
        "200".to_owned(),
        json!({ "description": done, "content": content }),
    );
    let refused =
        json!({ "application/json": { "schema": { "$ref": "#/components/schemas/Error" } } });
    for (status, description, of_orders) in REFUSED {
        if is_order || !of_orders {
            let of = json!({ "description": description, "content": refused });
            responses.insert(status.to_string(), of);
        }
    }
    let mut all = json!({ "summary": route.help, "responses": responses });
    if is_order {
        all["security"] = json!([{ "token": [] }]);
    }
    if !route.query.is_empty() {
        let query = route.query.iter().map(|(name, help)| {
            json!({ "name": name, "in": "query", "description": help, "schema": { "type": "string" } })
        });
        all["parameters"] = query.collect();
    }
    if let Some(body) = route.body {
        let content = json!({ "application/json": { "schema": body(taken) } });
        all["requestBody"] = json!({ "required": false, "content": content });
    }
    all
}

/// Why something is refused, with the mistakes of a graph.
fn error() -> Value {
    let [text, number] = ["string", "integer"].map(|of| json!({ "type": [of, "null"] }));
    json!({
        "type": "object",
        "properties": {
            "error": { "type": "string" },
            "text": { "type": "string", "description": "The mistakes of a graph with their places, for people." },
            "diagnostics": { "type": "array", "items": {
                "type": "object",
                "properties": {
                    "code": { "type": "string" },
                    "severity": { "type": "string" },
                    "file": text,
                    "line": number,
                    "column": number,
                    "span": {},
                    "message": { "type": "string" },
                    "help": text,
                },
                "required": ["code", "severity", "file", "line", "column", "message"],
            } },
        },
        "required": ["error"],
    })
}

/// What is known of each event.
fn events(generator: &mut SchemaGenerator) -> Vec<Value> {
    let event = |of: &athermal_core::event::EventKind| {
        let facts = of
            .facts
            .iter()
            .map(|(key, schema)| ((*key).to_owned(), schema(generator).into()));
        let facts: Map<String, Value> = facts.collect();
        json!({
            "description": of.help.trim(),
            "properties": { "event": { "const": of.name }, "facts": { "type": "object", "properties": facts } },
        })
    };
    event_kinds().map(event).collect()
}
