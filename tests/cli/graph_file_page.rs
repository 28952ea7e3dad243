//! The page on graph files: no key of the schema is missing on it, and what it shows is right. What a key means is not tested here.

use std::collections::BTreeSet;
use std::path::Path;

use athermal as _;
use athermal::core::compile::{Wanted, compile};
use athermal::core::diagnostic::{Diagnostics, Sources, codes};
use athermal::core::document::{Memory, declare, load};
use athermal::core::node::NodeKind;
use athermal::core::registry::all;
use athermal::schema::graph_schema;
use athermal::trial;
use athermal_serve::connector::{SinkKind, SourceKind};
use serde_json::Value;

const PAGE: &str = include_str!("../../docs/src/graph-file.md");

/// The keys that a schema gives its tables, and those of all that it refers to.
fn keys(schema: &Value, definitions: &Value) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    let mut followed = BTreeSet::new();
    let mut open = vec![schema];
    while let Some(value) = open.pop() {
        match value {
            Value::Array(list) => open.extend(list),
            Value::Object(of) => {
                if let Some(Value::Object(properties)) = of.get("properties") {
                    found.extend(properties.keys().cloned());
                }
                if let Some(Value::String(target)) = of.get("$ref") {
                    let name = target.strip_prefix("#/definitions/").unwrap();
                    open.extend(followed.insert(name).then(|| &definitions[name]));
                }
                open.extend(of.values());
            }
            _ => {}
        }
    }
    found
}

/// The schema without what the types of nodes and the kinds of sources and sinks bring: their inputs and their own parameters.
fn schema_of_the_framework() -> Value {
    let mut schema = graph_schema();
    let node = &mut schema["definitions"]["Node"]["then"];
    let types = node["allOf"].as_array_mut().unwrap();
    assert_eq!(types.len(), all::<NodeKind>().count());
    for (kind, choice) in all::<NodeKind>().zip(types) {
        let common = ["type", "each", "inputs"];
        let framework = kind.framework_keys();
        let properties = choice["then"]["properties"].as_object_mut().unwrap();
        properties.retain(|key, _| common.contains(&key.as_str()) || framework.contains(&&**key));
        let ports = properties["inputs"]["properties"].as_object_mut().unwrap();
        let one = ports.values().next().cloned();
        properties["inputs"] = one.unwrap_or_default();
    }
    let sources = all::<SourceKind>().map(|kind| (kind.schema)());
    let sinks = all::<SinkKind>().map(|kind| (kind.schema)());
    for (section, kinds) in [
        ("sources", sources.collect::<Vec<_>>()),
        ("sinks", sinks.collect()),
    ] {
        let choices = &mut schema["properties"][section]["additionalProperties"]["else"]["allOf"];
        for (kind, choice) in kinds.into_iter().zip(choices.as_array_mut().unwrap()) {
            let properties = choice["then"]["properties"].as_object_mut().unwrap();
            properties.retain(|key, _| kind["properties"].get(key).is_none());
        }
    }
    schema
}

/// The part of the page under the heading that names a table of the file.
fn section(key: &str) -> &'static str {
    let heading = format!("[{key}");
    let mut sections = PAGE.split("\n## ").skip(1);
    sections
        .find(|section| section.lines().next().unwrap().contains(&heading))
        .unwrap_or_else(|| panic!("no heading of the page names `{heading}`"))
}

/// The blocks of the page that are TOML.
fn blocks() -> Vec<&'static str> {
    let blocks = PAGE.split("\n```toml\n").skip(1);
    blocks
        .map(|block| block.split_once("\n```").unwrap().0)
        .collect()
}

fn is_whole(block: &str) -> bool {
    block.lines().any(|line| line == "schema = 1")
}

/// The whole graphs of the page, each under its name.
fn shown() -> Memory {
    let whole = blocks().into_iter().filter(|block| is_whole(block));
    whole.fold(Memory::new(), |files, block| {
        let named = block.lines().find_map(|line| line.strip_prefix("name = "));
        let name = named.unwrap().trim_matches('"');
        files.with(format!("{name}.toml"), block)
    })
}

/// What `check` tells of a text that stands beside the graphs of the page.
fn check(text: &str) -> (Diagnostics, Sources) {
    let files = shown().with("graph.toml", text);
    let (mut sources, mut diagnostics) = (Sources::new(), Diagnostics::new());
    let path = Path::new("graph.toml");
    let document = load(path, &files, &mut sources, &mut diagnostics);
    let graph = document.and_then(|document| declare(document, &mut diagnostics));
    if let Some(graph) = graph
        && let Some(plan) = compile(&graph, Wanted::default(), &mut diagnostics)
    {
        trial::declare(&graph, &plan, &files, &mut sources, &mut diagnostics);
    }
    (diagnostics, sources)
}

#[test]
fn every_key_of_the_schema_stands_in_the_section_of_its_table() {
    let schema = schema_of_the_framework();
    let mut missing = Vec::new();
    for (name, of) in schema["properties"].as_object().unwrap() {
        let mut look_for = |key: &str, within: &str| {
            if !within.contains(&format!("`{key}`")) {
                missing.push(format!("`{key}` of {name}"));
            }
        };
        look_for(name, PAGE);
        for key in keys(of, &schema["definitions"]) {
            look_for(&key, section(name));
        }
    }
    assert!(missing.is_empty(), "{}", missing.join(", "));
}

#[test]
fn every_key_in_a_table_of_the_page_is_one_of_the_schema() {
    let schema = graph_schema();
    let tables = schema["properties"].as_object().unwrap();
    let mut wrong = Vec::new();
    for section in PAGE.split("\n## ").skip(1) {
        let heading = section.lines().next().unwrap();
        let named = tables.iter();
        let named = named.filter(|(name, _)| {
            heading.contains(&format!("[{name}")) || heading.contains(&format!("`{name}`"))
        });
        let mut known = BTreeSet::new();
        for (name, of) in named {
            known.extend(keys(of, &schema["definitions"]));
            known.insert(name.clone());
        }
        for row in section.lines().filter(|line| line.starts_with("| `")) {
            let cell = row.split(" | ").next().unwrap();
            let found = cell.split('`').skip(1).step_by(2);
            let found = found.filter(|key| !known.is_empty() && !known.contains(*key));
            wrong.extend(found.map(|key| format!("`{key}` under {heading}")));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join(", "));
}

#[test]
fn the_keys_that_are_looked_for_are_those_of_every_depth() {
    let schema = schema_of_the_framework();
    let of = |key: &str| keys(&schema["properties"][key], &schema["definitions"]);
    for (table, key) in [
        ("time", "format"),
        ("nodes", "max_age"),
        ("nodes", "below"),
        ("nodes", "margin"),
        ("modules", "required"),
        ("tests", "simulate"),
        ("tests", "size"),
        ("runtime", "heartbeat"),
    ] {
        assert!(of(table).contains(key), "`{key}` of {table}");
    }
    assert!(!of("nodes").contains("windows"), "a parameter of a type");
}

#[test]
fn every_whole_graph_of_the_page_is_without_a_mistake_or_a_warning() {
    let whole: Vec<&str> = blocks()
        .into_iter()
        .filter(|block| is_whole(block))
        .collect();
    assert!(whole.len() > 1);
    for block in whole {
        let (diagnostics, sources) = check(block);
        let told = diagnostics.render(&sources, false, 100);
        assert!(diagnostics.is_empty(), "{told}");
    }
}

#[test]
fn every_other_example_can_be_added_to_the_first_graph() {
    for block in blocks().into_iter().filter(|block| !is_whole(block)) {
        let text = format!("schema = 1\nextends = \"stage.toml\"\n{block}");
        let (diagnostics, sources) = check(&text);
        let told = diagnostics.render(&sources, false, 100);
        assert!(!diagnostics.has_errors(), "{told}");
    }
}

#[test]
fn every_code_that_the_page_names_can_be_explained() {
    let words = PAGE.split(|c: char| !c.is_ascii_alphanumeric());
    let is_code = |word: &&str| {
        word.strip_prefix('A').is_some_and(|number| {
            number.len() == 3 && number.bytes().all(|digit| digit.is_ascii_digit())
        })
    };
    let named: BTreeSet<&str> = words.filter(is_code).collect();
    assert!(named.len() > 20);
    for code in named {
        assert!(codes().iter().any(|known| known.code == code), "{code}");
    }
}
