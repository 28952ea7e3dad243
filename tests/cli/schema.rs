//! The JSON Schema of graph files: the one beside the shipped graphs is the one that the program prints, for the kinds that it has.

use crate::workbench::{athermal, graph};
use athermal as _;
use athermal::core::node::NodeKind;
use athermal::core::registry::{all, find};
use athermal::schema::graph_schema;
use serde_json::Value;

#[cfg_attr(
    any(
        feature = "parquet",
        feature = "opcua",
        feature = "sparkplug",
        feature = "influx",
        feature = "postgres"
    ),
    ignore = "it is of the program without these features, which bring kinds of sources and sinks"
)]
#[test]
fn the_schema_beside_the_graphs_is_the_one_that_is_printed() {
    let committed = graph("x").with_file_name("athermal.schema.json");
    let committed = std::fs::read_to_string(committed).unwrap();
    let printed = athermal(&[&"schema"]).ended(0).out;
    assert!(
        printed == committed,
        "run `athermal schema -o graphs/athermal.schema.json`"
    );
}

#[test]
fn every_kind_has_its_keys_behind_its_type() {
    let schema = graph_schema();
    let node = &schema["definitions"]["Node"]["then"];
    let types: Vec<&str> = node["properties"]["type"]["enum"]
        .as_array()
        .unwrap()
        .iter()
        .map(|name| name.as_str().unwrap())
        .collect();
    assert_eq!(
        types,
        all::<NodeKind>().map(|kind| kind.name).collect::<Vec<_>>()
    );
    for (nth, name) in types.iter().enumerate() {
        let choice = &node["allOf"][nth];
        assert_eq!(choice["if"]["properties"]["type"]["const"], *name);
        let keys = choice["then"]["properties"].as_object().unwrap();
        let kind = find::<NodeKind>(name).unwrap();
        let own = (kind.schema)()["properties"]
            .as_object()
            .into_iter()
            .flatten();
        for key in own
            .map(|(key, _)| key.as_str())
            .chain(["type", "each", "inputs"])
        {
            assert!(keys.contains_key(key), "`{key}` of {name}");
        }
        for port in (kind.inputs)() {
            assert!(
                keys["inputs"]["properties"].get(port.name).is_some(),
                "inputs.{} of {name}",
                port.name
            );
        }
    }
    let slope = types.iter().position(|name| *name == "slope").unwrap();
    let slope = &node["allOf"][slope]["then"]["properties"];
    assert_eq!(slope["min_samples"]["minimum"].as_f64(), Some(2.0));
    assert_eq!(slope["min_samples"]["default"].as_f64(), Some(3.0));
}

#[test]
fn every_reference_leads_to_a_definition() {
    fn targets<'a>(value: &'a Value, into: &mut Vec<&'a str>) {
        match value {
            Value::Array(list) => list.iter().for_each(|item| targets(item, into)),
            Value::Object(keys) => {
                into.extend(keys.get("$ref").and_then(Value::as_str));
                keys.values().for_each(|item| targets(item, into));
            }
            _ => {}
        }
    }
    let schema = graph_schema();
    let mut found = Vec::new();
    targets(&schema, &mut found);
    assert!(found.len() > 20);
    for target in found {
        let name = target.strip_prefix("#/definitions/").unwrap();
        assert!(schema["definitions"].get(name).is_some(), "{target}");
    }
}
