//! The sections that only a running machine needs: their form; what stands in them is decided by what runs there.

use indexmap::IndexMap;

use super::names::name_rule;
use super::reading::{table, text};
use crate::diagnostic::Diagnostics;
use crate::document::tree::{Table, Value};

const SOURCES: &str = "sources";
const SINKS: &str = "sinks";
const MODEL: &str = "model";
/// Sections of keys that every program knows.
const TABLES: [&str; 3] = ["runtime", "control", "retrain"];

/// The name of a section of keys that a linked crate reads, if it is none that every program knows.
#[derive(Debug)]
pub struct Section(pub &'static str);

inventory::collect!(Section);

/// The sections of keys in this program.
fn tables() -> impl Iterator<Item = &'static str> {
    let more = inventory::iter::<Section>.into_iter().map(|of| of.0);
    let more = more.filter(|name| !name.is_empty() && !TABLES.contains(name));
    TABLES.into_iter().chain(more)
}

/// All of these sections.
pub(super) fn sections() -> impl Iterator<Item = &'static str> {
    [SOURCES, SINKS, MODEL].into_iter().chain(tables())
}

/// Checks the sections and hands them on as they stand.
pub(super) fn declare(root: &Table, diagnostics: &mut Diagnostics) -> IndexMap<String, Value> {
    for (section, role) in [(SOURCES, "source"), (SINKS, "sink")] {
        let named = root.get(section);
        let named = named.and_then(|value| table(value, section, diagnostics));
        for (name, entry) in named.into_iter().flat_map(Table::iter) {
            name_rule(name, entry.key, role, false, diagnostics);
            table(&entry.value, name, diagnostics);
        }
    }
    for section in tables() {
        root.get(section)
            .and_then(|value| table(value, section, diagnostics));
    }
    if let Some(value) = root.get(MODEL) {
        text(value, MODEL, diagnostics);
    }
    sections()
        .filter_map(|section| Some((section.to_owned(), root.get(section)?.clone())))
        .collect()
}
