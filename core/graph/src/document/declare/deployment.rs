//! The sections that only a running machine needs: their form; what stands under `[source]` and `[sinks.NAME]` is decided by what runs there.

use indexmap::IndexMap;

use super::names::name_rule;
use super::reading::{known_keys, length, table, text};
use crate::diagnostic::Diagnostics;
use crate::document::tree::{Table, Value};
use crate::time::Duration;

pub(super) const SOURCE: &str = "source";
pub(super) const SINKS: &str = "sinks";
pub(super) const RUNTIME: &str = "runtime";
pub(super) const MODEL: &str = "model";

/// Checks the sections and hands them on as they stand.
pub(super) fn declare(
    root: &Table,
    sample: Option<Duration>,
    diagnostics: &mut Diagnostics,
) -> IndexMap<String, Value> {
    let mut sections = IndexMap::new();
    let mut section = |key: &str| {
        let value = root.get(key)?;
        sections.insert(key.to_owned(), value.clone());
        Some(value)
    };
    if let Some(value) = section(SOURCE) {
        table(value, SOURCE, diagnostics);
    }
    let sinks = section(SINKS).and_then(|value| table(value, SINKS, diagnostics));
    for (name, entry) in sinks.into_iter().flat_map(Table::iter) {
        name_rule(name, entry.key, "sink", false, diagnostics);
        table(&entry.value, name, diagnostics);
    }
    if let Some(keys) = section(RUNTIME).and_then(|value| table(value, RUNTIME, diagnostics)) {
        known_keys(keys, &["heartbeat"], "`[runtime]`", diagnostics);
        if let Some(value) = keys.get("heartbeat") {
            length(value, "heartbeat", sample, diagnostics);
        }
    }
    if let Some(value) = section(MODEL) {
        text(value, MODEL, diagnostics);
    }
    sections
}
