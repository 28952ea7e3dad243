//! What runs each node of a plan, made of the plan and the fits.

use std::collections::HashSet;
use std::ops::Range;
use std::sync::Arc;

use super::estimate::{Estimate, fit_of};
use super::vote::{Vote, Wires};
use crate::compile::{AuxPorts, Plan, PlannedNode, PlannedRole};
use crate::engine::at_work::{When, naming};
use crate::engine::leap::Leaps;
use crate::engine::learning::GatedLearner;
use crate::engine::{EngineError, Fitted};
use crate::node::{Inputs, Operator, Predictor, Role};

/// What runs a node, with all that a tick needs of its plan.
pub(crate) enum NodeRunner {
    Operator(OperatorRunner),
    Estimate(EstimateRunner),
    Vote(Box<Vote>),
}

/// What runs a feature.
pub(crate) struct OperatorRunner {
    pub(crate) operator: Box<dyn Operator>,
    pub(crate) gathers: Box<[usize]>,
    pub(crate) every_tick: bool,
    pub(crate) closes_loops: bool,
    pub(crate) slots: Range<usize>,
    /// The truths among these whose windows may hold a leap, by their places.
    pub(crate) truths: Range<usize>,
}

/// What runs an estimator.
pub(crate) struct EstimateRunner {
    pub(crate) estimate: Option<Estimate>,
    /// The gather that lets it run, unless it does at every tick.
    pub(crate) trigger: Option<usize>,
    pub(crate) slot: usize,
    /// The slot of the standard deviation, where somebody reads it.
    pub(crate) std_dev: Option<usize>,
    /// The slot of the novelty of its regressors, where somebody reads it.
    pub(crate) novelty: Option<usize>,
}

impl NodeRunner {
    /// A fitted estimator.
    pub(crate) fn estimate(&self) -> Option<&Estimate> {
        match self {
            Self::Estimate(node) => node.estimate.as_ref(),
            Self::Operator(_) | Self::Vote(_) => None,
        }
    }

    /// The same, to be changed.
    pub(crate) fn estimate_mut(&mut self) -> Option<&mut Estimate> {
        match self {
            Self::Estimate(node) => node.estimate.as_mut(),
            Self::Operator(_) | Self::Vote(_) => None,
        }
    }

    /// What goes on learning, of an estimator that does.
    pub(crate) fn learning(&mut self) -> Option<&mut GatedLearner> {
        self.estimate_mut()?.learning()
    }

    /// Whether what it knows stays true whatever becomes of what it reads.
    pub(crate) fn outlives_changes(&self) -> bool {
        matches!(self, Self::Operator(node) if node.operator.outlives_changes())
    }

    /// The slot of the truth that it is given after all outputs.
    pub(crate) fn truth(&self) -> Option<usize> {
        if let Self::Vote(vote) = self {
            return vote.truth();
        }
        let learning = self.estimate()?.learning.as_ref()?;
        (!learning.at_once()).then(|| learning.truth())
    }
}

/// The nodes of a plan, cold.
///
/// # Errors
/// When something fitted does not belong to the plan.
pub(crate) fn runners(
    plan: &Plan,
    fitted: &Fitted,
    leaps: &Leaps,
) -> Result<Box<[NodeRunner]>, EngineError> {
    let learning = plan.nodes.iter().filter(|of| of.role.fit().is_some());
    let learning: HashSet<String> = learning.map(PlannedNode::instance).collect();
    if let Some(node) = fitted.keys().find(|name| !learning.contains(*name)) {
        return Err(EngineError::NotAnEstimator { node: node.clone() });
    }
    let gathers = plan.gathers.iter();
    let widths: Vec<_> = gathers.map(|gather| gather.entries.len()).collect();
    naming(plan, When::Start, |at_work| {
        let nodes = plan.nodes.iter().enumerate();
        nodes
            .map(|(nth, node)| {
                at_work.is(nth);
                runner(node, fitted.get(&node.instance()), &widths, leaps)
            })
            .collect()
    })
}

/// A node with what it was fitted to, where it was; `widths` are those of the gathers.
fn runner(
    node: &PlannedNode,
    fit: Option<&Arc<dyn Predictor>>,
    widths: &[usize],
    leaps: &Leaps,
) -> Result<NodeRunner, EngineError> {
    Ok(match (&node.role, node.spec.role()) {
        (
            PlannedRole::Feature {
                inputs,
                gathers,
                wanted,
                every_tick,
                closes_loops,
                fit: planned,
            },
            Role::Feature(spec),
        ) => {
            let operator = match planned.as_ref().zip(fit) {
                Some((planned, fit)) => {
                    let inputs = Inputs {
                        fit: Some(fit_of(node, &planned.regressors, fit)?),
                        ..inputs.clone()
                    };
                    spec.build(&inputs, wanted)
                }
                None => spec.build(inputs, wanted),
            };
            NodeRunner::Operator(OperatorRunner {
                operator,
                gathers: gathers.clone().into(),
                every_tick: *every_tick,
                closes_loops: *closes_loops,
                truths: leaps.among(&node.slots),
                slots: node.slots.clone(),
            })
        }
        (
            PlannedRole::Estimator {
                gathers,
                every_tick,
                std_dev,
                novelty,
                ..
            },
            Role::Estimator(_),
        ) => {
            let predictor = fit.cloned().or_else(|| node.fixed().map(Arc::from));
            let estimate = predictor.map(|predictor| Estimate::new(node, predictor, widths));
            NodeRunner::Estimate(EstimateRunner {
                estimate: estimate.transpose().map_err(|error| match error {
                    EngineError::DoesNotLearn { node: instance } if fit.is_none() => {
                        EngineError::NoLearner {
                            node: instance,
                            author: node.kind.author(),
                        }
                    }
                    error => error,
                })?,
                trigger: gathers.first().copied().filter(|_| !every_tick),
                slot: node.slots.start,
                std_dev: *std_dev,
                novelty: *novelty,
            })
        }
        (
            PlannedRole::Combiner {
                voters,
                novelties,
                state,
                truth,
                beside,
                ..
            },
            Role::Combiner(spec),
        ) => {
            let wires = Wires {
                voters: *voters,
                novelties: beside
                    .novelties
                    .and(novelties.as_ref())
                    .map(|(gather, which)| (*gather, which[..].into())),
                state: *state,
                slot: node.slots.start,
                beside: (*beside != AuxPorts::default()).then(|| Box::new(*beside)),
            };
            let vote = Vote::new(spec, wires, widths[*voters], *truth);
            NodeRunner::Vote(Box::new(vote))
        }
        _ => unreachable!("a plan gives each node the role of its specification"),
    })
}
