//! What a module declares, and which module a name means; what is wrong with its nodes and outputs, and what becomes of them, is
//! decided elsewhere.

use crate::diagnostic::Diagnostics;
use crate::document::declare::names::distinct;
use crate::document::declare::reading::{known_keys, meant, missing, table, texts};
use crate::document::problem;
use crate::document::tree::{Entry, Table, Value};

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
        let advice = "describe its nodes under it: `nodes.NAME = { type = … }`";
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
            let problem = problem::DuplicateName {
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
}

/// The module of a name, and at which of the tables in sight it stands.
pub(super) fn find<'a>(name: &str, modules: &[&'a Table]) -> Option<(&'a Value, usize)> {
    let mut nearest = modules.iter().enumerate().rev();
    nearest.find_map(|(sight, table)| Some((table.get(name)?, sight)))
}
