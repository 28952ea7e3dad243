//! Decides the steps of a tick, which ports are computed at all, and what nobody uses.

use std::collections::{BTreeSet, HashMap, HashSet};

use super::Wanted;
use super::plan::{Plan, PlannedNode, PlannedRole, Step};
use super::problem::CompileProblem;
use crate::diagnostic::Diagnostics;
use crate::document::GraphFile;
use crate::node::Role;
use crate::time::Duration;

/// The steps: each gather right before its first reader, each node after those that it reads, captures last.
///
/// Nodes stand in the plan in the order in which they were resolved, which is one in which they can run.
pub(super) fn steps(plan: &Plan) -> Vec<Step> {
    let mut steps = Vec::with_capacity(plan.nodes.len() + plan.gathers.len());
    let mut gathered = HashSet::new();
    let mut late = Vec::new();
    for (index, node) in plan.nodes.iter().enumerate() {
        let closes_loops = matches!(
            node.role,
            PlannedRole::Feature {
                closes_loops: true,
                ..
            }
        );
        let gathers = gathers(&node.role);
        if closes_loops {
            late.push((index, gathers));
        } else {
            steps.extend(
                gathers
                    .into_iter()
                    .filter(|&gather| gathered.insert(gather))
                    .map(Step::Gather),
            );
        }
        steps.push(Step::Run(index));
    }
    for (index, gathers) in late {
        steps.extend(
            gathers
                .into_iter()
                .filter(|&gather| gathered.insert(gather))
                .map(Step::Gather),
        );
        steps.push(Step::Capture(index));
    }
    steps
}

/// The longest time that a node needs to know all that it would know had it always run.
pub(super) fn warm_up(plan: &Plan) -> Duration {
    let mut of_slot = vec![Duration::ZERO; plan.channels.len()];
    for node in &plan.nodes {
        let warm_up = warm_up_of(plan, &of_slot, node);
        of_slot[node.slots.clone()].fill(warm_up);
    }
    of_slot.into_iter().max().unwrap_or(Duration::ZERO)
}

/// The time after which a node, started cold, knows all that it would know had it always run.
fn warm_up_of(plan: &Plan, slot_warm_up: &[Duration], node: &PlannedNode) -> Duration {
    let entries = |gather: usize| &plan.gathers[gather].entries;
    let before = |gathers: &[usize]| {
        let all = gathers.iter().flat_map(|&gather| entries(gather));
        let ages = all.map(|entry| slot_warm_up[entry.slot] + entry.lag + entry.max_age);
        ages.max().unwrap_or(Duration::ZERO)
    };
    match (&node.role, node.spec.role()) {
        (PlannedRole::Feature { gathers, .. }, Role::Feature(feature)) => {
            feature.memory() + before(gathers)
        }
        (PlannedRole::Combiner { voters, truth, .. }, Role::Combiner(combiner)) => {
            let learned = truth.map_or(Duration::ZERO, |truth| {
                truth.embargo() + truth.ahead + truth.limit
            });
            combiner.memory() + learned + before(&[*voters])
        }
        (PlannedRole::Estimator { gathers, .. }, _) => before(gathers),
        _ => unreachable!("a plan gives each node the role of its specification"),
    }
}

fn gathers(role: &PlannedRole) -> Vec<usize> {
    match role {
        PlannedRole::Feature { gathers, .. } | PlannedRole::Estimator { gathers, .. } => {
            gathers.clone()
        }
        PlannedRole::Combiner { voters, .. } => vec![*voters],
    }
}

/// Notes which ports of features somebody reads. The first is always computed.
pub(super) fn mark_wanted(plan: &mut Plan, read: &BTreeSet<usize>, wanted: Wanted) {
    let truths: BTreeSet<usize> = plan
        .nodes
        .iter()
        .filter_map(|node| truth(&node.role))
        .collect();
    for node in &mut plan.nodes {
        let is_truth = truths.range(node.slots.clone()).next().is_some();
        if let PlannedRole::Combiner { weights, .. } = &mut node.role {
            let ports = node.ports.get(1);
            *weights = ports.is_some_and(|(_, slots)| read.range(slots.clone()).next().is_some());
        }
        if let PlannedRole::Feature { wanted: ports, .. } = &mut node.role {
            for (index, (name, slots)) in node.ports.iter().enumerate() {
                let error_of_truth = wanted.standard_errors && is_truth && *name == "stderr";
                ports[index] =
                    index == 0 || error_of_truth || read.range(slots.clone()).next().is_some();
            }
        }
    }
}

fn truth(role: &PlannedRole) -> Option<usize> {
    match role {
        PlannedRole::Estimator { truth, .. } => Some(truth.slot),
        PlannedRole::Combiner { truth, .. } => truth.map(|truth| truth.slot),
        PlannedRole::Feature { .. } => None,
    }
}

/// Tells of outputs that nothing flows into, and of nodes and signals that flow into no output.
pub(super) fn warn(graph: &GraphFile, plan: &Plan, diagnostics: &mut Diagnostics) {
    if plan.outputs.is_empty() {
        diagnostics.report(graph.tree.place, CompileProblem::NoOutputs);
        return;
    }
    let fed = fed(plan);
    let owner = |name: &str| name.split('.').next().unwrap_or_default().to_owned();
    let mut dry = HashMap::new();
    for column in plan.outputs.iter().filter(|c| !fed.contains(&c.slot)) {
        dry.entry(owner(&column.name))
            .or_insert_with(|| column.name.clone());
    }
    for output in &graph.outputs {
        if let Some(column) = dry.remove(&output.name) {
            let problem = CompileProblem::Unreachable { output: column };
            diagnostics.report(output.place, problem);
        }
    }
    let used = used(plan);
    let used_nodes: BTreeSet<&str> = plan
        .nodes
        .iter()
        .filter(|node| used.range(node.slots.clone()).next().is_some())
        .map(|node| node.name.as_str())
        .collect();
    for node in graph
        .nodes
        .iter()
        .filter(|node| !used_nodes.contains(node.name.as_str()))
    {
        if !node.instances.is_empty() {
            diagnostics.report(
                node.place,
                CompileProblem::UnusedNode {
                    node: node.name.clone(),
                },
            );
        }
    }
    let used_signals: HashSet<String> = (0..plan.sources.len())
        .filter(|slot| used.contains(slot))
        .map(|slot| owner(&plan.channels[slot].name))
        .collect();
    for signal in &graph.signals {
        if !used_signals.contains(&signal.name) {
            diagnostics.report(
                signal.place,
                CompileProblem::UnusedSignal {
                    signal: signal.name.clone(),
                },
            );
        }
    }
}

/// The slots that a node reads, with its truth.
fn reads(plan: &Plan, node: usize) -> impl Iterator<Item = usize> + '_ {
    let role = &plan.nodes[node].role;
    let data = gathers(role)
        .into_iter()
        .flat_map(|gather| plan.gathers[gather].entries.iter().map(|entry| entry.slot));
    data.chain(truth(role))
}

/// Every slot that a measured channel reaches.
fn fed(plan: &Plan) -> BTreeSet<usize> {
    let mut fed: BTreeSet<usize> = (0..plan.sources.len()).collect();
    loop {
        let before = fed.len();
        for (index, node) in plan.nodes.iter().enumerate() {
            if reads(plan, index).any(|slot| fed.contains(&slot)) {
                fed.extend(node.slots.clone());
            }
        }
        // A second round is needed only where a loop is closed from behind.
        if fed.len() == before {
            return fed;
        }
    }
}

/// Every slot that some output depends on.
fn used(plan: &Plan) -> BTreeSet<usize> {
    let mut used = BTreeSet::new();
    let mut open: Vec<usize> = plan.outputs.iter().map(|output| output.slot).collect();
    let mut seen = BTreeSet::new();
    while let Some(slot) = open.pop() {
        if !used.insert(slot) {
            continue;
        }
        if let Some(node) = plan.channels[slot].node
            && seen.insert(node)
        {
            open.extend(reads(plan, node));
        }
    }
    used
}
