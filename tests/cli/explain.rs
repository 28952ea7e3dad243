//! Every code's page holds: its wrong example has that mistake and no other, its right one has none.

use std::collections::BTreeSet;
use std::path::Path;

use athermal as _;
use athermal::core::compile::{Wanted, compile};
use athermal::core::diagnostic::{Diagnostics, Severity, Sources, codes, explain};
use athermal::core::document::{Memory, declare, load};
use athermal::trial;
use athermal_serve::deployment::{Deployment, SECTIONS};

/// Two crates with a node type of the same name or the same kind of source, a type whose code is at fault, what is wrong with a model
/// beside the file, and a kind of source that needs addresses, which no built-in one does: no graph alone shows these.
const WITHOUT_FILE: [&str; 7] = ["A041", "A180", "A190", "A191", "A192", "A204", "A211"];

fn check(text: &str) -> (Diagnostics, Sources) {
    let base = explain("A062").unwrap().right;
    let files = Memory::new()
        .with("graph.toml", text)
        .with("base.toml", base)
        .with("chuck.csv", "time_h,chuck_degC\n0,20\n4,50\n8,repeat\n");
    let (mut sources, mut diagnostics) = (Sources::new(), Diagnostics::new());
    let document = load(
        Path::new("graph.toml"),
        &files,
        &mut sources,
        &mut diagnostics,
    );
    let graph = document.and_then(|document| declare(document, &mut diagnostics));
    let plan = graph
        .as_ref()
        .and_then(|graph| compile(graph, Wanted::default(), &mut diagnostics));
    assert_eq!(plan.is_none(), diagnostics.has_errors());
    if let (Some(graph), Some(plan)) = (graph, plan) {
        trial::declare(&graph, &plan, &files, &mut sources, &mut diagnostics);
        if SECTIONS
            .iter()
            .any(|section| graph.deployment.contains_key(*section))
        {
            Deployment::read(&graph, &plan, &sources, &mut diagnostics);
        }
    }
    (diagnostics, sources)
}

#[test]
fn every_wrong_example_has_its_mistake_and_no_other() {
    let mut others = Vec::new();
    for entry in codes()
        .iter()
        .filter(|code| !WITHOUT_FILE.contains(&code.code))
    {
        let (diagnostics, sources) = check(entry.wrong);
        let found: Vec<_> = diagnostics.iter().map(|found| found.code).collect();
        if found.is_empty() || found.iter().any(|code| *code != entry.code) {
            let text = diagnostics.render(&sources, false, 100);
            others.push(format!("{}: {found:?}\n{text}", entry.code));
        }
    }
    assert!(others.is_empty(), "{}", others.join("\n"));
}

#[test]
fn every_right_example_has_no_mistake() {
    for entry in codes() {
        let (diagnostics, sources) = check(entry.right);
        let text = diagnostics.render(&sources, false, 100);
        assert!(diagnostics.is_empty(), "{}\n{text}", entry.code);
    }
}

#[test]
fn every_mistake_is_told_as_it_was() {
    for entry in codes()
        .iter()
        .filter(|code| !WITHOUT_FILE.contains(&code.code))
    {
        let (diagnostics, sources) = check(entry.wrong);
        insta::assert_snapshot!(entry.code, diagnostics.render(&sources, false, 100));
    }
}

#[test]
fn only_what_is_unused_or_doubtful_is_a_warning() {
    let mut warnings = BTreeSet::new();
    for entry in codes()
        .iter()
        .filter(|code| !WITHOUT_FILE.contains(&code.code))
    {
        let (diagnostics, _) = check(entry.wrong);
        if diagnostics
            .iter()
            .all(|found| found.severity == Severity::Warning)
        {
            warnings.insert(entry.code);
        }
    }
    assert_eq!(
        warnings,
        BTreeSet::from(["A059", "A060", "A065", "A069", "A210", "A213"])
    );
}

/// The page of all codes in the guide, as it follows from their declarations.
fn page() -> String {
    let mut page = "# The codes of mistakes\n\n\
        Each mistake in a graph file, its tests or its model has a code, which never changes its meaning. `athermal explain CODE`\n\
        shows a graph with the mistake and one without. This page is generated from the same declarations.\n\n\
        | code | | mistake | why, and what to do |\n|---|---|---|---|\n"
        .to_owned();
    for entry in codes() {
        let (code, severity) = (entry.code, entry.severity.word());
        let (title, explanation) = (entry.title, entry.explanation);
        page += &format!("| {code} | {severity} | {title} | {explanation} |\n");
    }
    page
}

#[test]
fn the_guide_lists_every_code_as_it_is_declared() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/src/codes.md");
    if std::env::var("INSTA_UPDATE").is_ok_and(|update| update == "always") {
        std::fs::write(&path, page()).unwrap();
    }
    let guide = std::fs::read_to_string(&path).unwrap();
    assert_eq!(guide, page(), "INSTA_UPDATE=always writes the page anew");
}
