//! Decides whether a correction is told by positions that it moves itself; not what it is worth.
//!
//! Where the rate that is integrated goes by past truths, by lags, a vote or learning, and these are made of measured positions, a
//! machine under the correction shows a drift that is not there: what the correction took away. An `uncorrected` node puts it back.

use std::collections::BTreeSet;

use athermal_core::compile::{Plan, PlannedRole};

/// The measured channels that a correction moves and goes by.
#[must_use]
pub fn corrected_channels(plan: &Plan) -> Vec<&str> {
    let (mut seen, mut waiting) = (BTreeSet::new(), Vec::new());
    let corrections = plan.nodes.iter().filter(|of| of.kind.name == "compensate");
    for node in corrections {
        let inputs = node.role.gathers();
        waiting.extend(inputs.flat_map(|of| plan.gathers[of].entries.iter().map(|of| of.slot)));
    }
    while let Some(slot) = waiting.pop() {
        if !seen.insert(slot) {
            continue;
        }
        let Some(node) = plan.channels[slot].node.map(|node| &plan.nodes[node]) else {
            continue;
        };
        if node.kind.name == "uncorrected" {
            continue;
        }
        let inputs = node.role.gathers();
        waiting.extend(inputs.flat_map(|of| plan.gathers[of].entries.iter().map(|of| of.slot)));
        // A model that is only fitted on truths does not go by those of now.
        let goes_by = match &node.role {
            PlannedRole::Feature { .. } => None,
            PlannedRole::Estimator {
                truth, learning, ..
            } => learning.as_ref().map(|_| truth),
            PlannedRole::Combiner { truth, .. } => truth.as_ref(),
        };
        waiting.extend(goes_by.map(|truth| truth.slot));
    }
    let of_truths = super::of_truths(plan);
    let moved = plan.sources.iter().enumerate();
    moved
        .filter(|(slot, _)| of_truths[*slot] && seen.contains(slot))
        .map(|(_, source)| source.name.as_str())
        .collect()
}

/// What is told of a graph whose correction goes by what it moves; nothing of others.
#[must_use]
pub fn in_words(plan: &Plan) -> Option<String> {
    let channels = corrected_channels(plan);
    let (first, more) = channels.split_first()?;
    let more = match more.len() {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    Some(format!(
        "the correction goes by past drifts of {first}{more}, which on a machine that is being corrected lack what it took away: put an \
         `uncorrected` node between, as `athermal nodes uncorrected` tells, or it takes away less than it could"
    ))
}
