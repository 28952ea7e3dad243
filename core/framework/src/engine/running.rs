//! Decides what runs each node of a plan, given what was fitted.

use std::sync::Arc;

use super::estimate::{Estimate, fit_of};
use super::vote::Vote;
use super::{EngineError, Fitted};
use crate::compile::{Plan, PlannedNode, PlannedRole};
use crate::node::{Inputs, Operator, Role};

pub(super) enum Running {
    Operator {
        operator: Box<dyn Operator>,
        gathers: Vec<usize>,
        every_tick: bool,
        closes_loops: bool,
    },
    Estimate {
        estimate: Option<Estimate>,
        trigger: Option<usize>,
    },
    Vote(Vote),
}

impl Running {
    /// The slot of the truth that it is told after all outputs.
    pub(super) fn truth(&self) -> Option<usize> {
        match self {
            Self::Operator { .. } => None,
            Self::Estimate { estimate, .. } => {
                let learning = estimate.as_ref()?.learning.as_ref()?;
                (!learning.at_once()).then(|| learning.truth())
            }
            Self::Vote(vote) => vote.truth(),
        }
    }
}

/// The nodes of a plan, cold.
///
/// # Errors
/// When something fitted does not belong to the plan.
pub(super) fn running(plan: &Plan, fitted: &Fitted) -> Result<Vec<Running>, EngineError> {
    let widths: Vec<_> = plan
        .gathers
        .iter()
        .map(|gather| gather.entries.len())
        .collect();
    let mut nodes = Vec::with_capacity(plan.nodes.len());
    let mut used = 0;
    for node in &plan.nodes {
        nodes.push(match (&node.role, node.spec.role()) {
            (
                PlannedRole::Feature {
                    inputs,
                    gathers,
                    wanted,
                    every_tick,
                    closes_loops,
                    fit,
                },
                Role::Feature(spec),
            ) => {
                let given = fitted.get(&node.instance());
                let operator = match (fit, given) {
                    (Some(fit), Some(given)) => {
                        used += 1;
                        let fit = fit_of(node, &fit.regressors, given)?;
                        let inputs = Inputs {
                            fit: Some(fit),
                            ..inputs.clone()
                        };
                        spec.build(&inputs, wanted)
                    }
                    _ => spec.build(inputs, wanted),
                };
                Running::Operator {
                    operator,
                    gathers: gathers.clone(),
                    every_tick: *every_tick,
                    closes_loops: *closes_loops,
                }
            }
            (
                PlannedRole::Estimator {
                    gathers,
                    every_tick,
                    ..
                },
                Role::Estimator(_),
            ) => {
                let given = fitted.get(&node.instance());
                used += usize::from(given.is_some());
                let predictor = given.cloned().or_else(|| node.fixed().map(Arc::from));
                Running::Estimate {
                    estimate: predictor
                        .map(|p| Estimate::new(node, p, &widths))
                        .transpose()?,
                    trigger: if *every_tick {
                        None
                    } else {
                        gathers.first().copied()
                    },
                }
            }
            (PlannedRole::Combiner { voters, truth, .. }, Role::Combiner(spec)) => {
                Running::Vote(Vote::new(spec, widths[*voters], *truth))
            }
            _ => unreachable!("a plan gives each node the role of its specification"),
        });
    }
    if used < fitted.len() {
        let known = |name: &&String| {
            let is =
                |node: &PlannedNode| node.role.learns_from().is_some() && node.instance() == **name;
            !plan.nodes.iter().any(is)
        };
        let node = fitted.keys().find(known).cloned().unwrap_or_default();
        return Err(EngineError::NotAnEstimator { node });
    }
    Ok(nodes)
}
