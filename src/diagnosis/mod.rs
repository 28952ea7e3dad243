//! Why a model predicts as well as it does, and what would make it better: the facts behind `athermal diagnose`.
//!
//! [`observe`] steps a model over a recording once; each of the modules works out one kind of fact from that and, where it
//! must, from further passes. All of them step the same engine that runs live.

pub mod lag;
mod observation;
pub mod response;

pub use observation::{Observation, SourceStatistics, observe};

use athermal_core::compile::{Plan, PlannedNode, PlannedRole};

/// The measured channels from which a slot follows, by their number.
fn sources_of(plan: &Plan, slot: usize) -> Vec<bool> {
    let mut of_slot = vec![false; plan.channels.len()];
    let mut waiting = vec![slot];
    while let Some(slot) = waiting.pop() {
        if std::mem::replace(&mut of_slot[slot], true) {
            continue;
        }
        if let Some(node) = plan.channels[slot].node {
            waiting.extend(reads(plan, &plan.nodes[node]));
        }
    }
    of_slot.truncate(plan.sources.len());
    of_slot
}

/// The slots that a node computes from; truths that it only learns from are not among them.
fn reads<'a>(plan: &'a Plan, node: &'a PlannedNode) -> impl Iterator<Item = usize> + 'a {
    let gathers: &[usize] = match &node.role {
        PlannedRole::Feature { gathers, .. } | PlannedRole::Estimator { gathers, .. } => gathers,
        PlannedRole::Combiner { voters, .. } => std::slice::from_ref(voters),
    };
    let entries = gathers
        .iter()
        .flat_map(|&gather| &plan.gathers[gather].entries);
    entries.map(|entry| entry.slot)
}

/// The measured channels that a truth is made of. Whatever else is measured is a sensor that may explain it.
fn of_truths(plan: &Plan) -> Vec<bool> {
    let mut any = vec![false; plan.sources.len()];
    for truth in plan.channels.iter().filter_map(|channel| channel.predicts) {
        for (any, of) in any.iter_mut().zip(sources_of(plan, truth)) {
            *any |= of;
        }
    }
    any
}
