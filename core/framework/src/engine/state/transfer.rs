//! Which nodes of a new graph go on from the state of the old one.

use std::collections::HashMap;
use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::compile::origins::Dependents;
use crate::compile::{Change, Plan, PlannedNode, diff};
use crate::engine::{Engine, Fitted};

/// What of an old graph goes on in a new one, by the numbers of the new one.
#[derive(Debug, Clone)]
pub struct StateTransfer {
    /// How each node begins.
    pub(crate) nodes: Vec<Begin>,
    /// Whether each slot goes on as it was: nothing that it hangs on has changed.
    pub(crate) slots: Vec<bool>,
    /// Whether each output shows the same channel as before, which goes on as it was.
    pub(crate) outputs: Vec<bool>,
}

/// How a node begins.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Begin {
    /// As it was.
    AsItWas,
    /// The old state is offered to it.
    Offered {
        /// What changed.
        reason: String,
    },
    /// Without what the old one knew.
    Afresh {
        /// What changed.
        reason: String,
    },
}

/// What became of a node in a swap.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct NodeCarry {
    /// The instance: `thermal.Z1`.
    pub node: String,
    /// What became of it.
    #[serde(flatten)]
    pub outcome: Carry,
}

impl NodeCarry {
    /// What becomes of a graph, with a line for each node that does not go on as it was.
    #[must_use]
    pub fn graph_words(graph: &Path, revision: &str, all: &[Self]) -> String {
        let carried = all.iter().filter(|node| node.outcome == Carry::Carried);
        format!(
            "{} (revision {revision}): {} of {} nodes go on as they were{}",
            graph.display(),
            carried.count(),
            all.len(),
            Self::words(all)
        )
    }

    /// What becomes of the nodes that do not go on as they were, a line each.
    #[must_use]
    pub fn words(all: &[Self]) -> String {
        let words = all.iter().filter_map(|of| {
            let (how, why) = match &of.outcome {
                Carry::Carried => return None,
                Carry::Adopted { reason } => ("goes on from the old state", reason),
                Carry::Warmed { reason } => ("warmed by the past", reason),
                Carry::Cold { reason } => ("cold", reason),
            };
            Some(format!("\n  {}: {how}, {why}", of.node))
        });
        words.collect()
    }
}

/// How a node of a new graph begins.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "carry", rename_all = "lowercase")]
pub enum Carry {
    /// As it was: neither it nor anything that it reads has changed.
    Carried,
    /// From the old state, though something about it changed.
    Adopted {
        /// What changed.
        reason: String,
    },
    /// Warmed by the retained past.
    Warmed {
        /// Why it could not be carried.
        reason: String,
    },
    /// Afresh, since nothing of the past is retained.
    Cold {
        /// Why it could not be carried.
        reason: String,
    },
}

impl StateTransfer {
    /// All of a plan, in itself.
    pub fn all(plan: &Plan) -> Self {
        Self {
            nodes: vec![Begin::AsItWas; plan.nodes.len()],
            slots: vec![true; plan.channels.len()],
            outputs: vec![true; plan.outputs.len()],
        }
    }

    /// What goes on from one engine in another. With `learned`, a node is offered its old state although it, or what it
    /// reads, has been fitted anew.
    pub fn between(old: &Engine, new: &Engine, learned: bool) -> Self {
        let (was, plan) = (&**old.plan(), &**new.plan());
        let diff = diff(was, plan);
        let changes: HashMap<_, _> = diff
            .nodes
            .iter()
            .map(|node| (node.instance.as_str(), &node.change))
            .collect();
        let instances: Vec<String> = plan.nodes.iter().map(PlannedNode::instance).collect();
        let refitted: Vec<bool> = instances
            .iter()
            .map(|instance| !same_fit(old.fitted(), new.fitted(), instance))
            .collect();
        let before = Before::of(was);
        let own: Vec<Option<Own>> = (plan.nodes.iter().zip(&instances).zip(&refitted))
            .map(|((node, instance), refitted)| {
                Own::of(changes.get(instance.as_str()).copied())
                    .or_else(|| before.other_units(plan, node).then_some(Own::Unit))
                    .or_else(|| refitted.then_some(Own::Fit))
            })
            .collect();
        let signals = diff
            .signals
            .iter()
            .map(|signal| signal.change != Change::Unchanged);
        let mut other_signals: Vec<bool> = signals.collect();
        other_signals.truncate(plan.sources.len());
        let touched = Dependents::of(plan, &other_signals, |node| own[node].is_some());
        let but_for_fits = Dependents::of(plan, &other_signals, |node| {
            own[node].as_ref().is_some_and(|own| *own != Own::Fit)
        });
        let nodes = plan.nodes.iter().enumerate().map(|(index, node)| {
            if !touched.nodes[index] {
                return Begin::AsItWas;
            }
            let read = plan.reads(node).find(|&slot| touched.slots[slot]);
            let reason = match (&own[index], read) {
                (Some(own), _) => own.reason().to_owned(),
                (None, Some(slot)) => {
                    format!("`{}`, which it reads, changed", plan.channels[slot].name)
                }
                (None, None) => unreachable!("a node is touched by itself or by what it reads"),
            };
            let retuned = matches!(own[index], Some(Own::Parameters | Own::Unit)) && read.is_none();
            let stands = new.nodes[index].outlives_changes()
                && !matches!(own[index], Some(Own::New | Own::Type))
                && before.same_channels(plan, node);
            // A new fit replaces what was learned, also where it was made for other parameters.
            if (retuned && (learned || !refitted[index]))
                || (learned && !but_for_fits.nodes[index])
                || stands
            {
                Begin::Offered { reason }
            } else {
                Begin::Afresh { reason }
            }
        });
        let outputs = plan.outputs.iter().map(|output| {
            let name = &plan.channels[output.slot].name;
            !touched.slots[output.slot]
                && was.outputs.iter().any(|before| {
                    before.name == output.name && was.channels[before.slot].name == *name
                })
        });
        Self {
            nodes: nodes.collect(),
            outputs: outputs.collect(),
            slots: touched.slots.iter().map(|touched| !touched).collect(),
        }
    }
}

/// The channels of an old plan, by what a new one calls them.
struct Before<'a> {
    plan: &'a Plan,
    slots: HashMap<&'a str, usize>,
}

impl<'a> Before<'a> {
    fn of(plan: &'a Plan) -> Self {
        let named = plan.channels.iter().enumerate();
        let slots = named.map(|(slot, channel)| (channel.name.as_str(), slot));
        Self {
            plan,
            slots: slots.collect(),
        }
    }

    /// Whether a node gives a channel in another unit than before, be it for a quantity that is the same.
    fn other_units(&self, plan: &Plan, node: &PlannedNode) -> bool {
        let mut channels = plan.channels[node.slots.clone()].iter();
        channels.any(|now| {
            let slot = self.slots.get(now.name.as_str());
            slot.is_some_and(|&slot| self.plan.channels[slot].channel.unit != now.channel.unit)
        })
    }

    /// Whether what a node gives first are the channels that it gave, in the same order. One is that one, whatever its name.
    fn same_channels(&self, plan: &Plan, node: &PlannedNode) -> bool {
        let instance = node.instance();
        let mut nodes = self.plan.nodes.iter();
        let Some(was) = nodes.find(|was| was.instance() == instance) else {
            return false;
        };
        let first =
            |node: &PlannedNode| node.ports.first().map_or(0..0, |(_, slots)| slots.clone());
        let was = &self.plan.channels[first(was)];
        let now = &plan.channels[first(node)];
        let mut pairs = was.iter().zip(now);
        was.len() == now.len() && (now.len() == 1 || pairs.all(|(was, now)| was.name == now.name))
    }
}

/// What changed about a node itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Own {
    New,
    Type,
    Inputs,
    /// What was learned for another one is of no use for this.
    Horizon,
    Parameters,
    Unit,
    Fit,
}

impl Own {
    fn of(change: Option<&Change>) -> Option<Self> {
        match change {
            None | Some(Change::Added | Change::Removed) => Some(Self::New),
            Some(Change::Changed(parameters)) => {
                let of = |name: &str| {
                    parameters
                        .iter()
                        .any(|change| change.path.split('.').next() == Some(name))
                };
                let kinds = [
                    ("type", Self::Type),
                    ("inputs", Self::Inputs),
                    ("ahead", Self::Horizon),
                ];
                let kind = kinds.into_iter().find(|(name, _)| of(name));
                Some(kind.map_or(Self::Parameters, |(_, own)| own))
            }
            Some(Change::Unchanged) => None,
        }
    }

    fn reason(self) -> &'static str {
        match self {
            Self::New => "it is new",
            Self::Type => "its type changed",
            Self::Inputs => "its inputs changed",
            Self::Horizon => "its horizon changed",
            Self::Parameters => "its parameters changed",
            Self::Unit => "the unit of its outputs changed",
            Self::Fit => "it was fitted anew",
        }
    }
}

fn same_fit(old: &Fitted, new: &Fitted, instance: &str) -> bool {
    let as_value = |fitted: &Fitted| {
        fitted
            .get(instance)
            .map(|fit| serde_json::to_value(fit.as_ref()).ok())
    };
    as_value(old) == as_value(new)
}
