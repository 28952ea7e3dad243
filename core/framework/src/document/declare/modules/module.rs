//! What a module declares, and which module a name means; what becomes of its nodes is decided by the expansion.

use std::cell::LazyCell;
use std::collections::HashMap;
use std::sync::Arc;

use super::DEEPEST;
use super::references::{Output, output};
use crate::diagnostic::{Diagnostics, Names};
use crate::document::declare::names::{distinct, name_rule};
use crate::document::declare::reading::{known_keys, meant, missing, table, text, texts};
use crate::document::problem::DocumentProblem;
use crate::document::tree::{Entry, Table, Value};
use crate::node::{Kind, kind as kind_of};

const KEYS: [&str; 6] = [
    "inputs",
    "required",
    "parameters",
    "outputs",
    "nodes",
    // What a module of another file sees beside itself.
    "modules",
];
/// Keys that mean something on any node that instantiates a module.
const TAKEN: [&str; 4] = ["type", "module", "each", "inputs"];

/// A module as declared.
pub(super) struct Module<'a> {
    pub(super) name: &'a str,
    pub(super) inputs: Vec<String>,
    required: Vec<String>,
    parameters: Option<&'a Table>,
    pub(super) outputs: Option<&'a Table>,
    pub(super) nodes: &'a Table,
    pub(super) modules: Option<&'a Table>,
}

impl<'a> Module<'a> {
    /// Reads a module's declaration; `None` where it has no nodes.
    pub(super) fn read(
        name: &'a str,
        value: &'a Value,
        diagnostics: &mut Diagnostics,
    ) -> Option<Self> {
        let keys = table(value, name, diagnostics)?;
        let what = format!("module \"{name}\"");
        known_keys(keys, &KEYS, &what, diagnostics);
        let mut list = |key: &str, role: &'static str| {
            let names = meant(keys, key, &KEYS)
                .and_then(|value| texts(value, key, "a list of names", diagnostics));
            let names = names.unwrap_or_default();
            distinct(&names, role, diagnostics);
            names
        };
        let inputs = list("inputs", "input");
        let required = list("required", "parameter");
        let parameters = meant(keys, "parameters", &KEYS)
            .and_then(|value| table(value, "parameters", diagnostics));
        let outputs =
            meant(keys, "outputs", &KEYS).and_then(|value| table(value, "outputs", diagnostics));
        let advice = "describe its nodes under it, e.g. nodes.slope = { type = \"slope\" }";
        let nodes = match meant(keys, "nodes", &KEYS) {
            Some(nodes) => table(nodes, "nodes", diagnostics)?,
            None => {
                missing(value, "nodes", &what, Some(advice), diagnostics);
                return None;
            }
        };
        let with_default = parameters.into_iter().flat_map(|table| {
            table
                .iter()
                .map(|(name, entry)| (name.to_owned(), entry.key))
        });
        let settable: Vec<_> = required.iter().cloned().chain(with_default).collect();
        for (nth, (name, place)) in settable.iter().enumerate() {
            let first_role = if TAKEN.contains(&name.as_str()) {
                "key of every node"
            } else if inputs.iter().any(|(input, _)| input == name) {
                "input"
            } else if nth >= required.len() && required.iter().any(|(other, _)| other == name) {
                "required parameter"
            } else {
                continue;
            };
            let problem = DocumentProblem::DuplicateName {
                role: "parameter",
                name: name.clone(),
                first_role,
                first: None,
            };
            diagnostics.report(*place, problem);
        }
        let names = |names: Vec<(String, _)>| names.into_iter().map(|(name, _)| name).collect();
        Some(Self {
            name,
            inputs: names(inputs),
            required: names(required),
            parameters,
            outputs,
            nodes,
            modules: keys.get("modules").and_then(Value::as_table),
        })
    }

    /// The names of its parameters, those without a default first.
    pub(super) fn parameter_names(&self) -> impl Iterator<Item = &str> {
        let with_default = self.parameters.into_iter().flat_map(Table::keys);
        self.required.iter().map(String::as_str).chain(with_default)
    }

    /// The parameters that have a default.
    pub(super) fn defaults(&self) -> impl Iterator<Item = (&'a str, &'a Entry)> + use<'a> {
        self.parameters.into_iter().flat_map(Table::iter)
    }

    /// Tells what is wrong with its names and outputs; the modules in sight of it are those that its nodes see.
    fn check(&self, sight: &[&'a Table], diagnostics: &mut Diagnostics) {
        for (name, entry) in self.nodes.iter() {
            name_rule(name, entry.key, "node", false, diagnostics);
        }
        let known = LazyCell::new(|| Arc::new(self.nodes.keys().map(str::to_owned).collect()));
        let mut listed = Listed::new();
        for (name, entry) in self.outputs.into_iter().flat_map(Table::iter) {
            name_rule(name, entry.key, "output", false, diagnostics);
            let Some(reference) = text(&entry.value, name, diagnostics) else {
                continue;
            };
            let (node, port) = match reference.split_once(':') {
                Some((node, port)) => (node, Some(port)),
                None => (reference, None),
            };
            let place = entry.value.place;
            if node.contains('.') || port.is_some_and(|port| port.contains('.')) {
                let reason =
                    "an output is a node of the module or a port of one, with all its channels";
                let problem = DocumentProblem::Refused {
                    key: Some(name.to_owned()),
                    reason: reason.to_owned(),
                };
                diagnostics.report(place, problem);
            } else if let Some(inner) = self.nodes.get(node) {
                let problem = match (instantiates(inner), port) {
                    (Some(module), _) => lacking_output(node, port, module, sight, &mut listed),
                    (None, Some(port)) => lacking_port(node, port, inner),
                    (None, None) => None,
                };
                if let Some(problem) = problem {
                    diagnostics.report(place, problem);
                }
            } else {
                let problem = DocumentProblem::OutOfReach {
                    name: node.to_owned(),
                    module: self.name.to_owned(),
                    known: Arc::clone(&known),
                };
                diagnostics.report(place, problem);
            }
        }
    }
}

/// The module of which a node is an instance.
fn instantiates(node: &Value) -> Option<&str> {
    node.as_table()?.get("module")?.as_text()
}

/// The outputs of modules, listed once for all that are not among them.
type Listed = HashMap<Option<*const Table>, Arc<Names>>;

/// What is wrong with naming an output of an instance of a module.
fn lacking_output(
    node: &str,
    port: Option<&str>,
    module: &str,
    sight: &[&Table],
    listed: &mut Listed,
) -> Option<DocumentProblem> {
    let Output::Unknown(outputs) = output(module, port, sight, DEEPEST) else {
        return None;
    };
    let names = || {
        let names = outputs.into_iter().flat_map(Table::keys);
        Arc::new(names.map(str::to_owned).collect())
    };
    let known = listed.entry(outputs.map(std::ptr::from_ref));
    Some(DocumentProblem::UnknownOutput {
        node: node.to_owned(),
        output: port.map(str::to_owned),
        module: module.to_owned(),
        known: Arc::clone(known.or_insert_with(names)),
    })
}

/// What is wrong with naming a port of a node that no node of its type has.
fn lacking_port(node: &str, port: &str, keys: &Value) -> Option<DocumentProblem> {
    let kind = keys.as_table()?.get("type")?.as_text();
    // A type may be a parameter, or none; and not every type tells its ports.
    let known = kind.and_then(kind_of).map_or_else(Vec::new, Kind::outputs);
    let lacks = match known.is_empty() {
        true => port.is_empty(),
        false => !known.contains(&port),
    };
    lacks.then(|| DocumentProblem::UnknownPort {
        node: node.to_owned(),
        port: port.to_owned(),
        known: known.into_iter().map(str::to_owned).collect(),
    })
}

/// Reports what is wrong with modules as they are declared, used or not; `sight` are the modules that those see which see them.
pub(super) fn check<'a>(
    modules: Option<&'a Value>,
    sight: &[&'a Table],
    diagnostics: &mut Diagnostics,
) {
    let Some(modules) = modules.and_then(|modules| table(modules, "modules", diagnostics)) else {
        return;
    };
    let mut sight = sight.to_vec();
    sight.push(modules);
    for (name, entry) in modules.iter() {
        name_rule(name, entry.key, "module", false, diagnostics);
        if let Some(module) = Module::read(name, &entry.value, diagnostics) {
            let inside: Vec<_> = sight.iter().copied().chain(module.modules).collect();
            module.check(&inside, diagnostics);
        }
        // A module of another file brings those that it sees there.
        let seen = entry.value.as_table().and_then(|keys| keys.get("modules"));
        check(seen, &sight, diagnostics);
    }
}

/// The module of a name, and at which of the tables in sight it stands.
pub(super) fn find<'a>(name: &str, modules: &[&'a Table]) -> Option<(&'a Value, usize)> {
    let mut nearest = modules.iter().enumerate().rev();
    nearest.find_map(|(sight, table)| Some((table.get(name)?, sight)))
}
