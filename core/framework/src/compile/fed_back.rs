//! Whether a correction depends on positions that it moves itself.
//!
//! The rate that is integrated may depend on past truths: by lags, by a vote, or by learning. Where these truths are positions, a
//! machine under correction shows a drift that is not there. An `uncorrected` node puts back what the correction took away.

use super::origins::{of_truths, slots, upstream};
use super::{Plan, PlannedNode, PlannedRole, problem};
use crate::diagnostic::Diagnostics;
use crate::document::GraphFile;
use crate::node::Duty;

/// The measured channels that a correction made of these slots moves and goes by.
#[must_use]
pub fn moved(plan: &Plan, of: impl IntoIterator<Item = usize>) -> Vec<usize> {
    let seen = upstream(plan, of, |node| goes_by(plan, node));
    let of_truths = of_truths(plan).into_iter().enumerate();
    of_truths
        .filter_map(|(slot, of_truth)| (of_truth && seen[slot]).then_some(slot))
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

/// Reports corrections that go by what they move.
pub(super) fn check(graph: &GraphFile, plan: &Plan, diagnostics: &mut Diagnostics) {
    for node in &graph.nodes {
        let planned = plan.nodes.iter().filter(|of| of.name == node.name);
        let mut corrections = planned.filter(|of| of.kind.duty() == Duty::Correct);
        let moved = corrections.find_map(|of| {
            let moved = moved(plan, slots(plan, of.role.gathers()));
            let (first, more) = moved.split_first()?;
            Some((plan.channels[*first].name.clone(), more.len()))
        });
        if let Some((channel, more)) = moved {
            let rate = node.instances.iter().flat_map(|of| &of.inputs).next();
            let place = rate.map_or(node.place, |of| of.place);
            diagnostics.report(place, problem::FedBack { channel, more });
        }
    }
}

/// What to do where a correction goes by what it moves.
pub const WAY_OUT: &str = "put an `uncorrected` node between the position and its drift, with what the machine reports as applied; without \
    `inputs.applied` it says that no correction moves what is measured";
