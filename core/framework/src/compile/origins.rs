//! What the slots of a plan follow from, and what follows from them.

use std::collections::BTreeMap;

use super::{Plan, PlannedNode};
use crate::node::Duty;

/// The slots from which others follow, these included, where `reads` gives those that a node goes by.
#[must_use]
pub fn upstream(
    plan: &Plan,
    slots: impl IntoIterator<Item = usize>,
    reads: impl Fn(&PlannedNode) -> Vec<usize>,
) -> Vec<bool> {
    let mut found = vec![false; plan.channels.len()];
    let mut seen = vec![false; plan.nodes.len()];
    let mut open: Vec<usize> = slots.into_iter().collect();
    while let Some(slot) = open.pop() {
        found[slot] = true;
        if let Some(node) = plan.channels[slot].node
            && !std::mem::replace(&mut seen[node], true)
        {
            open.extend(reads(&plan.nodes[node]));
        }
    }
    found
}

/// What follows from something, by number.
pub(crate) struct Dependents {
    pub(crate) nodes: Vec<bool>,
    pub(crate) slots: Vec<bool>,
}

impl Dependents {
    /// Everything that follows from these signals and nodes, through loops too.
    pub(crate) fn of(plan: &Plan, signals: &[bool], node: impl Fn(usize) -> bool) -> Self {
        let mut slots = vec![false; plan.channels.len()];
        slots[..signals.len()].copy_from_slice(signals);
        let mut readers = vec![Vec::new(); plan.channels.len()];
        for (index, node) in plan.nodes.iter().enumerate() {
            for slot in plan.reads(node) {
                readers[slot].push(index);
            }
        }
        let mut nodes = vec![false; plan.nodes.len()];
        let mut open: Vec<usize> = (0..plan.nodes.len()).filter(|&index| node(index)).collect();
        for slot in (0..signals.len()).filter(|&slot| signals[slot]) {
            open.extend(&readers[slot]);
        }
        while let Some(index) = open.pop() {
            if !std::mem::replace(&mut nodes[index], true) {
                for slot in plan.nodes[index].slots.clone() {
                    slots[slot] = true;
                    open.extend(&readers[slot]);
                }
            }
        }
        Self { nodes, slots }
    }
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

/// The measured channels that a node watches over, each with the slot of the port `reason` that is about it.
#[must_use]
pub fn health_reasons(plan: &Plan) -> BTreeMap<usize, usize> {
    let mut reasons = BTreeMap::new();
    for node in plan
        .nodes
        .iter()
        .filter(|node| node.kind.duty() == Duty::Watch)
    {
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
