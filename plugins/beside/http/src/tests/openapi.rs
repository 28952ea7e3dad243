//! The description of the interface, held against what is answered.

use serde_json::{Value, json};

use super::{Bench, GRAPH};
use crate::{openapi, routes};

/// A schema without its reference.
fn resolved<'a>(schema: &'a Value, whole: &'a Value) -> &'a Value {
    let reference = schema["$ref"].as_str();
    reference.map_or(schema, |of| {
        whole.pointer(of.trim_start_matches('#')).unwrap()
    })
}

/// The alternatives that a schema has.
fn alternatives(schema: &Value) -> impl Iterator<Item = &Vec<Value>> {
    ["anyOf", "oneOf"]
        .into_iter()
        .filter_map(|of| schema[of].as_array())
}

/// Whether a schema describes a key, be it in an alternative.
fn knows(schema: &Value, key: &str, whole: &Value) -> bool {
    let schema = resolved(schema, whole);
    let is_open = schema["properties"].is_null() && alternatives(schema).next().is_none();
    is_open
        || !schema["properties"][key].is_null()
        || alternatives(schema)
            .flatten()
            .any(|of| knows(of, key, whole))
}

/// What of a value does not fit a schema, where the schema says types, keys, items, choices, alternatives and references.
fn misfits(schema: &Value, value: &Value, at: &str, whole: &Value, found: &mut Vec<String>) {
    let schema = resolved(schema, whole);
    for all in alternatives(schema) {
        let fits = |of: &Value| {
            let mut found = Vec::new();
            misfits(of, value, at, whole, &mut found);
            found.iter().all(|of| of.ends_with("is not described"))
        };
        if !all.iter().any(fits) {
            found.push(format!("{at}: {value} is none of {all:?}"));
        }
    }
    let types: Vec<&str> = match &schema["type"] {
        Value::String(one) => vec![one],
        Value::Array(several) => several.iter().filter_map(Value::as_str).collect(),
        _ => Vec::new(),
    };
    let fits = types.iter().any(|of| match *of {
        "string" => value.is_string(),
        "number" => value.is_number(),
        "integer" => value.is_u64() || value.is_i64(),
        "boolean" => value.is_boolean(),
        "null" => value.is_null(),
        "array" => value.is_array(),
        "object" => value.is_object(),
        other => panic!("{other}"),
    });
    if !fits && !types.is_empty() {
        found.push(format!("{at}: {value} is none of {types:?}"));
    }
    let choice = schema.get("const").map(std::slice::from_ref);
    if let Some(choices) = schema["enum"].as_array().map(Vec::as_slice).or(choice)
        && !choices.contains(value)
    {
        found.push(format!("{at}: {value} is none of {choices:?}"));
    }
    for item in value.as_array().into_iter().flatten() {
        misfits(&schema["items"], item, &format!("{at}[]"), whole, found);
    }
    let Some(keys) = value.as_object() else {
        return;
    };
    for required in schema["required"].as_array().into_iter().flatten() {
        if !keys.contains_key(required.as_str().unwrap()) {
            found.push(format!("{at}: {required} is missing"));
        }
    }
    for (key, value) in keys {
        if !knows(schema, key, whole) {
            found.push(format!("{at}.{key} is not described"));
        }
        misfits(
            &schema["properties"][key],
            value,
            &format!("{at}.{key}"),
            whole,
            found,
        );
    }
}

#[test]
fn the_description_has_all_that_is_answered_and_what_is_answered_is_as_described() {
    let whole: Value = serde_json::from_str(openapi()).unwrap();
    let paths = whole["paths"].as_object().unwrap();
    let described = paths.iter().flat_map(|(path, of)| {
        let methods = of.as_object().unwrap().keys();
        methods.map(move |method| (method.to_uppercase(), path.clone()))
    });
    let mut described: Vec<_> = described.collect();
    let mut answered: Vec<_> = routes()
        .map(|of| (of.method.to_owned(), of.path.to_owned()))
        .collect();
    described.sort();
    answered.sort();
    assert_eq!(described, answered);

    let mut bench = Bench::start(GRAPH, "");
    let next = bench.path("next.toml");
    std::fs::write(&next, GRAPH.replace("\"1min\"", "\"2min\"")).unwrap();
    let wrong = bench.path("wrong.toml");
    std::fs::write(&wrong, GRAPH.replace("slope", "slop")).unwrap();
    let path = |path: &std::path::Path| json!({ "path": path });
    let shadow = json!({ "duration": "1s", "margin": 0.5 });
    let nothing = || json!({});
    let orders = [
        ("/v1/commit", nothing(), 409),
        ("/v1/rollback", nothing(), 409),
        ("/v1/discard", nothing(), 409),
        ("/v1/shadow", shadow.clone(), 409),
        ("/v1/shadow", json!({ "duration": "-1s" }), 400),
        (
            "/v1/shadow",
            json!({ "duration": "1s", "margin": -1.0 }),
            400,
        ),
        ("/v1/stage", json!({ "path": "relative.toml" }), 400),
        ("/v1/stage", json!({ "paht": "x" }), 400),
        ("/v1/stage", path(&wrong), 422),
        ("/v1/stage", json!({ "model": "{}" }), 422),
        ("/v1/stage", path(&next), 200),
        ("/v1/shadow", shadow, 200),
        ("/v1/discard", nothing(), 200),
        ("/v1/stage", path(&next), 200),
        ("/v1/commit", nothing(), 200),
        ("/v1/freeze", nothing(), 200),
        ("/v1/thaw", nothing(), 200),
        ("/v1/snapshot", nothing(), 200),
    ];
    let mut found = Vec::new();
    let mut check = |method: &str, path: &str, reply: &crate::client::Reply| {
        let at = format!("{method} {path} {}", reply.status);
        let of = &whole["paths"][path][method]["responses"][reply.status.to_string()];
        let schema = &of["content"]["application/json"]["schema"];
        if of.is_null() {
            found.push(format!("{at} is not described"));
        } else if !schema.is_null() {
            misfits(schema, &reply.json(), &at, &whole, &mut found);
        }
    };
    for (path, body, status) in orders {
        let reply = bench.post(path, &body);
        assert_eq!(reply.status, status, "{path} {body}: {:#}", reply.json());
        check("post", path, &reply);
    }
    bench.until("the swap", |of| of["previous"].is_string());
    for of in routes() {
        let path = of.path;
        if of.method == "GET" && path != "/v1/events" {
            let reply = bench.get(path);
            assert_eq!(reply.status, 200, "{path}");
            check("get", path, &reply);
        }
    }
    assert_eq!(found, [""; 0]);
    bench.stop();
}
