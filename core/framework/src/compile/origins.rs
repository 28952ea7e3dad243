//! From which measured channels the slots of a plan follow.

use std::collections::BTreeMap;

use super::{Plan, PlannedNode};

/// The slots from which others follow, these included, where `reads` gives those that a node goes by.
#[must_use]
pub fn upstream(
    plan: &Plan,
    mut waiting: Vec<usize>,
    reads: impl Fn(&PlannedNode) -> Vec<usize>,
) -> Vec<bool> {
    let mut found = vec![false; plan.channels.len()];
    while let Some(slot) = waiting.pop() {
        let is_new = !std::mem::replace(&mut found[slot], true);
        if let Some(node) = plan.channels[slot].node.filter(|_| is_new) {
            waiting.extend(reads(&plan.nodes[node]));
        }
    }
    found
}

/// The slots of what a node takes as data; truths that it only learns from are not among them.
#[must_use]
pub fn inputs(plan: &Plan, node: &PlannedNode) -> Vec<usize> {
    slots(plan, node.role.inputs())
}

/// The slots that gathers read.
pub fn slots(plan: &Plan, gathers: impl Iterator<Item = usize>) -> Vec<usize> {
    let entries = gathers.flat_map(|gather| &plan.gathers[gather].entries);
    entries.map(|entry| entry.slot).collect()
}

/// The measured channels from which a slot follows, by their number.
#[must_use]
pub fn sources_of(plan: &Plan, slot: usize) -> Vec<bool> {
    let mut of_slot = upstream(plan, vec![slot], |node| inputs(plan, node));
    of_slot.truncate(plan.sources.len());
    of_slot
}

/// The measured channels that a `health` node watches over, each with the slot of the port `reason` that is about it.
#[must_use]
pub fn health_reasons(plan: &Plan) -> BTreeMap<usize, usize> {
    let mut reasons = BTreeMap::new();
    for node in plan.nodes.iter().filter(|node| node.kind.name == "health") {
        if let Some((_, slots)) = node.ports.get(1) {
            let watched = inputs(plan, node).into_iter().zip(slots.clone());
            reasons.extend(watched.filter(|(slot, _)| *slot < plan.sources.len()));
        }
    }
    reasons
}

/// The measured channels that a truth is made of. Whatever else is measured is a sensor that may explain it.
#[must_use]
pub fn of_truths(plan: &Plan) -> Vec<bool> {
    let mut any = vec![false; plan.sources.len()];
    for truth in plan.channels.iter().filter_map(|channel| channel.predicts) {
        for (any, of) in any.iter_mut().zip(sources_of(plan, truth)) {
            *any |= of;
        }
    }
    any
}
