//! The sections that only a running machine needs: their form; what stands in them is decided by what runs there.

use indexmap::IndexMap;

use super::names::name_rule;
use super::reading::{table, text};
use crate::diagnostic::Diagnostics;
use crate::document::tree::{Table, Value};

pub(super) const SOURCES: &str = "sources";
pub(super) const SINKS: &str = "sinks";
pub(super) const MODEL: &str = "model";
/// Sections of keys.
pub(super) const TABLES: [&str; 5] = ["runtime", "control", "retrain", "page", "alarms"];

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
    for section in TABLES {
        root.get(section)
            .and_then(|value| table(value, section, diagnostics));
    }
    if let Some(value) = root.get(MODEL) {
        text(value, MODEL, diagnostics);
    }
    let sections = [SOURCES, SINKS, MODEL].into_iter().chain(TABLES);
    sections
        .filter_map(|section| Some((section.to_owned(), root.get(section)?.clone())))
        .collect()
}
