//! Whether a correction depends on positions that it moves itself.
//!
//! The rate that is integrated may depend on past truths: by lags, by a vote, or by learning. Where these truths are positions, a
//! machine under correction shows a drift that is not there. An `uncorrected` node puts back what the correction took away.

use crate::compile::origins::{of_truths, slots, upstream};
use crate::compile::{Plan, PlannedNode, PlannedRole};
use crate::node::Duty;

/// The measured channels that a correction moves and goes by.
#[must_use]
pub fn corrected_channels(plan: &Plan) -> Vec<String> {
    let corrections = plan
        .nodes
        .iter()
        .filter(|of| of.kind.duty() == Duty::Correct);
    let rates = corrections.flat_map(|node| slots(plan, node.role.gathers()));
    let seen = upstream(plan, rates, |node| goes_by(plan, node));
    let of_truths = of_truths(plan);
    let moved = plan.sources.iter().enumerate();
    moved
        .filter(|(slot, _)| of_truths[*slot] && seen[*slot])
        .map(|(_, source)| source.name.clone())
        .collect()
}

/// The slots that a node goes by at a tick, past truths among them; none of those before one that puts back what was taken away.
fn goes_by(plan: &Plan, node: &PlannedNode) -> Vec<usize> {
    if node.kind.duty() == Duty::PutBack {
        return Vec::new();
    }
    // A model that is only fitted on truths does not go by those of now.
    let truth = match &node.role {
        PlannedRole::Feature { .. } => None,
        PlannedRole::Estimator { fit, learning, .. } => learning.as_ref().map(|_| &fit.truth),
        PlannedRole::Combiner { truth, .. } => truth.as_ref(),
    };
    let mut read = slots(plan, node.role.gathers());
    read.extend(truth.map(|truth| truth.slot));
    read
}

/// The warning about a graph whose correction goes by what it moves; none for others.
#[must_use]
pub fn in_words(plan: &Plan) -> Option<String> {
    words(&corrected_channels(plan))
}

/// The same, of channels that are known.
#[must_use]
pub fn words<S: AsRef<str>>(channels: &[S]) -> Option<String> {
    let (first, more) = channels.split_first()?;
    let more = match more.len() {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    Some(format!(
        "the correction goes by past drifts of {}{more}, which on a machine that is being corrected lack what it took away: put an \
         `uncorrected` node between, as `athermal nodes uncorrected` tells, or it takes away less than it could",
        first.as_ref()
    ))
}
