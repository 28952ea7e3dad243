//! A file laid over the one that it extends; it reads no files and knows only the keys that change how tables merge.

use std::sync::Arc;

use super::problem;
use super::tree::{Data, Entry, Table, Value};
use crate::diagnostic::{Diagnostics, Names};

/// Lays `over` on `base`: tables merge key by key, all else replaces.
///
/// Under `nodes`, `false` removes an inherited node, and a node of another `type` (or `module`) replaces the inherited one whole.
/// Under `outputs`, `false` removes an inherited output. The names of nodes that are removed are added to `removed`.
pub(super) fn merge(
    base: Option<Table>,
    over: Table,
    removed: &mut Vec<String>,
    diagnostics: &mut Diagnostics,
) -> Table {
    let mut merged = base.unwrap_or_default();
    for (key, entry) in over {
        if key == "nodes" || key == "outputs" {
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
    let Entry {
        key: key_place,
        value: Value {
            place,
            data: Data::Table(above),
        },
    } = entry
    else {
        merged.insert(key, entry);
        return;
    };
    let mut below = match merged.get_mut(&key).map(|value| &mut value.data) {
        Some(Data::Table(below)) => std::mem::take(below),
        _ => Table::new(),
    };
    for (name, Entry { key, value }) in above {
        let Value { place, data } = value;
        let data = match data {
            Data::Table(over) => {
                let inherited = below.get(&name).and_then(Value::as_table).cloned();
                // What is inside of a module has no name outside of it.
                let laid = merge(inherited, over, &mut Vec::new(), diagnostics);
                Data::Table(laid)
            }
            other => other,
        };
        let value = Value::new(place, data);
        below.insert(name, Entry { key, value });
    }
    let value = Value::new(place, Data::Table(below));
    let entry = Entry {
        key: key_place,
        value,
    };
    merged.insert(key, entry);
}

/// Nodes, or outputs.
fn merge_named(
    merged: &mut Table,
    key: String,
    entry: Entry,
    removed: &mut Vec<String>,
    diagnostics: &mut Diagnostics,
) {
    let role = if key == "nodes" { "node" } else { "output" };
    let Entry {
        key: key_place,
        value: Value {
            place,
            data: Data::Table(named),
        },
    } = entry
    else {
        merged.insert(key, entry);
        return;
    };
    let inherited = match merged.get_mut(&key).map(|value| &mut value.data) {
        Some(Data::Table(table)) => table,
        _ => {
            merged.insert(
                key.clone(),
                Entry {
                    key: key_place,
                    value: Value::new(place, Data::Table(Table::new())),
                },
            );
            match merged.get_mut(&key).map(|value| &mut value.data) {
                Some(Data::Table(table)) => table,
                _ => return,
            }
        }
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
        } else if role == "node"
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
    match (merged.get_mut(&key).map(|value| &mut value.data), entry) {
        (
            Some(Data::Table(below)),
            Entry {
                value:
                    Value {
                        data: Data::Table(above),
                        ..
                    },
                ..
            },
        ) => {
            for (key, entry) in above {
                lay(below, key, entry);
            }
        }
        (_, entry) => {
            merged.insert(key, entry);
        }
    }
}
