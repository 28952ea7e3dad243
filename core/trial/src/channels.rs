//! Decides which channels of a plan a test's reference names.

use std::cell::OnceCell;
use std::collections::HashMap;
use std::sync::Arc;

use indexmap::IndexMap;

use crate::compile::problem::UnknownNode;
use crate::compile::{Plan, PortChannels, Reference, outermost};
use crate::diagnostic::{Names, Problem};
use crate::document::OutputDecl;

/// The channels of a plan by what a reference calls them, listed once: a file may have thousands of tests.
pub(super) struct Channels<'a> {
    plan: &'a Plan,
    nodes: HashMap<&'a str, NodeChannels<'a>>,
    outputs: HashMap<&'a str, PortChannels>,
    /// What a reference may begin with, once one begins otherwise.
    known: OnceCell<Arc<Names>>,
}

/// The channels of a node or signal.
struct NodeChannels<'a> {
    /// Its ports; the first is the default. A signal has none.
    named: Vec<&'static str>,
    /// By port; nothing stands for the default.
    ports: IndexMap<Option<&'a str>, PortChannels>,
}

impl<'a> Channels<'a> {
    pub(super) fn of(plan: &'a Plan, declared: &'a [OutputDecl]) -> Self {
        let mut nodes: HashMap<&str, NodeChannels<'_>> = HashMap::new();
        for (slot, channel) in plan.channels.iter().enumerate() {
            let Reference {
                node,
                port,
                channel: name,
            } = Reference::parse(&channel.name);
            let node = nodes.entry(node).or_insert_with(|| NodeChannels {
                named: channel.node.map_or_else(Vec::new, |node| {
                    let ports = plan.nodes[node].ports.iter();
                    ports.map(|(name, _)| *name).collect()
                }),
                ports: IndexMap::new(),
            });
            let port = node.ports.entry(port).or_default();
            port.insert(name.unwrap_or_default().to_owned(), slot);
        }
        // One of which nothing is known, since it has mistakes, is no node of its name either.
        let empty = |output: &'a OutputDecl| (output.name.as_str(), PortChannels::default());
        let mut outputs: HashMap<&str, PortChannels> = declared.iter().map(empty).collect();
        for output in &plan.outputs {
            let Reference { node, channel, .. } = Reference::parse(&output.name);
            let output_channels = outputs.entry(node).or_default();
            output_channels.insert(channel.unwrap_or_default().to_owned(), output.slot);
        }
        Self {
            plan,
            nodes,
            outputs,
            known: OnceCell::new(),
        }
    }

    /// The slots of a reference, in their order. An output (`predicted.Z1`) comes before a node or signal of its name, since
    /// what it says is what the column of that name holds; behind a node's port stands no column.
    pub(super) fn look_up(&self, text: &str) -> Result<Vec<usize>, Box<dyn Problem>> {
        let reference = Reference::parse(text);
        let output = self.outputs.get(reference.node);
        match output.filter(|_| reference.port.is_none()) {
            Some(channels) => Ok(channels.find(&reference)?),
            None => self.look_up_inside(&reference),
        }
    }

    /// The same of nodes and signals alone.
    fn look_up_inside(&self, reference: &Reference<'_>) -> Result<Vec<usize>, Box<dyn Problem>> {
        let Some(node) = self.nodes.get(reference.node) else {
            let known = Arc::clone(self.known());
            let node = reference.node.to_owned();
            return Err(UnknownNode { node, known }.into());
        };
        let default = node.named.first().copied().unwrap_or_default();
        let channels = match reference.port {
            // A signal has its channels under no name.
            Some("") => None,
            port => node.ports.get(&port.filter(|&port| port != default)),
        };
        match channels {
            Some(channels) => Ok(channels.find(reference)?),
            None => Err(reference.no_port(node.named.clone())),
        }
    }

    /// The measured channels of a reference, as positions among [`Plan::sources`]: those of a signal, though an output may have its
    /// name.
    pub(super) fn look_up_measured(
        &self,
        text: &str,
    ) -> Result<Result<Vec<usize>, String>, Box<dyn Problem>> {
        let reference = Reference::parse(text);
        let slots = match self.nodes.contains_key(reference.node) {
            true => self.look_up_inside(&reference)?,
            false => self.look_up(text)?,
        };
        let is_computed = |slot: &&usize| **slot >= self.plan.sources.len();
        Ok(match slots.iter().find(is_computed) {
            Some(&computed) => Err(self.plan.channels[computed].name.clone()),
            None => Ok(slots),
        })
    }

    /// How to name what a reference means of a node, where an output has the node's name; none where it means no such thing.
    pub(super) fn of_the_node(&self, text: &str) -> Option<String> {
        let reference = Reference::parse(text);
        let port = *self.nodes.get(reference.node)?.named.first()?;
        let is_output = reference.port.is_none() && self.outputs.contains_key(reference.node);
        let is_there = is_output && self.look_up_inside(&reference).is_ok();
        let channel = reference.channel.filter(|_| is_there)?;
        Some(format!("{}:{port}.{channel}", reference.node))
    }

    /// The mistake of a reference that begins neither with a name that there is nor with one of `others`.
    pub(super) fn unknown(&self, text: &str, others: &[&str]) -> Option<UnknownNode> {
        let Reference { node, port, .. } = Reference::parse(text);
        let is_output = port.is_none() && self.outputs.contains_key(node);
        if is_output || self.nodes.contains_key(node) {
            return None;
        }
        let names = others.iter().copied().chain(self.known().iter());
        let known = Arc::new(names.map(str::to_owned).collect());
        let node = node.to_owned();
        Some(UnknownNode { node, known })
    }

    fn known(&self) -> &Arc<Names> {
        self.known.get_or_init(|| {
            let channels = self.plan.channels.iter().map(|channel| &channel.name);
            let outputs = self.plan.outputs.iter().map(|output| &output.name);
            let all = channels.chain(outputs);
            outermost(all.map(|name| Reference::parse(name).node))
        })
    }
}
