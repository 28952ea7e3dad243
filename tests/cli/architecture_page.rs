//! The page on the architecture names files that are there, and what it says is so: no kind is named in the core, no crate uses one that
//! stands behind it, and no job knows a terminal.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use athermal::core::node::NodeKind;
use athermal::core::registry::all;
use athermal::serve::connector::{SinkKind, SourceKind};
use athermal::trial::machine::KnownMachine;

/// All files below a folder.
fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path());
    let below = entries.flat_map(|path| match path.is_dir() {
        true => files(&path),
        false => vec![path],
    });
    below.collect()
}

/// Words that name something else as well: statistics of thinning and of a prior, keys of a shape, rivals of an expectation, headings of a
/// table, outputs of a graph that is written.
const OF_SOMETHING_ELSE: [(&str, &str); 10] = [
    ("core/run/src/recording/thin.rs", "mean median"),
    ("core/serve/src/deployment/sources.rs", "mean median"),
    ("core/trial/src/shape.rs", "delay"),
    ("core/trial/src/expect.rs", "zero persistence"),
    ("core/trial/src/declare.rs", "zero persistence"),
    ("core/trial/src/judge.rs", "zero persistence"),
    (
        "core/graph/src/document/declare/modules/references.rs",
        "zero persistence",
    ),
    (
        "core/analysis/src/report/page/tables.rs",
        "persistence health",
    ),
    ("core/analysis/src/report/recomputed.rs", "settled"),
    ("core/numerics/src/prior.rs", "mean"),
];

#[test]
fn no_text_in_the_core_names_a_kind_of_node_source_sink_or_machine() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let kinds: BTreeSet<&str> = (all::<NodeKind>().map(|of| of.name))
        .chain(all::<SourceKind>().map(|of| of.name))
        .chain(all::<SinkKind>().map(|of| of.name))
        .chain(all::<KnownMachine>().map(|of| of.name))
        .collect();
    assert!(kinds.len() > 50, "{kinds:?}");
    let (mut found, mut read) = (Vec::new(), 0);
    for path in files(&root.join("core")) {
        let name = path.strip_prefix(root).unwrap().to_str().unwrap();
        let is_test = name.contains("/tests/") || name.ends_with("/tests.rs");
        let is_source = name.contains("/src/") && name.ends_with(".rs");
        if !is_source || is_test || name.starts_with("core/testkit/") {
            continue;
        }
        read += 1;
        let text = fs::read_to_string(&path).unwrap().replace("\\\"", "\"");
        let code = text.split("#[cfg(test)]\nmod tests {").next().unwrap();
        let lines = code
            .lines()
            .filter(|line| !line.trim_start().starts_with("//"));
        let others = OF_SOMETHING_ELSE.iter().filter(|(file, _)| *file == name);
        let others: Vec<&str> = others.flat_map(|(_, words)| words.split(' ')).collect();
        for line in lines {
            let texts = line.split('"').skip(1);
            let named = texts.filter(|text| kinds.contains(text) && !others.contains(text));
            found.extend(named.map(|kind| format!("{name}: {kind}: {}", line.trim())));
        }
    }
    assert!(read > 200, "{read} files");
    assert!(found.is_empty(), "{found:#?}");
}

/// The folders, in the order of who may know whom: each knows itself and those before it.
const FOLDERS: [&str; 6] = [
    "core",
    "plugins/nodes",
    "plugins/io",
    "plugins/work",
    "plugins/beside",
    "plugins/apps",
];

#[test]
fn a_crate_uses_only_crates_of_its_folder_and_of_those_before_it() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let crates = FOLDERS.iter().enumerate().flat_map(|(rank, folder)| {
        let all = fs::read_dir(root.join(folder)).unwrap();
        all.map(move |of| (rank, of.unwrap().path().join("Cargo.toml")))
    });
    let read = |(rank, path): (usize, PathBuf)| {
        let manifest: toml::Table = toml::from_str(&fs::read_to_string(path).unwrap()).unwrap();
        let name = manifest["package"]["name"].as_str().unwrap().to_owned();
        let uses = manifest.get("dependencies").and_then(toml::Value::as_table);
        let uses: Vec<String> = uses
            .into_iter()
            .flatten()
            .map(|(key, _)| key.clone())
            .collect();
        (name, (rank, uses))
    };
    let crates: BTreeMap<String, (usize, Vec<String>)> = crates.map(read).collect();
    assert!(crates.len() > 25, "{crates:?}");
    for (name, (rank, uses)) in &crates {
        let is_up = |of: &&String| crates.get(*of).is_some_and(|(other, _)| other > rank);
        let up: Vec<_> = uses.iter().filter(is_up).collect();
        assert!(up.is_empty(), "{name} uses {up:?}");
    }
}

#[test]
fn no_job_knows_a_terminal_or_keeps_anything_outside_of_its_options() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let words = [
        "erminal",
        "thread_local",
        "static ",
        "println!",
        "print!",
        "env::args",
    ];
    let mut found = Vec::new();
    for path in files(&root.join("plugins/work")) {
        let text = fs::read_to_string(&path).unwrap_or_default();
        let code = text.split("#[cfg(test)]\nmod tests {").next().unwrap();
        let lines = code
            .lines()
            .filter(|line| !line.trim_start().starts_with("//"));
        let known = lines.filter(|line| {
            words.iter().any(|word| {
                line.replace("'static ", "")
                    .replace("static FORMATS: LazyLock<", "")
                    .contains(word)
            })
        });
        found.extend(known.map(|line| format!("{}: {line}", path.display())));
    }
    assert!(found.is_empty(), "{found:#?}");
}

#[test]
fn every_path_on_the_page_of_the_architecture_is_there() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let page = fs::read_to_string(root.join("docs/src/architecture.md")).unwrap();
    let of_the_tree = |path: &&str| {
        let folders = ["core/", "plugins/", "src/", "tests/", "graphs/", ".ci/"];
        folders.iter().any(|folder| path.starts_with(folder)) && !path.contains('*')
    };
    let quoted = page.split('`').skip(1).step_by(2);
    let paths: Vec<_> = quoted.filter(of_the_tree).collect();
    let missing: Vec<_> = paths
        .iter()
        .filter(|path| !root.join(path).exists())
        .collect();
    assert!(paths.len() > 20, "{paths:?}");
    assert!(missing.is_empty(), "{missing:?}");
}
