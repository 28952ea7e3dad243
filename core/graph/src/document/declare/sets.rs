//! The members of each set; where sets are used is decided by signals and nodes.

use std::cell::OnceCell;
use std::sync::Arc;

use indexmap::{IndexMap, IndexSet};

use super::names::{distinct, is_name};
use super::reading::{table, texts};
use crate::diagnostic::{Diagnostics, Names, Place};
use crate::document::problem;
use crate::document::tree::Value;

/// The sets of a graph.
pub(super) struct Sets {
    /// The members of each.
    pub(super) members: IndexMap<String, Vec<String>>,
    /// Those with reported mistakes, which are not reported as unknown.
    broken: IndexSet<String>,
    /// The names of all, once somebody names another: a graph may do so thousands of times.
    known: OnceCell<Arc<Names>>,
}

/// Reads the section `[sets]`; what stands `elsewhere`, in a section that is none, may be a set as well.
pub(super) fn declare(
    sets: Option<&Value>,
    elsewhere: &[String],
    diagnostics: &mut Diagnostics,
) -> Sets {
    let mut declared = Sets {
        members: IndexMap::new(),
        broken: elsewhere.iter().cloned().collect(),
        known: OnceCell::new(),
    };
    let Some(sets) = sets.and_then(|sets| table(sets, "sets", diagnostics)) else {
        return declared;
    };
    for (name, entry) in sets.iter() {
        let before = diagnostics.error_count();
        let members = texts(&entry.value, name, "a list of names", diagnostics).unwrap_or_default();
        if entry.value.as_list().is_some_and(<[Value]>::is_empty) {
            diagnostics.report(
                entry.value.place,
                problem::EmptyList {
                    what: format!("the set \"{name}\""),
                },
            );
        }
        distinct(&members, "member", diagnostics);
        if diagnostics.error_count() > before || !is_name(name, false) {
            declared.broken.insert(name.to_owned());
        }
        // Of those that stand twice one, or every user of the set would have the mistake.
        let members: IndexSet<_> = members.into_iter().map(|(member, _)| member).collect();
        let members = members.into_iter().collect();
        declared.members.insert(name.to_owned(), members);
    }
    declared
}

impl Sets {
    /// The members of a set without mistakes.
    pub(super) fn sound(&self, name: &str) -> Option<&[String]> {
        let sound = self.members.get(name).map(Vec::as_slice);
        sound.filter(|_| !self.broken.contains(name))
    }

    /// The members of a set; `None` where they are not known, which has then been reported.
    pub(super) fn find(
        &self,
        name: &str,
        place: Place,
        diagnostics: &mut Diagnostics,
    ) -> Option<&[String]> {
        self.find_or(name, place, None, diagnostics)
    }

    /// As [`find`](Self::find), with what else to write where something else than a set may be meant.
    pub(super) fn find_or(
        &self,
        name: &str,
        place: Place,
        or: Option<String>,
        diagnostics: &mut Diagnostics,
    ) -> Option<&[String]> {
        if !self.members.contains_key(name) && !self.broken.contains(name) {
            let problem = problem::UnknownSet {
                name: name.to_owned(),
                known: Arc::clone(self.known()),
                or,
            };
            diagnostics.report(place, problem);
        }
        self.sound(name)
    }

    fn known(&self) -> &Arc<Names> {
        let listed = || Arc::new(self.members.keys().cloned().collect());
        self.known.get_or_init(listed)
    }
}
