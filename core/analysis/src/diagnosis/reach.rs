//! Over how long responses and lags of estimators are looked at: as far back as what they read reaches.

use athermal_core::compile::{Plan, PlannedRole};
use athermal_core::time::Duration;

/// The time after which the estimator that reaches back furthest knows all that it would know had it always run.
pub(super) fn of_estimators(plan: &Plan) -> Duration {
    let nodes = plan.nodes.iter().zip(plan.warm_ups());
    let estimators = nodes.filter(|(node, _)| matches!(node.role, PlannedRole::Estimator { .. }));
    let furthest = estimators.map(|(_, warm_up)| warm_up).max();
    furthest.unwrap_or_default()
}
