//! Decides what runs each node of a plan, given what was fitted.

use std::ops::Range;
use std::sync::Arc;

use super::at_hand::AtHand;
use super::estimate::{Estimate, fit_of};
use super::learning::Learning;
use super::vote::{Vote, Wires};
use super::{EngineError, Fitted};
use crate::compile::{AuxPorts, Plan, PlannedNode, PlannedRole};
use crate::node::{Inputs, Operator, Role};

/// What runs a node, with all that a tick needs of its plan.
pub(super) enum Running {
    Operator {
        operator: Box<dyn Operator>,
        gathers: Box<[usize]>,
        every_tick: bool,
        closes_loops: bool,
        slots: Range<usize>,
    },
    Estimate {
        estimate: Option<Estimate>,
        trigger: Option<usize>,
        slot: usize,
        /// The slot of the standard deviation, where somebody reads it.
        std_dev: Option<usize>,
    },
    Vote(Box<Vote>),
}

impl Running {
    /// How many regressors it reads as an estimator.
    pub(super) fn width(&self) -> usize {
        match self {
            Self::Estimate {
                estimate: Some(estimate),
                ..
            } => estimate.width(),
            _ => 0,
        }
    }

    /// What goes on learning, of an estimator that does.
    pub(super) fn learning(&mut self) -> Option<&mut Learning> {
        match self {
            Self::Estimate { estimate, .. } => estimate.as_mut()?.learning(),
            _ => None,
        }
    }

    /// Whether what it knows stays true whatever becomes of what it reads.
    pub fn outlives_changes(&self) -> bool {
        matches!(self, Self::Operator { operator, .. } if operator.outlives_changes())
    }

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
    let mut at_hand = AtHand::at_start(plan);
    for (nth, node) in plan.nodes.iter().enumerate() {
        at_hand.is(nth);
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
                    gathers: gathers.clone().into(),
                    every_tick: *every_tick,
                    closes_loops: *closes_loops,
                    slots: node.slots.clone(),
                }
            }
            (
                PlannedRole::Estimator {
                    gathers,
                    every_tick,
                    std_dev,
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
                        .transpose()
                        .map_err(|error| match error {
                            EngineError::DoesNotLearn { node: instance } if given.is_none() => {
                                EngineError::NoLearner {
                                    node: instance,
                                    author: node.kind.author(),
                                }
                            }
                            error => error,
                        })?,
                    trigger: if *every_tick {
                        None
                    } else {
                        gathers.first().copied()
                    },
                    slot: node.slots.start,
                    std_dev: *std_dev,
                }
            }
            (
                PlannedRole::Combiner {
                    voters,
                    state,
                    truth,
                    beside,
                    ..
                },
                Role::Combiner(spec),
            ) => {
                let wires = Wires {
                    voters: *voters,
                    state: *state,
                    slot: node.slots.start,
                    beside: (*beside != AuxPorts::default()).then(|| Box::new(*beside)),
                };
                let vote = Vote::new(spec, wires, widths[*voters], *truth);
                Running::Vote(Box::new(vote))
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
