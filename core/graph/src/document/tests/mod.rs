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

/// The diagnostics as text, after a line break; a file without any is a mistake of the test.
fn rendered(files: &[(&str, &str)]) -> String {
    let Outcome {
        sources,
        diagnostics,
        ..
    } = read(files);
    assert!(diagnostics.has_errors(), "the file has no mistake");
    let text = diagnostics.render(&sources, false, 120);
    format!("\n{text}")
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
