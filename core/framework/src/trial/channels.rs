//! Decides which channels of a plan a test's reference names.

use std::cell::OnceCell;
use std::collections::HashMap;
use std::sync::Arc;

use indexmap::IndexMap;

use crate::compile::{CompileProblem, Plan, PortChannels, Reference, outermost};
use crate::diagnostic::Names;

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
    pub(super) fn of(plan: &'a Plan) -> Self {
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
        let mut outputs: HashMap<&str, PortChannels> = HashMap::new();
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

    /// The slots of a reference, in the order of the plan. The names of outputs (`predicted.Z1`) are understood too.
    pub(super) fn look_up(&self, text: &str) -> Result<Vec<usize>, CompileProblem> {
        let reference = Reference::parse(text);
        let Some(node) = self.nodes.get(reference.node) else {
            let output = self.outputs.get(reference.node);
            let output = output.filter(|_| reference.port.is_none());
            return match output {
                Some(channels) => channels.find(&reference),
                None => Err(CompileProblem::UnknownNode {
                    node: reference.node.to_owned(),
                    known: Arc::clone(self.known()),
                }),
            };
        };
        let default = node.named.first().copied().unwrap_or_default();
        let port = reference.port.filter(|&port| port != default);
        match node.ports.get(&port) {
            Some(channels) => channels.find(&reference),
            None => Err(CompileProblem::UnknownPort {
                node: reference.node.to_owned(),
                port: reference.port.unwrap_or_default().to_owned(),
                known: node.named.clone(),
            }),
        }
    }

    /// The measured channels of a reference, as positions among [`Plan::sources`].
    pub(super) fn look_up_measured(
        &self,
        text: &str,
    ) -> Result<Result<Vec<usize>, String>, CompileProblem> {
        let slots = self.look_up(text)?;
        let is_computed = |slot: &&usize| **slot >= self.plan.sources.len();
        Ok(match slots.iter().find(is_computed) {
            Some(&computed) => Err(self.plan.channels[computed].name.clone()),
            None => Ok(slots),
        })
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
