//! The inputs of a node under a misspelt key: told once, and read as what they are.

use super::nodes::OWN_KEYS;
use crate::diagnostic::{Diagnostics, nearest};
use crate::document::problem::DocumentProblem;
use crate::document::tree::{Data, Entry, Table, Value};
use crate::node::kind;

const INPUTS: &str = "inputs";
/// What the framework reads of estimators; not among their parameters.
const OF_ALL: [&str; 3] = ["ahead", "train", "learn"];

/// Gives the inputs of each node, also inside of modules, their right name. Otherwise the kind would tell of a parameter that it
/// does not have, and of inputs that are missing.
pub(super) fn right_inputs(level: &mut Table, diagnostics: &mut Diagnostics) {
    // Changing a table copies it, and hardly any has such a key.
    let nodes = level.get("nodes").and_then(Value::as_table);
    let names = nodes.into_iter().flat_map(Table::iter);
    let wrong = names.flat_map(|(name, entry)| {
        let given = entry.value.as_table().map_or_else(Vec::new, given_as);
        given.into_iter().map(|given| (name.to_owned(), given))
    });
    let wrong: Vec<_> = wrong.collect();
    for (name, (key, meant)) in wrong {
        let nodes = level.get_mut("nodes").and_then(Value::as_table_mut);
        let node = nodes.and_then(|nodes| nodes.get_mut(&name)?.as_table_mut());
        let Some(node) = node else { continue };
        let Some(Entry { key: place, value }) = node.remove(&key) else {
            continue;
        };
        let what = format!("node \"{name}\"");
        let (problem, more) = match (meant, value.data) {
            (Meant::Input(port), data) => {
                let value = Value::new(value.place, data);
                let mut one = Table::new();
                one.insert(port, Entry { key: place, value });
                let input = port.to_owned();
                (DocumentProblem::InputAsKey { key, what, input }, one)
            }
            (Meant::Inputs, Data::Table(more)) => {
                let known = OWN_KEYS.map(str::to_owned).to_vec();
                (DocumentProblem::UnknownKey { key, what, known }, more)
            }
            (Meant::Inputs, _) => continue,
        };
        diagnostics.report(place, problem);
        if !node.contains(INPUTS) {
            let inputs = Value::new(place, Data::Table(Table::new()));
            let entry = Entry {
                key: place,
                value: inputs,
            };
            node.insert(INPUTS, entry);
        }
        if let Some(inputs) = node.get_mut(INPUTS).and_then(Value::as_table_mut) {
            for (port, input) in more {
                if !inputs.contains(&port) {
                    inputs.insert(port, input);
                }
            }
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

/// What a key that a node does not have is meant to be.
enum Meant {
    /// All inputs: `input.signal`.
    Inputs,
    /// One of them: `signal`.
    Input(&'static str),
}

/// The keys under which a node names inputs, where that is not what they are called.
fn given_as(node: &Table) -> Vec<(String, Meant)> {
    let kind = node.get("type").and_then(Value::as_text).and_then(kind);
    let Some(kind) = kind else { return Vec::new() };
    let ports = || (kind.inputs)().iter().map(|port| port.name);
    let are_inputs = |table: &Table| {
        !table.is_empty() && table.keys().all(|key| ports().any(|port| port == key))
    };
    let strange = node.iter().filter(|(key, _)| !OWN_KEYS.contains(key));
    let suspects = strange.filter_map(|(key, entry)| {
        let is_near = || nearest(key, OWN_KEYS) == Some(INPUTS);
        let table = entry.value.as_table();
        let meant = if table.is_some_and(|table| is_near() || are_inputs(table)) {
            Meant::Inputs
        } else {
            let near = nearest(key, ports());
            let mut same = ports().filter(|port| *port == key || near == Some(*port));
            Meant::Input(same.next()?)
        };
        Some((key.to_owned(), meant))
    });
    let suspects: Vec<_> = suspects.collect();
    if suspects.is_empty() {
        return suspects;
    }
    let schema = (kind.schema)();
    let parameters = schema.get("properties").and_then(|of| of.as_object());
    let parameters = parameters.into_iter().flat_map(|own| own.keys());
    let own: Vec<&str> = parameters.map(String::as_str).chain(OF_ALL).collect();
    let strange = suspects
        .into_iter()
        .filter(|(key, _)| !own.contains(&key.as_str()));
    let is_meant = |(key, meant): &(String, Meant)| match meant {
        // A parameter that is as near may be meant as well.
        Meant::Input(port) if port != key => {
            nearest(key, own.iter().copied().chain([*port])) == Some(*port)
        }
        Meant::Input(_) | Meant::Inputs => true,
    };
    strange.filter(is_meant).collect()
}
