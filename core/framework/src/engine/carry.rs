//! Decides which nodes of a new graph go on from what those of the old one know.

use std::collections::BTreeSet;

use serde::Serialize;

use super::{Engine, Fitted};
use crate::compile::{Change, Plan, PlanDiff, PlannedNode, PlannedRole, diff};

/// The one change after which an old state is offered to a node.
const PARAMETERS: &str = "its parameters changed";

/// What of an old graph goes on in a new one, as is: everything downstream of nothing that changed.
#[derive(Debug, Clone)]
pub(crate) struct Untouched {
    /// Instances.
    pub(crate) nodes: BTreeSet<String>,
    /// Channels, those of the signals with them.
    pub(crate) channels: BTreeSet<String>,
    diff: PlanDiff,
}

/// What became of a node in a swap.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct NodeCarry {
    /// The instance: `thermal.Z1`.
    pub node: String,
    /// What became of it.
    #[serde(flatten)]
    pub outcome: Carry,
}

/// How a node of a new graph begins.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(tag = "carry", rename_all = "lowercase")]
pub enum Carry {
    /// As it was: neither it nor anything that it reads has changed.
    Carried,
    /// From the old state, though something about it changed.
    Adopted {
        /// What changed.
        reason: String,
    },
    /// From the old state, which was of an older form.
    Migrated {
        /// The name of that form.
        from: String,
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

impl Untouched {
    /// All of a plan, in itself.
    pub(crate) fn all(plan: &Plan) -> Self {
        Self {
            nodes: plan.nodes.iter().map(PlannedNode::instance).collect(),
            channels: plan
                .channels
                .iter()
                .map(|channel| channel.name.clone())
                .collect(),
            diff: diff(plan, plan),
        }
    }

    /// Compares two fitted plans. With `learned`, a new fit upstream leaves untouched what was learned of it.
    pub(crate) fn between(old: (&Plan, &Fitted), new: (&Plan, &Fitted), learned: bool) -> Self {
        let mut untouched = Self {
            nodes: BTreeSet::new(),
            channels: BTreeSet::new(),
            diff: diff(old.0, new.0),
        };
        let unchanged = |change: &Change| *change == Change::Unchanged;
        let signals = untouched
            .diff
            .signals
            .iter()
            .filter(|signal| unchanged(&signal.change));
        untouched.channels = signals.map(|signal| signal.channel.clone()).collect();
        let same: BTreeSet<String> = untouched
            .diff
            .nodes
            .iter()
            .filter(|node| unchanged(&node.change))
            .filter(|node| learned || same_fit(old.1, new.1, &node.instance))
            .map(|node| node.instance.clone())
            .collect();
        // A node that closes a loop is asked before what it reads; a second round lets its answer count.
        for _ in 0..2 {
            for node in &new.0.nodes {
                let instance = node.instance();
                let closing = matches!(
                    node.role,
                    PlannedRole::Feature {
                        closes_loops: true,
                        ..
                    }
                );
                let reads_untouched = closing
                    || reads(new.0, node)
                        .all(|slot| untouched.channels.contains(&new.0.channels[slot].name));
                if same.contains(&instance) && reads_untouched {
                    untouched.channels.extend(
                        node.slots
                            .clone()
                            .map(|slot| new.0.channels[slot].name.clone()),
                    );
                    untouched.nodes.insert(instance);
                }
            }
            let loops: Vec<_> = new
                .0
                .nodes
                .iter()
                .filter(|node| {
                    matches!(
                        node.role,
                        PlannedRole::Feature {
                            closes_loops: true,
                            ..
                        }
                    )
                })
                .filter(|node| {
                    !reads(new.0, node)
                        .all(|slot| untouched.channels.contains(&new.0.channels[slot].name))
                })
                .collect();
            if loops.is_empty() {
                break;
            }
            // Something that a loop reads has changed: all that hangs on the loop is touched.
            for node in loops {
                untouched.touch(new.0, node);
            }
        }
        untouched
    }

    /// Takes a node out, with all that reads it.
    fn touch(&mut self, plan: &Plan, node: &PlannedNode) {
        let mut open = vec![node];
        while let Some(node) = open.pop() {
            if !self.nodes.remove(&node.instance()) {
                continue;
            }
            for slot in node.slots.clone() {
                self.channels.remove(&plan.channels[slot].name);
            }
            let slots = node.slots.clone();
            open.extend(
                plan.nodes
                    .iter()
                    .filter(|other| reads(plan, other).any(|slot| slots.contains(&slot))),
            );
        }
    }

    /// Why a node cannot simply go on, and whether its old state may still be of use.
    pub(crate) fn changed(&self, old: &Engine, new: &Engine, node: &PlannedNode) -> (String, bool) {
        let reason = self.reason(old, new, node);
        let reads_untouched = reads(new.plan(), node)
            .all(|slot| self.channels.contains(&new.plan().channels[slot].name));
        (reason.clone(), reads_untouched && reason == PARAMETERS)
    }

    fn reason(&self, old: &Engine, new: &Engine, node: &PlannedNode) -> String {
        let instance = node.instance();
        match self.diff.node(&instance) {
            None | Some(Change::Added | Change::Removed) => return "it is new".to_owned(),
            Some(Change::Changed(changes)) => {
                let inputs = changes
                    .iter()
                    .any(|change| change.path.starts_with("inputs"));
                let kind = changes.iter().any(|change| change.path == "type");
                return match (kind, inputs) {
                    (true, _) => "its type changed",
                    (false, true) => "its inputs changed",
                    (false, false) => PARAMETERS,
                }
                .to_owned();
            }
            Some(Change::Unchanged) => {}
        }
        if !same_fit(old.fitted(), new.fitted(), &instance) {
            return "it was fitted anew".to_owned();
        }
        let changed = reads(new.plan(), node)
            .map(|slot| &new.plan().channels[slot].name)
            .find(|name| !self.channels.contains(*name));
        match changed {
            Some(name) => format!("`{name}`, which it reads, changed"),
            None => "it hangs on something that changed".to_owned(),
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

/// The slots that a node reads, with its truth.
fn reads<'a>(plan: &'a Plan, node: &'a PlannedNode) -> impl Iterator<Item = usize> + 'a {
    let (gathers, truth): (&[usize], Option<usize>) = match &node.role {
        PlannedRole::Feature { gathers, .. } => (gathers, None),
        PlannedRole::Estimator { gathers, truth, .. } => (gathers, Some(truth.slot)),
        PlannedRole::Combiner { voters, truth, .. } => {
            (std::slice::from_ref(voters), truth.map(|truth| truth.slot))
        }
    };
    let entries = gathers
        .iter()
        .flat_map(|&gather| &plan.gathers[gather].entries);
    entries.map(|entry| entry.slot).chain(truth)
}
