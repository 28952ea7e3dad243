//! `[modules]`: every node that instantiates a module replaced by the module's nodes; what those nodes are is decided elsewhere.
//!
//! A module is a named group of nodes. It says what it reads, what can be set and what it gives:
//!
//! ```toml
//! [modules.axis]
//! inputs = ["features", "truth"]                   # named as `{features}` and `{truth}` inside
//! required = ["limit"]                             # parameters without a default
//! parameters = { ahead = "5min" }                  # parameters with one
//! outputs = { predicted = "vote", linear = "thermal" }   # a node inside, or a port of one; the first is the default
//! nodes.thermal = { type = "linear", inputs.features = "{features}", inputs.truth = "{truth}", ahead = "{ahead}", train.abs_truth.below = "{limit}" }
//! nodes.vote = { type = "mean", inputs.voters = ["thermal"] }
//!
//! [nodes.axis-model]
//! module = "axis"
//! each = "axis"                                    # as on any node
//! inputs.features = "gradients"
//! inputs.truth = "drift.{axis}"
//! limit = "150 nm/min"
//! ```
//!
//! - An instance gives every input and every required parameter, and stands for its outputs as a node does for its ports:
//!   `axis-model`, `axis-model.Z1`, `axis-model:linear.Z1`.
//! - Its nodes are called `axis-model/thermal` in diagnostics, plans and models.
//! - Inside, a reference names a node of the same module or begins with an input. Anything else of the graph is out of
//!   reach, so that a module means the same wherever it is used. References among nodes inside stay within one member.
//! - `{name}` alone in a text is the parameter's value, of whatever type; within a longer text it is the value's text.
//! - Modules may instantiate modules, sixteen deep. `modules.axis = { from = "axis.toml" }` takes the module of that name
//!   (or the one that `module = "…"` names) from another file, whose own modules it goes on seeing. Other keys there are
//!   laid over it. A file that `extends` another inherits its modules.

mod check;
mod module;
mod outlet;
mod references;
mod substitution;

use std::collections::HashMap;
use std::sync::Arc;

use indexmap::IndexMap;

use super::each::{MOST_INSTANCES, MOST_VALUES, own_each, weight};
use super::placeholder;
use super::reading::{known_keys, meant, missing, table, text};
use super::sets::Sets;
use crate::diagnostic::{Diagnostics, Names};
use crate::document::problem;
use crate::document::tree::{Data, Entry, Table, Value};
use check::check;
use module::{Module, find};

/// How deep modules may nest.
const DEEPEST: usize = 16;

/// A node of the graph with every module expanded.
pub(super) struct Placed {
    /// Its name: `axis-model/thermal` inside a module.
    pub(super) name: String,
    /// Its key and table; references lead to nodes of the whole graph.
    pub(super) entry: Entry,
    /// The instances of modules that it is inside of, from the outermost.
    pub(super) around: Arc<[Around]>,
}

/// An instance of a module, as the nodes inside of it see it.
#[derive(Debug, Clone)]
pub(super) struct Around {
    /// The instance: `axis-model`, or `a/b` for one inside another.
    pub(super) path: String,
    /// The same with what picks one member out: `axis-model[{axis-model/axis}]`.
    pub(super) one: String,
    /// The sets of its `each`.
    pub(super) each: Vec<String>,
    /// The parameters of its module.
    pub(super) parameters: Vec<String>,
}

impl Around {
    /// The placeholder of one of its sets; no set of the node inside can be meant.
    pub(super) fn placeholder(&self, set: &str) -> String {
        format!("{}/{set}", self.path)
    }
}

/// A graph with every module expanded.
pub(super) struct Expanded {
    pub(super) nodes: Vec<Placed>,
    /// The section `[outputs]`, its references leading to nodes of the whole graph.
    pub(super) outputs: Option<Value>,
    /// The same of `[[tests]]`.
    pub(super) tests: Option<Value>,
    /// A mistake in a module or an instance of one has been reported: what is inside may not be what was meant.
    pub(super) faulty: bool,
    /// Not all nodes are there, since they would be too many.
    pub(super) cut: bool,
}

/// Expands the modules of a graph file; those that are instances of one go to `broken` after a mistake.
pub(super) fn expand(
    root: &Table,
    sets: &Sets,
    broken: &mut Vec<String>,
    diagnostics: &mut Diagnostics,
) -> Expanded {
    let before = diagnostics.reported();
    check(root.get("modules"), &[], diagnostics);
    let mut expanded = Expanded {
        nodes: Vec::new(),
        outputs: root.get("outputs").cloned(),
        tests: root.get("tests").cloned(),
        faulty: false,
        cut: false,
    };
    let Some(nodes) = root
        .get("nodes")
        .and_then(|nodes| table(nodes, "nodes", diagnostics))
    else {
        return expanded;
    };
    let modules = root.get("modules").and_then(Value::as_table);
    let level = Level {
        around: Arc::new([]),
        nodes,
        modules: modules.into_iter().collect(),
        given: None,
    };
    let has_modules = nodes.iter().any(|(_, entry)| is_instance(entry));
    let mut expansion = Expansion {
        sets,
        diagnostics,
        placed: Vec::with_capacity(nodes.len()),
        values: 0,
        path: Vec::new(),
        known: HashMap::new(),
        full: false,
        faulty: false,
    };
    for (name, entry) in nodes.iter() {
        if has_modules {
            expansion.node(name, entry, &level);
        } else {
            expansion.place(name, entry.clone(), &level);
        }
    }
    expanded.faulty = expansion.faulty || expansion.diagnostics.reported() > before;
    if has_modules {
        if let Some(outputs) = &mut expanded.outputs {
            expansion.outputs(outputs, &level);
        }
        if let Some(tests) = &mut expanded.tests {
            let outputs = root.get("outputs").and_then(Value::as_table);
            expansion.tests(tests, outputs, &level);
        }
    }
    expanded.cut = expansion.full;
    expanded.nodes = expansion.placed;
    // An output that names no port of an instance leaves its nodes as they were meant.
    if expanded.faulty || diagnostics.reported() > before {
        let instances = nodes.iter().filter(|(_, entry)| is_instance(entry));
        broken.extend(instances.map(|(name, _)| name.to_owned()));
    }
    expanded
}

fn is_instance(entry: &Entry) -> bool {
    entry
        .value
        .as_table()
        .is_some_and(|keys| keys.contains("module"))
}

/// The nodes that see each other: those of the graph, or those of one instance of a module.
struct Level<'a> {
    around: Arc<[Around]>,
    nodes: &'a Table,
    /// The modules in sight, the nearest last.
    modules: Vec<&'a Table>,
    /// What the instance was given; none for the graph itself.
    given: Option<Given>,
}

/// What an instance of a module was given.
struct Given {
    module: String,
    /// References of the whole graph, by input.
    inputs: IndexMap<String, Value>,
    parameters: IndexMap<String, Value>,
}

impl Level<'_> {
    /// The name of a node as the whole graph knows it.
    fn name(&self, node: &str) -> String {
        match self.around.last() {
            Some(around) => format!("{}/{node}", around.path),
            None => node.to_owned(),
        }
    }

    /// What stands before a reference from one node to another.
    fn prefix(&self) -> String {
        self.around
            .last()
            .map_or_else(String::new, |around| format!("{}/", around.one))
    }
}

struct Expansion<'a> {
    sets: &'a Sets,
    diagnostics: &'a mut Diagnostics,
    placed: Vec<Placed>,
    values: usize,
    /// The modules on the way from the graph to the present level, by name and table.
    path: Vec<(String, *const Value)>,
    /// The names in tables, listed once for all who refer to others.
    known: HashMap<Vec<*const Table>, Arc<Names>>,
    /// Set when the limit was reported, so that nothing more is expanded.
    full: bool,
    /// Set when an instance could not be expanded, since what it refers to has mistakes.
    faulty: bool,
}

impl Expansion<'_> {
    fn node(&mut self, name: &str, entry: &Entry, level: &Level<'_>) {
        if self.full || !self.has_room(name, entry, level) {
            return;
        }
        if is_instance(entry) {
            if self.instance(name, entry, level).is_none() {
                self.unexpanded(name, entry, level);
            }
            return;
        }
        let mut entry = entry.clone();
        if let Some(keys) = entry.value.as_table_mut() {
            for (key, entry) in keys.iter_mut() {
                if key == "inputs" {
                    entry.value = self.inputs(&entry.value, level);
                } else if let Some(given) = &level.given {
                    entry.value = given.fill(&entry.value, self.diagnostics);
                }
            }
        }
        self.place(name, entry, level);
    }

    /// Whether what a node of a module says has room with its parameters in place: each level may repeat what it was given.
    fn has_room(&mut self, name: &str, entry: &Entry, level: &Level<'_>) -> bool {
        let filled = |given: &Given| given.weight_filled(&entry.value);
        let fits = level.given.as_ref().map_or(0, filled) <= MOST_VALUES;
        if !fits {
            self.too_large(level.name(name), entry);
        }
        fits
    }

    fn too_large(&mut self, node: String, entry: &Entry) {
        let limit = MOST_VALUES;
        let problem = problem::TooLargeExpanded { node, limit };
        self.diagnostics.report(entry.key, problem);
        self.full = true;
    }

    fn place(&mut self, name: &str, entry: Entry, level: &Level<'_>) {
        if level.given.is_some() {
            self.values += weight(&entry.value);
            let name = || level.name(name);
            if self.placed.len() >= MOST_INSTANCES {
                let problem = problem::TooManyInstances {
                    node: name(),
                    instances: self.placed.len() + 1,
                    limit: MOST_INSTANCES,
                };
                self.diagnostics.report(entry.key, problem);
                self.full = true;
            } else if self.values > MOST_VALUES {
                self.too_large(name(), &entry);
            }
        }
        self.placed.push(Placed {
            name: level.name(name),
            entry,
            around: Arc::clone(&level.around),
        });
    }

    /// Leaves an instance of a module as it is, so that what it reads is looked at all the same.
    fn unexpanded(&mut self, name: &str, entry: &Entry, level: &Level<'_>) {
        let mut entry = entry.clone();
        let keys = entry
            .value
            .as_table_mut()
            .into_iter()
            .flat_map(Table::iter_mut);
        for (_, inputs) in keys.filter(|(key, _)| *key == "inputs") {
            inputs.value = self.inputs(&inputs.value, level);
        }
        self.faulty = true;
        self.place(name, entry, level);
    }

    /// Replaces an instance of a module by the module's nodes; `None` where that cannot be done, which has been reported.
    fn instance(&mut self, name: &str, entry: &Entry, level: &Level<'_>) -> Option<()> {
        let keys = entry.value.as_table()?;
        let wanted = keys.get("module")?;
        let module_name = text(wanted, "module", self.diagnostics)?;
        let Some((found, sight)) = find(module_name, &level.modules) else {
            let tables: Vec<_> = level.modules.iter().rev().copied().collect();
            let problem = problem::UnknownModule {
                name: module_name.to_owned(),
                known: self.known(&tables, []),
            };
            self.diagnostics.report(wanted.place, problem);
            return None;
        };
        let here = (module_name.to_owned(), std::ptr::from_ref(found));
        if self.path.contains(&here) || self.path.len() >= DEEPEST {
            let path = self.path.iter().chain([&here]);
            let problem = problem::ModuleLoop {
                path: path.map(|(name, _)| name.clone()).collect(),
                limit: DEEPEST,
            };
            self.diagnostics.report(wanted.place, problem);
            return None;
        }
        // What is wrong with a module itself has been reported where it stands.
        let module = Module::read(module_name, found, &mut Diagnostics::new())?;
        let each = own_each(keys, self.sets, self.diagnostics);
        let names = each.sets.into_iter().map(|(set, _)| set);
        let around = self.around(name, names.collect(), &module, level);
        // Where it is not known what the members are of, none that is named can be called strange.
        let members = each.known.then_some(&around);
        let given = self.given(name, entry, keys, &module, members, level);
        let given = given.filter(|_| each.sound)?;
        let mut modules = level.modules[..=sight].to_vec();
        modules.extend(module.modules);
        let inside = Level {
            around: level.around.iter().cloned().chain([around]).collect(),
            nodes: module.nodes,
            modules,
            given: Some(given),
        };
        self.path.push(here);
        for (name, entry) in module.nodes.iter() {
            let context = format!("node `{}`", inside.name(name));
            let outer = self.diagnostics.scope(Some(context));
            self.node(name, entry, &inside);
            self.diagnostics.scope(outer);
        }
        self.path.pop();
        Some(())
    }

    /// The names that tables have, and others that are the same for all who ask for those of these tables.
    fn known(&mut self, tables: &[&Table], others: impl IntoIterator<Item = String>) -> Arc<Names> {
        let places = tables.iter().map(|table| std::ptr::from_ref(*table));
        let known = self.known.entry(places.collect()).or_insert_with(|| {
            let names = tables.iter().flat_map(|table| table.keys());
            Arc::new(names.map(str::to_owned).chain(others).collect())
        });
        Arc::clone(known)
    }

    fn around(
        &self,
        name: &str,
        each: Vec<String>,
        module: &Module<'_>,
        level: &Level<'_>,
    ) -> Around {
        let path = level.name(name);
        let member: Vec<_> = each.iter().map(|set| format!("{{{path}/{set}}}")).collect();
        let one = format!("{}{name}", level.prefix());
        let one = if member.is_empty() {
            one
        } else {
            format!("{one}[{}]", member.join("-"))
        };
        let parameters = module.parameter_names().map(str::to_owned).collect();
        Around {
            path,
            one,
            each,
            parameters,
        }
    }

    /// The inputs and parameters of an instance; `None` where one is missing.
    fn given(
        &mut self,
        name: &str,
        entry: &Entry,
        keys: &Table,
        module: &Module<'_>,
        around: Option<&Around>,
        level: &Level<'_>,
    ) -> Option<Given> {
        let what = format!(
            "node \"{}\" of module \"{}\"",
            level.name(name),
            module.name
        );
        let known: Vec<&str> = ["module", "each", "inputs"]
            .into_iter()
            .chain(module.parameter_names())
            .collect();
        known_keys(keys, &known, &what, self.diagnostics);
        let mut whole = true;
        let mut inputs = IndexMap::new();
        let empty = Table::new();
        let wired = match meant(keys, "inputs", &known) {
            Some(value) => table(value, "inputs", self.diagnostics)?,
            None => &empty,
        };
        let ports: Vec<&str> = module.inputs.iter().map(String::as_str).collect();
        known_keys(
            wired,
            &ports,
            &format!("`inputs` of {what}"),
            self.diagnostics,
        );
        for input in &module.inputs {
            match meant(wired, input, &ports) {
                Some(value) => {
                    let value = self.input(value, level);
                    inputs.insert(input.clone(), self.outward(value, around, &what));
                }
                None => {
                    whole = false;
                    let advice = format!("wire it, e.g. inputs.{input} = \"…\"");
                    let key = format!("inputs.{input}");
                    missing(&entry.value, &key, &what, Some(&advice), self.diagnostics);
                }
            }
        }
        let mut parameters: IndexMap<_, _> = module
            .defaults()
            .map(|(name, entry)| (name.to_owned(), entry.value.clone()))
            .collect();
        for parameter in module.parameter_names() {
            match meant(keys, parameter, &known) {
                Some(value) => {
                    let value = match &level.given {
                        Some(given) => given.fill(value, self.diagnostics),
                        None => value.clone(),
                    };
                    let value = self.outward(value, around, &what);
                    parameters.insert(parameter.to_owned(), value);
                }
                None if parameters.contains_key(parameter) => {}
                None => {
                    whole = false;
                    missing(&entry.value, parameter, &what, None, self.diagnostics);
                }
            }
        }
        whole.then(|| Given {
            module: module.name.to_owned(),
            inputs,
            parameters,
        })
    }

    /// A value given to an instance, its members written so that no set inside the module can be meant.
    fn outward(&mut self, value: Value, around: Option<&Around>, what: &str) -> Value {
        let Some(within) = around else {
            return value;
        };
        let open = |set: &String| (set.clone(), format!("{{{}}}", within.placeholder(set)));
        let open: Vec<_> = within.each.iter().map(open).collect();
        let open: Vec<_> = open.iter().map(|(a, b)| (a.as_str(), b.as_str())).collect();
        let is_strange =
            |name: &&str| !name.contains('/') && !within.each.iter().any(|set| set == name);
        value.with_texts(&mut |text, place| {
            for name in placeholder::names(text).filter(is_strange) {
                let problem = problem::UnknownPlaceholder {
                    name: name.to_owned(),
                    known: within.each.clone(),
                    what: what.to_owned(),
                    instead: None,
                };
                self.diagnostics.report(place, problem);
            }
            Value::new(place, Data::Text(placeholder::fill(text, &open)))
        })
    }
}
