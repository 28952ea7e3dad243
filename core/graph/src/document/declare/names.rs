//! What may be a name, and that no two things share one; what the names stand for is decided elsewhere.

use std::collections::HashMap;

use crate::diagnostic::{Diagnostics, Place};
use crate::document::problem;
use crate::document::tree::Table;

/// Reports names of sets, signals, nodes and outputs that break the rules, and names that two of the first three share. What a reference
/// to one that breaks the rules would name goes to `broken`; the answer are those that are shared.
pub(super) fn check(
    root: &Table,
    broken: &mut Vec<String>,
    diagnostics: &mut Diagnostics,
) -> Vec<String> {
    let mut shared = Vec::new();
    let mut taken: HashMap<&str, (&'static str, Place)> = HashMap::new();
    for (section, role) in [("sets", "set"), ("signals", "signal"), ("nodes", "node")] {
        let Some(table) = root.get(section).and_then(|value| value.as_table()) else {
            continue;
        };
        for (name, entry) in table.iter() {
            name_rule(name, entry.key, role, false, diagnostics);
            if !is_name(name, false) && role != "set" {
                broken.extend(name.split(['.', ':']).next().map(str::to_owned));
            }
            if let Some(&(first_role, first)) = taken.get(name) {
                let problem = problem::DuplicateName {
                    role,
                    name: name.to_owned(),
                    first_role,
                    first: Some(first),
                };
                diagnostics.report(entry.key, problem);
                shared.push(name.to_owned());
            } else {
                taken.insert(name, (role, entry.key));
            }
        }
    }
    if let Some(table) = root.get("outputs").and_then(|value| value.as_table()) {
        for (name, entry) in table.iter() {
            name_rule(name, entry.key, "output", false, diagnostics);
        }
    }
    shared
}

/// Reports a name that is not a letter (or a digit, where that is allowed), then letters, digits, `_` and `-`.
pub(super) fn name_rule(
    name: &str,
    place: Place,
    role: &'static str,
    digit_first: bool,
    diagnostics: &mut Diagnostics,
) {
    if !is_name(name, digit_first) {
        diagnostics.report(
            place,
            problem::BadName {
                role,
                name: name.to_owned(),
                digit_first,
            },
        );
    }
}

/// Whether something may be called so.
pub fn is_name(name: &str, digit_first: bool) -> bool {
    let mut characters = name.chars();
    let first = characters.next();
    first.is_some_and(|c| c.is_alphabetic() || digit_first && c.is_ascii_digit())
        && characters.all(|c| c.is_alphanumeric() || c == '_' || c == '-')
}

/// The same for a list of members or channels, of which none may stand twice.
pub(super) fn distinct(
    names: &[(String, Place)],
    role: &'static str,
    diagnostics: &mut Diagnostics,
) {
    let mut seen: HashMap<&str, Place> = HashMap::new();
    for (name, place) in names {
        name_rule(name, *place, role, true, diagnostics);
        if let Some(&first) = seen.get(name.as_str()) {
            let problem = problem::DuplicateName {
                role,
                name: name.clone(),
                first_role: role,
                first: Some(first),
            };
            diagnostics.report(*place, problem);
        } else {
            seen.insert(name, *place);
        }
    }
}
