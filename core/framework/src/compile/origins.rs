//! What the slots of a plan follow from, and what follows from them.

use std::collections::{BTreeMap, BTreeSet};

use super::{Plan, PlannedNode};
use crate::node::{Duty, Role};

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
    let made_of = |node: &PlannedNode| {
        let ports = match (node.spec.role(), node.ports.first()) {
            (Role::Feature(feature), Some((port, _))) => feature.reach(port).ports(usize::MAX),
            _ => usize::MAX,
        };
        slots(plan, node.role.inputs().take(ports))
    };
    let mut of_slot = upstream(plan, vec![slot], made_of);
    of_slot.truncate(plan.sources.len());
    of_slot
}

/// The truths with a window, by slot, and the channels without one of their own that each is taken over: positions that are measured, or
/// put back.
#[must_use]
pub fn windowed(plan: &Plan) -> BTreeMap<usize, Vec<usize>> {
    let truths = plan.nodes.iter().filter_map(|node| node.role.truth());
    let slots: BTreeSet<usize> = truths.map(|of| of.slot).collect();
    (slots.into_iter())
        .filter(|slot| !plan.channels[*slot].channel.span.is_zero())
        .map(|slot| (slot, taken_over(plan, slot)))
        .collect()
}

fn taken_over(plan: &Plan, slot: usize) -> Vec<usize> {
    let (mut found, mut open) = (Vec::new(), vec![slot]);
    let mut seen = vec![false; plan.channels.len()];
    while let Some(slot) = open.pop() {
        let of = &plan.channels[slot];
        if std::mem::replace(&mut seen[slot], true) {
            continue;
        }
        if of.channel.span.is_zero() {
            found.push(slot);
        } else if let Some(node) = of.node.map(|node| &plan.nodes[node])
            && let Role::Feature(feature) = node.spec.role()
            && let Some((port, own)) = node.ports.iter().find(|(_, of)| of.contains(&slot))
        {
            let inputs: Vec<_> =
                (node.role.inputs().map(|of| slots(plan, [of].into_iter()))).collect();
            let parts = feature
                .reach(port)
                .parts(&inputs, slot - own.start, own.len());
            open.extend(parts.into_iter().map(|(slot, _)| slot));
        }
    }
    found
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

/// The measured channels of what a correction applied: they leap and stand still as it does.
#[must_use]
pub fn applied(plan: &Plan) -> Vec<bool> {
    let nodes = plan.nodes.iter();
    let put_back = nodes.filter(|node| node.kind.duty() == Duty::PutBack);
    let read = slots(plan, put_back.filter_map(|node| node.role.inputs().nth(1)));
    (0..plan.sources.len())
        .map(|slot| read.contains(&slot))
        .collect()
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
