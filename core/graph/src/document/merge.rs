//! A file laid over the one that it extends; it reads no files and knows only the keys that change how tables merge.

use std::sync::Arc;

use super::problem;
use super::tree::{Data, Entry, Table, Value};
use crate::diagnostic::{Diagnostics, Names};

/// Sections of what has names, and what each name is of.
const NAMED: [(&str, &str); 4] = [
    ("nodes", "node"),
    ("outputs", "output"),
    ("sources", "source"),
    ("sinks", "sink"),
];

/// Lays `over` on `base`: tables merge key by key, all else replaces.
///
/// Under `nodes`, `sources` and `sinks`, `false` removes what is inherited, and one of another `type` (or `module`) replaces the inherited
/// one whole. Under `outputs`, `false` removes an inherited output. The names of nodes that are removed are added to `removed`.
pub(super) fn merge(
    base: Option<Table>,
    over: Table,
    removed: &mut Vec<String>,
    diagnostics: &mut Diagnostics,
) -> Table {
    let mut merged = base.unwrap_or_default();
    for (key, entry) in over {
        if NAMED.iter().any(|(section, _)| *section == key) {
            merge_named(&mut merged, key, entry, removed, diagnostics);
        } else if key == "modules" {
            merge_modules(&mut merged, key, entry, diagnostics);
        } else {
            lay(&mut merged, key, entry);
        }
    }
    merged
}

/// The nodes of a module merge as those of a graph do.
fn merge_modules(merged: &mut Table, key: String, entry: Entry, diagnostics: &mut Diagnostics) {
    let Some((below, above)) = both(merged, key, entry) else {
        return;
    };
    for (name, mut entry) in above {
        if let Data::Table(over) = &mut entry.value.data {
            let inherited = below.get(&name).and_then(Value::as_table).cloned();
            // What is inside of a module has no name outside of it.
            *over = merge(
                inherited,
                std::mem::take(over),
                &mut Vec::new(),
                diagnostics,
            );
        }
        below.insert(name, entry);
    }
}

/// The inherited table of a key and the one that is laid over it; without the latter what is written replaces.
fn both(merged: &mut Table, key: String, entry: Entry) -> Option<(&mut Table, Table)> {
    let Data::Table(above) = entry.value.data else {
        merged.insert(key, entry);
        return None;
    };
    if merged.get(&key).and_then(Value::as_table).is_none() {
        let value = Value::new(entry.value.place, Data::Table(Table::new()));
        let key_place = entry.key;
        merged.insert(
            key.clone(),
            Entry {
                key: key_place,
                value,
            },
        );
    }
    match merged.get_mut(&key).map(|value| &mut value.data) {
        Some(Data::Table(below)) => Some((below, above)),
        _ => None,
    }
}

/// Nodes, outputs, sources or sinks.
fn merge_named(
    merged: &mut Table,
    key: String,
    entry: Entry,
    removed: &mut Vec<String>,
    diagnostics: &mut Diagnostics,
) {
    let mut sections = NAMED.iter();
    let role = sections
        .find(|(section, _)| *section == key)
        .map_or("node", |(_, role)| role);
    let Some((inherited, named)) = both(merged, key, entry) else {
        return;
    };
    let names: Arc<Names> = Arc::new(inherited.keys().map(str::to_owned).collect());
    for (name, over) in named {
        if over.value.as_bool() == Some(false) {
            if inherited.remove(&name).is_none() {
                diagnostics.report(
                    over.key,
                    problem::NothingToRemove {
                        role,
                        name,
                        inherited: Arc::clone(&names),
                    },
                );
            } else if role == "node" {
                removed.push(name);
            }
        } else if role != "output"
            && inherited
                .get(&name)
                .is_some_and(|old| is_another_kind(old, &over.value))
        {
            inherited.insert(name, over);
        } else {
            lay(inherited, name, over);
        }
    }
}

fn is_another_kind(old: &Value, new: &Value) -> bool {
    let (Some(old), Some(new)) = (old.as_table(), new.as_table()) else {
        return true;
    };
    ["type", "module"].iter().any(|key| match new.get(key) {
        Some(kind) => old.get(key).is_none_or(|old| old.data != kind.data),
        None => false,
    })
}

fn lay(merged: &mut Table, key: String, entry: Entry) {
    match (
        merged.get_mut(&key).map(|value| &mut value.data),
        &entry.value.data,
    ) {
        (Some(Data::Table(below)), Data::Table(above)) => {
            for (key, entry) in above.clone() {
                lay(below, key, entry);
            }
        }
        _ => {
            merged.insert(key, entry);
        }
    }
}
