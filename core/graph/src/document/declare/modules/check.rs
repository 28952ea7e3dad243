//! Decides what is wrong with modules as they are declared, used or not.

use std::cell::LazyCell;
use std::collections::HashMap;
use std::sync::Arc;

use super::DEEPEST;
use super::module::Module;
use super::outlet::{Outlet, outlet};
use crate::diagnostic::{Diagnostics, Names};
use crate::document::declare::names::name_rule;
use crate::document::declare::reading::{table, text};
use crate::document::problem;
use crate::document::tree::{Table, Value};

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
            check_one(&module, &inside, diagnostics);
        }
        // A module of another file brings those that it sees there.
        let seen = entry.value.as_table().and_then(|keys| keys.get("modules"));
        check(seen, &sight, diagnostics);
    }
}

/// Tells what is wrong with the names and outputs of a module; the modules in sight of it are those that its nodes see.
fn check_one<'a>(module: &Module<'a>, sight: &[&'a Table], diagnostics: &mut Diagnostics) {
    for (name, entry) in module.nodes.iter() {
        name_rule(name, entry.key, "node", false, diagnostics);
    }
    let known = LazyCell::new(|| Arc::new(module.nodes.keys().map(str::to_owned).collect()));
    let mut listed = Listed::new();
    for (name, entry) in module.outputs.into_iter().flat_map(Table::iter) {
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
            let problem = problem::Refused {
                key: Some(name.to_owned()),
                reason: reason.to_owned(),
            };
            diagnostics.report(place, problem);
        } else if let Some(inner) = module.nodes.get(node) {
            let problem = instantiates(inner)
                .and_then(|inner| lacking_output(node, port, inner, sight, &mut listed));
            if let Some(problem) = problem {
                diagnostics.report(place, problem);
            }
        } else {
            let problem = problem::OutOfReach {
                name: node.to_owned(),
                module: module.name.to_owned(),
                known: Arc::clone(&known),
            };
            diagnostics.report(place, problem);
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
) -> Option<problem::UnknownOutput> {
    let Outlet::Unknown(outputs) = outlet(module, port, sight, DEEPEST) else {
        return None;
    };
    let names = || {
        let names = outputs.into_iter().flat_map(Table::keys);
        Arc::new(names.map(str::to_owned).collect())
    };
    let known = listed.entry(outputs.map(std::ptr::from_ref));
    Some(problem::UnknownOutput {
        node: node.to_owned(),
        output: port.map(str::to_owned),
        module: module.to_owned(),
        known: Arc::clone(known.or_insert_with(names)),
    })
}
