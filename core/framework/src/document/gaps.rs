//! Where a file lacks what could not be read, so that something may be missing there; what follows from that is for others to leave untold.

use std::collections::BTreeSet;

use super::salvage::Lost;
use crate::diagnostic::{Place, SourceId};

/// What may be missing in a file, since a mistake in its form has been told.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Gaps {
    /// Anything may be missing: names, and keys of all that has one.
    pub(super) anywhere: bool,
    /// Where keys may be missing.
    pub(super) places: Vec<Place>,
    /// Sets, signals and nodes of which something may be missing, or all.
    pub(super) names: BTreeSet<String>,
}

impl Gaps {
    pub(super) fn is_empty(&self) -> bool {
        !self.anywhere && self.places.is_empty()
    }

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

    /// Whether something of a name may be missing.
    pub(super) fn concern(&self, name: &str) -> bool {
        let outer = name.split('/').next().unwrap_or_default();
        self.anywhere || self.names.contains(outer)
    }
}
