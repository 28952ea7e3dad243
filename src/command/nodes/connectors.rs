//! The kinds of sources and sinks, beside the node types.

use std::collections::BTreeMap;

use athermal_analysis::figures::{page, paragraph};
use athermal_serve::connector::{ConnectorKind, sink_kind, sink_kinds, source_kind, source_kinds};
use serde_json::{Map, Value, json};

use super::parameters;
use crate::terminal::{Format, Terminal};

/// The names of all kinds.
pub fn names() -> impl Iterator<Item = &'static &'static str> {
    source_kinds().keys().chain(sink_kinds().keys())
}

/// Lists all kinds, by the crates that bring them.
pub fn list() {
    group("sources", source_kinds());
    group("sinks", sink_kinds());
}

fn group<S: ?Sized>(role: &str, kinds: &BTreeMap<&str, &ConnectorKind<S>>) {
    let package = |kind: &ConnectorKind<S>| (kind.package, kind.version);
    let mut packages: Vec<_> = kinds.values().map(|kind| package(kind)).collect();
    packages.sort_unstable();
    packages.dedup();
    for of in packages {
        println!("{role}, from {} {}", of.0, of.1);
        for kind in kinds.values().filter(|kind| package(kind) == of) {
            let name = format!("  {:<18} ", kind.name);
            print!("{}", paragraph(&name, name.len(), &kind.summary()));
        }
    }
}

/// All sources and all sinks, for programs.
pub fn describe_all() -> (Vec<Value>, Vec<Value>) {
    let sources = source_kinds().values().map(|kind| describe(kind));
    let sinks = sink_kinds().values().map(|kind| describe(kind));
    (sources.collect(), sinks.collect())
}

fn describe<S: ?Sized>(kind: &ConnectorKind<S>) -> Value {
    json!({
        "name": kind.name,
        "summary": kind.summary(),
        "package": kind.package,
        "version": kind.version,
        "parameters": (kind.schema)(),
    })
}

/// Explains the source and the sink of a name; false where there is neither.
pub fn explain(terminal: &Terminal, name: &str) -> bool {
    let (source, sink) = (source_kind(name), sink_kind(name));
    if terminal.format == Format::Json {
        let mut both = Map::new();
        both.extend(source.map(|kind| ("source".to_owned(), describe(kind))));
        both.extend(sink.map(|kind| ("sink".to_owned(), describe(kind))));
        if !both.is_empty() {
            println!("{:#}", Value::Object(both));
        }
    } else {
        if let Some(kind) = source {
            explain_one("source", kind);
        }
        if let (Some(_), Some(_)) = (source, sink) {
            println!();
        }
        if let Some(kind) = sink {
            explain_one("sink", kind);
        }
    }
    source.is_some() || sink.is_some()
}

fn explain_one<S: ?Sized>(role: &str, kind: &ConnectorKind<S>) {
    let (name, package, version) = (kind.name, kind.package, kind.version);
    println!("{name} ({role}, from {package} {version})\n");
    println!("{}", page(kind.documentation()));
    println!("Parameters:");
    let explained = parameters::explain((kind.schema)());
    match explained.is_empty() {
        true => println!("  none"),
        false => print!("{explained}"),
    }
}
