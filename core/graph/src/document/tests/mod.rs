//! Reading graph files as a whole: merging, declaring, and the texts of all mistakes.

use std::path::Path;

use super::*;
use crate::diagnostic::{Diagnostics, Sources};

mod any_text;
mod extending;
mod modules;
mod texts;

/// What reading the first of `files` gives and reports.
struct Outcome {
    graph: Option<GraphFile>,
    sources: Sources,
    diagnostics: Diagnostics,
}

fn read(files: &[(&str, &str)]) -> Outcome {
    let memory = files.iter().fold(Memory::new(), |memory, (name, text)| {
        memory.with(*name, *text)
    });
    let (mut sources, mut diagnostics) = (Sources::new(), Diagnostics::new());
    let document = load(
        Path::new(files[0].0),
        &memory,
        &mut sources,
        &mut diagnostics,
    );
    let graph = document.and_then(|document| declare(document, &mut diagnostics));
    Outcome {
        graph,
        sources,
        diagnostics,
    }
}

/// The diagnostics as text; a file without any is a mistake of the test.
fn rendered(files: &[(&str, &str)]) -> String {
    let Outcome {
        sources,
        diagnostics,
        ..
    } = read(files);
    assert!(diagnostics.has_errors(), "the file has no mistake");
    diagnostics.render(&sources, false, 120)
}

/// A graph file of two sets with a thousand members each, and a node for each of `each`.
fn many_members(each: &[&str], parameters: &str) -> String {
    let members = |letter| {
        (0..1_000)
            .map(|number| format!("\"{letter}{number}\""))
            .collect::<Vec<_>>()
            .join(", ")
    };
    format!(
        "schema = 1\n[sets]\na = [{}]\nb = [{}]\n[nodes.n]\ntype = \"x\"\neach = {each:?}\n{parameters}",
        members("a"),
        members("b"),
    )
}

/// The graph of the language's documentation.
fn die_tester() -> &'static str {
    include_str!("die_tester.toml")
}

/// Compares the reports on broken files with those that a text has for them: each case is `## title`, the text of `a.toml`, any
/// further file under `>> name`, and behind `---` the report.
pub(super) fn check_cases(cases: &str, report: impl Fn(&[(String, String)]) -> String) {
    let mut differing = String::new();
    for case in cases.split("## ").skip(1) {
        let (title, case) = case.split_once('\n').expect("a title is a line");
        let (texts, expected) = case.split_once("---\n").expect("a case has a report");
        let texts = match texts.strip_prefix(">> ") {
            Some(texts) => texts.to_owned(),
            None => format!("a.toml\n{texts}"),
        };
        let files = texts.split(">> ").map(|file| {
            let (name, text) = file.split_once('\n').expect("a name is a line");
            (name.to_owned(), text.to_owned())
        });
        let report = report(&files.collect::<Vec<_>>());
        if report.trim_end() != expected.trim_end() {
            differing += &format!("## {title}\n{report}\n");
        }
    }
    assert!(differing.is_empty(), "other reports:\n{differing}");
}
