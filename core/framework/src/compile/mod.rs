//! Decides what a graph file means: references resolved, units, spans and horizons checked, an order, slots, a [`Plan`];
//! not when it runs.

mod combiner;
mod conversion;
mod diff;
mod estimator;
mod feature;
mod inputs;
mod instance;
mod keys;
mod leak;
mod learning;
mod order;
mod plan;
mod problem;
mod provenance;
mod reference;
mod resolver;
mod scope;
mod slot_set;
mod steps;
mod survey;

pub use diff::{
    Change, NodeChange, OutputChange, ParameterChange, PlanDiff, SignalChange, diff, meaning,
};
pub(crate) use keys::EstimatorKeys;
pub(crate) use plan::Rows;
pub use plan::{
    Beside, Conversion, Entry, Gather, Plan, PlannedChannel, PlannedFit, PlannedLearning,
    PlannedNode, PlannedOutput, PlannedRole, SourceChannel, Step, TrainingLimits, TruthLink,
};
pub use problem::CompileProblem;
pub(crate) use provenance::persistence_lag;
pub use provenance::smallest_lag;
pub(crate) use reference::{Reference, is_pattern, matches};
pub(crate) use scope::outermost;

use crate::diagnostic::Diagnostics;
use crate::document::GraphFile;

/// What a plan must offer beyond what its graph itself reads.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Wanted {
    /// The standard errors of truths whose producers can give them (a port named `stderr`).
    pub standard_errors: bool,
    /// The standard deviations of predictions whose makers can give them, and the bounds of intervals.
    pub intervals: bool,
}

/// Compiles a graph. All mistakes are told; without one there is a plan.
pub fn compile(graph: &GraphFile, wanted: Wanted, diagnostics: &mut Diagnostics) -> Option<Plan> {
    let nodes = instance::read_kinds(graph, diagnostics);
    let order = order::order(graph, &nodes, diagnostics);
    let resolved = resolver::Resolver::new(graph, diagnostics).resolve(&nodes, &order, wanted);
    (!diagnostics.has_errors()).then_some(resolved)
}
