//! The steps of a tick, which ports are computed at all, and what nobody uses.

use std::collections::{HashMap, HashSet};
use std::ops::Range;

use super::Wanted;
use super::column_unit;
use super::origins::Dependents;
use super::plan::{NOVELTY, Plan, PlannedNode, PlannedRole, STD_DEV, Step, WEIGHTS};
use super::problem;
use crate::diagnostic::Diagnostics;
use crate::document::GraphFile;
use crate::node::Role;
use crate::time::Duration;

/// Makes a plan that can be stepped of nodes that stand in an order in which they can run. `read` are the slots that somebody
/// reads.
pub(super) fn lay_out(plan: &mut Plan, read: impl IntoIterator<Item = usize>, wanted: Wanted) {
    mark_read(plan, read, wanted);
    plan.steps = steps(plan);
    plan.warm_up = plan.warm_ups().into_iter().max().unwrap_or_default();
}

/// The steps: each gather right before its first reader, each node after those that it reads, captures last.
fn steps(plan: &Plan) -> Vec<Step> {
    let mut steps = Vec::with_capacity(plan.nodes.len() + plan.gathers.len());
    let mut read = vec![false; plan.gathers.len()];
    let mut gather = |steps: &mut Vec<Step>, node: usize| {
        let gathers = plan.nodes[node].role.gathers();
        let first = gathers.filter(|&gather| !std::mem::replace(&mut read[gather], true));
        steps.extend(first.map(Step::Gather));
    };
    for node in 0..plan.nodes.len() {
        if !plan.closes_loops(node) {
            gather(&mut steps, node);
        }
        steps.push(Step::Run(node));
    }
    for node in (0..plan.nodes.len()).filter(|&node| plan.closes_loops(node)) {
        gather(&mut steps, node);
        steps.push(Step::Capture(node));
    }
    steps
}

impl Plan {
    /// By node, the time after which it, started cold, knows all that it would know had it always run.
    #[must_use]
    pub fn warm_ups(&self) -> Vec<Duration> {
        let mut of_slot = vec![Duration::ZERO; self.channels.len()];
        let mut warm_ups = Vec::with_capacity(self.nodes.len());
        for node in &self.nodes {
            let warm_up = warm_up_of(self, &of_slot, node);
            of_slot[node.slots.clone()].fill(warm_up);
            warm_ups.push(warm_up);
        }
        warm_ups
    }
}

fn warm_up_of(plan: &Plan, slot_warm_up: &[Duration], node: &PlannedNode) -> Duration {
    let entries = |gather: usize| &plan.gathers[gather].entries;
    let before = || {
        let all = node.role.gathers().flat_map(entries);
        let ages = all.map(|entry| slot_warm_up[entry.slot] + entry.lag + entry.max_age);
        ages.max().unwrap_or(Duration::ZERO)
    };
    let learned = match &node.role {
        PlannedRole::Combiner {
            truth: Some(truth), ..
        } => truth.embargo() + truth.ahead + truth.limit,
        _ => Duration::ZERO,
    };
    node.memory + learned + before()
}

impl Plan {
    /// Computes these slots too, and what they are made of, whether anything reads them or not.
    pub fn observe(&mut self, slots: impl IntoIterator<Item = usize>) {
        lay_out(self, slots, Wanted::default());
    }

    /// The plan that also computes the weights, standard deviations and novelties that nothing reads, for whoever looks on. All else keeps
    /// its bits.
    #[must_use]
    pub fn looked_into(&self) -> Self {
        let beside = |node: &PlannedNode| [WEIGHTS, STD_DEV, NOVELTY].map(|port| node.port(port));
        let slots: Vec<_> = self
            .nodes
            .iter()
            .flat_map(beside)
            .flatten()
            .flatten()
            .collect();
        let mut plan = self.clone();
        plan.observe(slots);
        plan.warm_up = self.warm_up;
        plan
    }
}

/// Notes what is computed only where somebody reads it, beside what has been noted: all ports of features but the first, weights
/// and standard deviations.
fn mark_read(plan: &mut Plan, read: impl IntoIterator<Item = usize>, wanted: Wanted) {
    let mut is_read = vec![false; plan.channels.len()];
    read.into_iter().for_each(|slot| is_read[slot] = true);
    let mut is_truth = vec![false; plan.channels.len()];
    let truths = plan.nodes.iter().filter_map(|node| node.role.truth());
    truths.for_each(|truth| is_truth[truth.slot] = true);
    // Whoever is read comes before its readers, and a combination of deviations reads those of its voters.
    for node in plan.nodes.iter_mut().rev() {
        let is_truth = is_truth[node.slots.clone()].contains(&true);
        let any_read = |slots: &Range<usize>| is_read[slots.clone()].contains(&true);
        let first = |port: Option<Range<usize>>, wanted: bool| {
            let slots = port.filter(|slots| wanted || any_read(slots))?;
            Some(slots.start)
        };
        let weights = first(node.port(WEIGHTS), false);
        let std_dev = first(node.port(STD_DEV), wanted.intervals);
        let novelty = first(node.port(NOVELTY), false);
        match &mut node.role {
            PlannedRole::Feature { wanted: ports, .. } => {
                for (index, (name, slots)) in node.ports.iter().enumerate() {
                    let error_of_truth = wanted.standard_errors && is_truth && *name == "stderr";
                    ports[index] |= index == 0 || error_of_truth || any_read(slots);
                }
            }
            PlannedRole::Estimator {
                std_dev: deviation,
                novelty: outside,
                ..
            } => {
                *deviation = deviation.or(std_dev);
                *outside = outside.or(novelty);
            }
            PlannedRole::Combiner {
                std_devs,
                novelties,
                beside,
                ..
            } => {
                beside.weights = beside.weights.or(weights);
                beside.std_dev = beside.std_dev.or(std_dev.zip(*std_devs));
                beside.novelty = beside.novelty.or(novelty);
                let heeds = matches!(node.spec.role(), Role::Combiner(of) if of.heeds_novelty());
                let novelties = novelties.as_ref().map(|&(gather, _)| gather);
                beside.novelties = novelties.filter(|_| heeds || beside.novelty.is_some());
                let of_votes = beside.std_dev.map(|(_, of_votes)| of_votes);
                for gather in of_votes.into_iter().chain(beside.novelties) {
                    let entries = &plan.gathers[gather].entries;
                    entries.iter().for_each(|of| is_read[of.slot] = true);
                }
            }
        }
    }
}

/// Reports outputs that nothing flows into, and warns of nodes and signals that flow into no output.
pub(super) fn check_use(graph: &GraphFile, plan: &Plan, diagnostics: &mut Diagnostics) {
    if plan.outputs.is_empty() {
        diagnostics.report(graph.tree.place, problem::NoOutputs {});
        return;
    }
    let fed = Dependents::of(plan, &vec![true; plan.sources.len()], |_| false).slots;
    let owner = |name: &str| name.split('.').next().unwrap_or_default().to_owned();
    let mut dry = HashMap::new();
    for column in plan.outputs.iter().filter(|c| !fed[c.slot]) {
        dry.entry(owner(&column.name))
            .or_insert_with(|| column.name.clone());
    }
    for output in &graph.outputs {
        if let Some(column) = dry.remove(&output.name) {
            let problem = problem::Unreachable { output: column };
            diagnostics.report(output.place, problem);
        }
    }
    let used = plan.behind(plan.outputs.iter().map(|output| output.slot));
    let used_nodes: HashSet<&str> = plan
        .nodes
        .iter()
        .filter(|node| used[node.slots.clone()].contains(&true))
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
                problem::UnusedNode {
                    node: node.name.clone(),
                    inherited: node.place.source != graph.tree.place.source,
                },
            );
        }
    }
    let used_signals: HashSet<String> = (0..plan.sources.len())
        .filter(|&slot| used[slot])
        .map(|slot| owner(&plan.channels[slot].name))
        .collect();
    for signal in &graph.signals {
        if let Some(named) = column_unit::other_than(&signal.unit, &signal.column) {
            let problem = problem::ColumnUnit {
                signal: signal.name.clone(),
                column: signal.column.clone(),
                named,
                unit: signal.unit.clone(),
            };
            diagnostics.report(signal.unit_place, problem);
        }
        if !used_signals.contains(&signal.name) {
            diagnostics.report(
                signal.place,
                problem::UnusedSignal {
                    signal: signal.name.clone(),
                },
            );
        }
    }
}
