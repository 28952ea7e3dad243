//! Decides which channels of a plan a test's reference names.

use std::sync::Arc;

use crate::compile::{CompileProblem, Plan, Reference, is_pattern, matches, outermost};
use crate::diagnostic::Names;

/// The slots of a reference, in the order of the plan. The names of outputs (`predicted.Z1`) are understood too.
pub(super) fn look_up(plan: &Plan, text: &str) -> Result<Vec<usize>, CompileProblem> {
    let reference = Reference::parse(text);
    let named = |(slot, channel): (usize, &'_ crate::compile::PlannedChannel)| {
        (Reference::parse(&channel.name).node == reference.node).then_some(slot)
    };
    let of_node: Vec<usize> = plan.channels.iter().enumerate().filter_map(named).collect();
    if of_node.is_empty() {
        return of_outputs(plan, &reference);
    }
    let default = default_port(plan, of_node[0]);
    let port = reference.port.filter(|&port| port != default);
    let of_port: Vec<usize> = of_node
        .iter()
        .copied()
        .filter(|&slot| Reference::parse(&plan.channels[slot].name).port == port)
        .collect();
    if of_port.is_empty() {
        return Err(CompileProblem::UnknownPort {
            node: reference.node.to_owned(),
            port: reference.port.unwrap_or_default().to_owned(),
            known: ports(plan, of_node[0]),
        });
    }
    let names = of_port
        .into_iter()
        .map(|slot| (slot, plan.channels[slot].name.as_str()));
    matching(&reference, names)
}

/// The measured channels of a reference, as positions among [`Plan::sources`].
pub(super) fn look_up_measured(
    plan: &Plan,
    text: &str,
) -> Result<Result<Vec<usize>, String>, CompileProblem> {
    let slots = look_up(plan, text)?;
    Ok(
        match slots.iter().find(|&&slot| slot >= plan.sources.len()) {
            Some(&computed) => Err(plan.channels[computed].name.clone()),
            None => Ok(slots),
        },
    )
}

fn of_outputs(plan: &Plan, reference: &Reference<'_>) -> Result<Vec<usize>, CompileProblem> {
    let outputs: Vec<(usize, &str)> = plan
        .outputs
        .iter()
        .filter(|output| Reference::parse(&output.name).node == reference.node)
        .map(|output| (output.slot, output.name.as_str()))
        .collect();
    if outputs.is_empty() || reference.port.is_some() {
        return Err(CompileProblem::UnknownNode {
            node: reference.node.to_owned(),
            known: names(plan),
        });
    }
    matching(reference, outputs.into_iter())
}

fn matching<'a>(
    reference: &Reference<'_>,
    named: impl Iterator<Item = (usize, &'a str)> + Clone,
) -> Result<Vec<usize>, CompileProblem> {
    let Some(pattern) = reference.channel else {
        return Ok(named.map(|(slot, _)| slot).collect());
    };
    let channel = |name: &'a str| Reference::parse(name).channel.unwrap_or_default();
    let fits = |name: &str| {
        if is_pattern(pattern) {
            matches(pattern, name)
        } else {
            pattern == name
        }
    };
    let slots: Vec<usize> = named
        .clone()
        .filter(|(_, name)| fits(channel(name)))
        .map(|(slot, _)| slot)
        .collect();
    if slots.is_empty() {
        return Err(CompileProblem::UnknownChannel {
            node: reference.node.to_owned(),
            channel: pattern.to_owned(),
            known: named.map(|(_, name)| channel(name).to_owned()).collect(),
        });
    }
    Ok(slots)
}

fn default_port(plan: &Plan, slot: usize) -> &'static str {
    ports(plan, slot).first().copied().unwrap_or_default()
}

fn ports(plan: &Plan, slot: usize) -> Vec<&'static str> {
    plan.channels[slot].node.map_or_else(Vec::new, |node| {
        plan.nodes[node]
            .ports
            .iter()
            .map(|(name, _)| *name)
            .collect()
    })
}

/// What a reference may begin with.
fn names(plan: &Plan) -> Arc<Names> {
    let channels = plan.channels.iter().map(|channel| channel.name.as_str());
    let outputs = plan.outputs.iter().map(|output| output.name.as_str());
    outermost(
        channels
            .chain(outputs)
            .map(|name| Reference::parse(name).node),
    )
}
