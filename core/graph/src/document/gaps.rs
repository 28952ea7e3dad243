//! Where a file lacks what could not be read, so that something may be missing there; what follows from that is for others to leave untold.

use std::collections::BTreeSet;

use super::salvage::Lost;
use super::tree::{Data, Entry, Table, Value};
use crate::diagnostic::{Place, SourceId};

/// What may be missing in a file, since a mistake in its form has been told.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Gaps {
    /// Anything may be missing: names, and keys of all that has one.
    pub(super) anywhere: bool,
    /// Where keys may be missing.
    pub(super) places: Vec<Place>,
    /// Sets, signals and nodes of which something may be missing, or all.
    pub(super) names: BTreeSet<String>,
}

impl Gaps {
    /// Adds what a syntax error cost.
    pub(super) fn add(&mut self, source: SourceId, lost: &Lost) {
        let byte = |at: usize| u32::try_from(at).unwrap_or(u32::MAX);
        let place =
            |bytes: &std::ops::Range<usize>| Place::new(source, byte(bytes.start), byte(bytes.end));
        self.places.extend(lost.around.iter().map(place));
        let way = lost.way.as_deref().unwrap_or_default();
        match way.first().map(String::as_str) {
            Some("sets" | "signals" | "nodes") => match way.get(1) {
                Some(name) => _ = self.names.insert(name.clone()),
                None => self.anywhere = true,
            },
            // Nothing else refers to what stands there.
            Some(
                "schema" | "name" | "description" | "outputs" | "tests" | "source" | "sinks"
                | "runtime" | "model",
            ) => {}
            _ => self.anywhere = true,
        }
    }

    /// Adds where the named things stand in a merged tree: what they inherit may have been changed by what is lost.
    pub(super) fn spread(&mut self, tree: &Table) {
        for section in ["sets", "signals", "nodes"] {
            let named = tree.get(section).and_then(Value::as_table);
            for name in &self.names {
                if let Some(entry) = named.and_then(|named| named.entry(name)) {
                    places(entry, &mut self.places);
                }
            }
        }
    }

    /// Whether something of a name may be missing.
    pub(super) fn concern(&self, name: &str) -> bool {
        let outer = name.split('/').next().unwrap_or_default();
        self.anywhere || self.names.contains(outer)
    }
}

/// Where a key and all below it stand.
fn places(entry: &Entry, found: &mut Vec<Place>) {
    found.extend([entry.key, entry.value.place]);
    match &entry.value.data {
        Data::Table(table) => table.iter().for_each(|(_, entry)| places(entry, found)),
        Data::List(values) => found.extend(values.iter().map(|value| value.place)),
        _ => {}
    }
}
