//! A graph that is ready to take over.

use std::fmt;

use super::handover::LiveEngine;
use super::shadow::Shadow;
use crate::engine::{Carry, Engine, NodeCarry};
use crate::time::Duration;

/// A graph that is ready to take over, and kept so.
pub struct Staged {
    pub(super) live: LiveEngine,
    pub(super) carry: Vec<NodeCarry>,
    /// How much of the past it was warmed by.
    pub(super) past: Duration,
    /// For each output, whether it had a value on the way.
    pub(super) gave: Vec<bool>,
    pub(super) shadow: Option<Shadow>,
}

impl Staged {
    /// What becomes of each node, in the order of the new plan.
    #[must_use]
    pub fn carry(&self) -> &[NodeCarry] {
        &self.carry
    }

    /// The revision of the graph.
    #[must_use]
    pub fn revision(&self) -> &str {
        &self.live.revision
    }

    /// How much of the past there was to warm it by, and how far it looks back, where something of it was warmed by less than that.
    #[must_use]
    pub fn too_short_a_past(&self) -> Option<(Duration, Duration)> {
        let wanted = self.live.engine.plan().warm_up;
        let short = self.past < wanted && self.is_warmed();
        short.then_some((self.past, wanted))
    }

    /// How much of the past there was to warm it by, and where that is as much as it looks back, the outputs that had no value
    /// anywhere in it: they are not likely to have any.
    #[must_use]
    pub fn silent(&self) -> (Duration, Vec<&str>) {
        let plan = self.live.engine.plan();
        let enough = self.past >= plan.warm_up && self.is_warmed();
        let outputs = plan.outputs.iter().zip(&self.gave);
        let silent = outputs.filter(|(_, gave)| enough && !**gave);
        (self.past, silent.map(|(output, _)| &*output.name).collect())
    }

    /// How much of the past there was to warm it by, and the nodes warmed by it that go by all of theirs, which no past brings back.
    #[must_use]
    pub fn endless(&self) -> (Duration, Vec<&str>) {
        let nodes = self.live.engine.plan().nodes.iter().zip(&self.carry);
        let endless = nodes.filter(|(node, carry)| node.endless && is_warmed(carry));
        (self.past, endless.map(|(_, carry)| &*carry.node).collect())
    }

    fn is_warmed(&self) -> bool {
        self.carry.iter().any(is_warmed)
    }
}

fn is_warmed(node: &NodeCarry) -> bool {
    matches!(node.outcome, Carry::Warmed { .. })
}

/// What becomes of each node of an engine where nothing is known of what runs.
pub(super) fn cold(engine: &Engine, warmed: bool) -> Vec<NodeCarry> {
    let reason = || "ticks were missed, so that nothing is known of what runs".to_owned();
    let outcome = || {
        if warmed {
            Carry::Warmed { reason: reason() }
        } else {
            Carry::Cold { reason: reason() }
        }
    };
    engine
        .plan()
        .nodes
        .iter()
        .map(|node| NodeCarry {
            node: node.instance(),
            outcome: outcome(),
        })
        .collect()
}

impl fmt::Debug for Staged {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Staged")
            .field("revision", &self.live.revision)
            .finish_non_exhaustive()
    }
}
