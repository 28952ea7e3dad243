//! Outputs whose voters have no regressor left, and so predict a constant.

use std::collections::BTreeSet;

use super::doubt::FROM_PAST_ALONE;
use super::{EstimatorFit, FitReport, Outcome};
use crate::compile::{Plan, PlannedRole};
use crate::node::Duty;

/// An output of which voters have no regressor left.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BareOutput {
    /// Its name: `predicted.Z1`.
    pub output: String,
    /// The voters without a regressor, or without a fit.
    pub bare: Vec<String>,
    /// Whether it has other voters.
    pub has_others: bool,
}

impl EstimatorFit {
    /// Whether it was fitted and predicts a constant, since no regressor is left.
    #[must_use]
    pub fn is_bare(&self) -> bool {
        match &self.outcome {
            Outcome::Fitted(report) => {
                report.figures.contains_key("regressors_left")
                    && report.notes.iter().all(|note| note != FROM_PAST_ALONE)
            }
            Outcome::Failed(_) => false,
        }
    }
}

impl FitReport {
    /// The outputs of which a voter has no regressor left, in the order of the plan.
    #[must_use]
    pub fn bare_outputs(&self, plan: &Plan) -> Vec<BareOutput> {
        let of = |name: &str| self.estimators.iter().find(|fit| fit.node == name);
        let outputs = plan.outputs.iter().filter_map(|output| {
            let mut nodes = BTreeSet::new();
            voters(plan, output.slot, &mut nodes);
            let names: Vec<String> = nodes
                .into_iter()
                .map(|node| plan.nodes[node].instance())
                .collect();
            let fits: Vec<_> = names.iter().map(|name| of(name)).collect();
            if !fits.iter().flatten().any(|fit| fit.is_bare()) {
                return None;
            }
            let failed = |fit: &EstimatorFit| matches!(fit.outcome, Outcome::Failed(_));
            let has = |fit: &Option<&EstimatorFit>| fit.is_none_or(|f| !f.is_bare() && !failed(f));
            let without = names.iter().zip(&fits).filter(|(_, fit)| !has(fit));
            Some(BareOutput {
                output: output.name.clone(),
                bare: without.map(|(name, _)| name.clone()).collect(),
                has_others: fits.iter().any(has),
            })
        });
        outputs.collect()
    }
}

/// Fits of which so many rows lack a regressor leave much to a fallback.
const OFTEN: f64 = 0.1;

impl FitReport {
    /// For each `fallback` whose first voter had its regressors in too few rows of the fit: its channel, the voter, and the share of rows
    /// without.
    #[must_use]
    pub fn fallbacks(&self, plan: &Plan) -> Vec<(String, String, f64)> {
        let lacking = |fit: &EstimatorFit| {
            let all = fit.rows + fit.dropped.incomplete;
            (all > 0).then(|| fit.dropped.incomplete as f64 / all as f64)
        };
        let nodes = plan
            .nodes
            .iter()
            .filter(|node| node.kind.duty() == Duty::Fallback);
        let found = nodes.filter_map(|node| {
            let gather = node.role.inputs().next()?;
            let first = plan.gathers[gather].entries.first()?.slot;
            let mut behind = BTreeSet::new();
            voters(plan, first, &mut behind);
            let names = behind.into_iter().map(|nth| plan.nodes[nth].instance());
            let fits = names.filter_map(|name| self.estimators.iter().find(|fit| fit.node == name));
            let least = fits.filter_map(lacking).reduce(f64::min)?;
            let name = |slot: usize| plan.channels[slot].name.clone();
            (least > OFTEN).then(|| (name(node.slots.start), name(first), least))
        });
        found.collect()
    }
}

/// The estimators behind a slot, through combiners and features; of one that is fed by predictions, those that make them.
fn voters(plan: &Plan, slot: usize, found: &mut BTreeSet<usize>) {
    let Some(nth) = plan.channels[slot].node else {
        return;
    };
    let node = &plan.nodes[nth];
    let entries = node.role.inputs().flat_map(|of| &plan.gathers[of].entries);
    let is_estimator = matches!(node.role, PlannedRole::Estimator { .. });
    let mut of_predictions = false;
    for entry in entries {
        if !is_estimator || plan.channels[entry.slot].predicts.is_some() {
            of_predictions = true;
            voters(plan, entry.slot, found);
        }
    }
    if is_estimator && !of_predictions {
        found.insert(nth);
    }
}
