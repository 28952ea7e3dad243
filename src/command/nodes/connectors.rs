//! The kinds of sources and sinks, beside the node types.

use athermal::core::registry::{Registered, Sort, all, find};
use athermal_analysis::figures::{page, paragraph};
use athermal_serve::connector::{SinkKind, SourceKind};
use serde_json::{Map, Value, json};

use super::parameters;
use crate::terminal::{Format, Terminal};

/// Lists all kinds, by the crates that bring them.
pub fn list() {
    group::<SourceKind>("sources");
    group::<SinkKind>("sinks");
}

fn group<T: Sort>(role: &str) {
    let mut packages: Vec<_> = all::<T>()
        .map(|kind| (kind.package, kind.version))
        .collect();
    packages.sort_unstable();
    packages.dedup();
    for (package, version) in packages {
        println!("{role}, from {package} {version}");
        for kind in all::<T>().filter(|kind| (kind.package, kind.version) == (package, version)) {
            let name = format!("  {:<18} ", kind.name);
            print!("{}", paragraph(&name, name.len(), &kind.summary()));
        }
    }
}

/// All of a sort, for programs.
pub fn describe_all<T: Sort>() -> Vec<Value> {
    all::<T>().map(describe).collect()
}

fn describe<T>(kind: &Registered<T>) -> Value {
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
    let (source, sink) = (find::<SourceKind>(name).ok(), find::<SinkKind>(name).ok());
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

fn explain_one<T>(role: &str, kind: &Registered<T>) {
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
