//! The sections that only a running machine needs: their form; what stands in them is decided by what runs there.

use std::collections::BTreeSet;

use indexmap::IndexMap;

use super::names::name_rule;
use super::reading::{table, text};
use crate::diagnostic::Diagnostics;
use crate::document::tree::{Table, Value};
use crate::registry::{Sort, names_of};

const SOURCES: &str = "sources";
const SINKS: &str = "sinks";
const MODEL: &str = "model";
const RUNTIME: &str = "runtime";

/// A section of keys that a linked crate reads, or would with a feature that was left out.
#[derive(Debug)]
pub struct Section;

impl Sort for Section {
    const ONE: &'static str = "section";
    const MANY: &'static str = "sections";
}

/// The sections of keys in this program.
fn tables() -> impl Iterator<Item = &'static str> {
    let more = names_of::<Section>().filter(|name| !name.is_empty());
    [RUNTIME].into_iter().chain(BTreeSet::from_iter(more))
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
