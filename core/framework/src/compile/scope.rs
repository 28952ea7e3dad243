//! Which slots a reference names.

use std::cell::OnceCell;
use std::collections::BTreeSet;
use std::sync::Arc;

use indexmap::{IndexMap, IndexSet};

use super::port_channels::PortChannels;
use super::problem;
use super::reference::Reference;
use crate::diagnostic::{Names, Problem};

/// What the names of a graph stand for, as far as it is known.
#[derive(Debug, Default)]
pub(crate) struct Scopes {
    scopes: IndexMap<String, Scope>,
    /// What there is to refer to, once somebody refers to what there is not.
    known: OnceCell<Arc<Names>>,
    /// Nodes that a file inherits and removes.
    pub(crate) removed: Vec<String>,
}

/// The output ports of a node or signal, as the rest of the graph sees them.
#[derive(Debug, Default, Clone)]
pub(crate) struct Scope {
    /// Ports by name; the first is the default.
    pub(crate) ports: IndexMap<&'static str, PortChannels>,
    /// Set when an error of it has been reported, so that references to it say nothing more.
    pub(crate) broken: bool,
}

/// The outcome of looking a reference up.
pub(crate) enum Found {
    /// Slots in the producer's order.
    Slots(Vec<usize>),
    /// Nothing, and the reason has been reported where the producer stands.
    Broken,
}

/// The names that a graph gives itself: an instance of a module stands for the nodes inside of it.
pub fn outermost<'a>(names: impl Iterator<Item = &'a str>) -> Arc<Names> {
    let outer: IndexSet<&str> = names.map(without_inner).collect();
    Arc::new(outer.into_iter().map(str::to_owned).collect())
}

fn without_inner(name: &str) -> &str {
    name.split(['/', '[']).next().unwrap_or_default()
}

impl Scopes {
    pub(crate) fn declare(&mut self, name: &str) {
        self.scopes.entry(name.to_owned()).or_default();
        let known = self.known.get();
        if known.is_some_and(|known| !known.contains(without_inner(name))) {
            self.known.take();
        }
    }

    pub(crate) fn get_mut(&mut self, name: &str) -> &mut Scope {
        if !self.scopes.contains_key(name) {
            self.declare(name);
        }
        &mut self.scopes[name]
    }

    /// The names of which something is missing.
    pub(crate) fn broken(&self) -> BTreeSet<String> {
        let broken = self.scopes.iter().filter(|(_, scope)| scope.broken);
        broken.map(|(name, _)| name.clone()).collect()
    }

    /// What there is to refer to. It is listed once: a graph may refer to thousands of names that it does not have.
    fn known(&self) -> &Arc<Names> {
        self.known
            .get_or_init(|| outermost(self.scopes.keys().map(String::as_str)))
    }

    pub(crate) fn look_up(&self, text: &str) -> Result<Found, Box<dyn Problem>> {
        let reference = Reference::parse(text);
        if reference.is_member() {
            // Such a reference was made from one that named a node.
            let whole = self.scopes.get(&*reference.whole_node());
            if whole.is_some_and(|whole| whole.broken) {
                return Ok(Found::Broken);
            }
        }
        let Some(scope) = self.scopes.get(reference.node) else {
            // What an instance of a module stands for is not there either when the instance is broken.
            let outer = reference.node.split(['/', '[']).next().unwrap_or_default();
            if self.scopes.get(outer).is_some_and(|outer| outer.broken) {
                return Ok(Found::Broken);
            }
            if self.removed.iter().any(|removed| removed == outer) {
                return Err(Box::new(problem::RemovedNode {
                    node: outer.to_owned(),
                }));
            }
            return Err(Box::new(problem::UnknownNode {
                node: reference.node.to_owned(),
                known: Arc::clone(self.known()),
            }));
        };
        if scope.broken {
            return Ok(Found::Broken);
        }
        let named = match reference.port {
            // A signal has its channels under no name.
            Some("") => None,
            Some(port) => scope.ports.get(port),
            None => scope.ports.get_index(0).map(|(_, channels)| channels),
        };
        let Some(channels) = named else {
            let ports = scope.ports.keys().copied();
            let ports = ports.filter(|port| !port.is_empty());
            return Err(reference.no_port(ports.collect()));
        };
        Ok(Found::Slots(channels.find(&reference)?))
    }
}
