//! The inputs of a node under a misspelt key: told once, and read as what they are.

use super::nodes::OWN_KEYS;
use crate::diagnostic::{Diagnostics, nearest};
use crate::document::problem::DocumentProblem;
use crate::document::tree::{Data, Entry, Table, Value};
use crate::node::kind;

const INPUTS: &str = "inputs";

/// Gives the inputs of each node, also inside of modules, their right name. Otherwise the kind would tell of a parameter that it
/// does not have, and of inputs that are missing.
pub(super) fn right_inputs(level: &mut Table, diagnostics: &mut Diagnostics) {
    // Changing a table copies it, and hardly any has such a key.
    let nodes = level.get("nodes").and_then(Value::as_table);
    let names = nodes.into_iter().flat_map(Table::iter);
    let wrong = names.filter_map(|(name, entry)| {
        let key = given_as(entry.value.as_table()?)?;
        Some((name.to_owned(), key.to_owned()))
    });
    let wrong: Vec<_> = wrong.collect();
    for (name, key) in wrong {
        let nodes = level.get_mut("nodes").and_then(Value::as_table_mut);
        let node = nodes.and_then(|nodes| nodes.get_mut(&name)?.as_table_mut());
        let Some(node) = node else { continue };
        let Some(entry) = node.remove(&key) else {
            continue;
        };
        let problem = DocumentProblem::UnknownKey {
            key,
            what: format!("node \"{name}\""),
            known: OWN_KEYS.map(str::to_owned).to_vec(),
        };
        diagnostics.report(entry.key, problem);
        match (node.get_mut(INPUTS).and_then(Value::as_table_mut), entry) {
            (Some(inputs), Entry { value, .. }) => {
                let Data::Table(more) = value.data else {
                    continue;
                };
                for (port, input) in more {
                    if !inputs.contains(&port) {
                        inputs.insert(port, input);
                    }
                }
            }
            (None, entry) => _ = node.insert(INPUTS, entry),
        }
    }
    let modules = level.get("modules").and_then(Value::as_table);
    let names: Vec<_> = modules
        .into_iter()
        .flat_map(Table::keys)
        .map(str::to_owned)
        .collect();
    for name in names {
        let modules = level.get_mut("modules").and_then(Value::as_table_mut);
        let module = modules.and_then(|modules| modules.get_mut(&name)?.as_table_mut());
        module
            .into_iter()
            .for_each(|module| right_inputs(module, diagnostics));
    }
}

/// The key under which a node names its inputs, where that is a misspelt one.
fn given_as(node: &Table) -> Option<&str> {
    let kind = kind(node.get("type")?.as_text()?)?;
    let is_meant = |key: &str| !OWN_KEYS.contains(&key) && nearest(key, OWN_KEYS) == Some(INPUTS);
    let mut tables = node
        .iter()
        .filter(|(_, entry)| entry.value.as_table().is_some());
    let (key, _) = tables.find(|(key, _)| is_meant(key))?;
    let schema = (kind.schema)();
    let parameters = schema.get("properties").and_then(|of| of.as_object());
    let is_own = parameters.is_some_and(|own| own.contains_key(key));
    (!is_own).then_some(key)
}
