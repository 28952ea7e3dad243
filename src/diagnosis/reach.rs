//! Decides how far back what an estimator reads reaches: over so long its answers and its lags are looked at. What votes and
//! intervals remember of errors is not theirs, however long that is.

use athermal_core::compile::{Plan, PlannedNode, PlannedRole};
use athermal_core::node::Role;
use athermal_core::time::Duration;

/// The time after which the estimator that reaches back furthest knows all of the sensors that it would know had it always run.
pub(super) fn of_estimators(plan: &Plan) -> Duration {
    let mut of_slot = vec![Duration::ZERO; plan.channels.len()];
    let mut furthest = Duration::ZERO;
    for node in &plan.nodes {
        let reach = of_node(plan, &of_slot, node);
        of_slot[node.slots.clone()].fill(reach);
        if matches!(node.role, PlannedRole::Estimator { .. }) {
            furthest = furthest.max(reach);
        }
    }
    furthest
}

fn of_node(plan: &Plan, of_slot: &[Duration], node: &PlannedNode) -> Duration {
    let read = node.role.gathers();
    let entries = read.flat_map(|gather| &plan.gathers[gather].entries);
    let ages = entries.map(|entry| of_slot[entry.slot] + entry.lag + entry.max_age);
    let own = match node.spec.role() {
        Role::Feature(feature) => feature.memory(),
        Role::Combiner(combiner) => combiner.memory(),
        Role::Estimator(_) => Duration::ZERO,
    };
    own + ages.max().unwrap_or(Duration::ZERO)
}
