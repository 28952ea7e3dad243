//! The members of each set; where sets are used is decided by signals and nodes.

use indexmap::{IndexMap, IndexSet};

use super::names::distinct;
use super::reading::{table, texts};
use crate::diagnostic::{Diagnostics, Place};
use crate::document::problem::DocumentProblem;
use crate::document::tree::Value;

pub(super) type Sets = IndexMap<String, Vec<String>>;

pub(super) fn declare(
    sets: Option<&Value>,
    broken: &mut Vec<String>,
    diagnostics: &mut Diagnostics,
) -> Sets {
    let mut declared = Sets::new();
    let Some(sets) = sets.and_then(|sets| table(sets, "sets", diagnostics)) else {
        return declared;
    };
    for (name, entry) in sets.iter() {
        let before = diagnostics.error_count();
        // A set with a mistake in it is known all the same, so that its users are not told that it does not exist.
        let members = texts(&entry.value, name, "a list of names", diagnostics).unwrap_or_default();
        if entry.value.as_list().is_some_and(<[Value]>::is_empty) {
            diagnostics.report(
                entry.value.place,
                DocumentProblem::EmptyList {
                    what: format!("the set \"{name}\""),
                },
            );
        }
        distinct(&members, "member", diagnostics);
        if diagnostics.error_count() > before {
            broken.push(name.to_owned());
        }
        // Of those that stand twice one, lest every user of the set is told of it.
        let members: IndexSet<_> = members.into_iter().map(|(member, _)| member).collect();
        declared.insert(name.to_owned(), members.into_iter().collect());
    }
    declared
}

/// The set called `name`, or a report of what there is.
pub(super) fn find<'a>(
    name: &str,
    place: Place,
    sets: &'a Sets,
    diagnostics: &mut Diagnostics,
) -> Option<&'a [String]> {
    let found = sets.get(name);
    if found.is_none() {
        let known = sets.keys().cloned().collect();
        diagnostics.report(
            place,
            DocumentProblem::UnknownSet {
                name: name.to_owned(),
                known,
            },
        );
    }
    found.map(Vec::as_slice)
}
