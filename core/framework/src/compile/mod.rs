//! Decides what a graph file means: references resolved, units, spans and horizons checked, an order, slots, a [`Plan`];
//! not when it runs.

mod agreement;
mod column_unit;
mod combiner;
mod conversion;
mod diff;
mod estimator;
mod feature;
mod guard;
mod inputs;
mod instance;
mod keys;
mod kind_fault;
mod leak;
mod learning;
mod misplaced;
mod order;
pub mod origins;
mod plan;
mod port_channels;
pub mod problem;
mod provenance;
mod reference;
mod resolver;
mod row;
mod scope;
mod slot_set;
mod steps;
mod survey;

pub use diff::{
    Change, NodeChange, OutputChange, ParameterChange, PlanDiff, SignalChange, diff, meaning,
};
pub use keys::EstimatorKeys;
pub use kind_fault::KindFault;
pub use plan::{
    AuxPorts, Conversion, Entry, Gather, Plan, PlannedChannel, PlannedFit, PlannedLearning,
    PlannedNode, PlannedOutput, PlannedRole, SourceChannel, Step, TrainingLimits, TruthLink,
};
pub use plan::{Rows, admits};
pub use port_channels::PortChannels;
pub use provenance::persistence_lag;
pub use reference::Reference;
pub use scope::outermost;

use std::collections::BTreeSet;

use crate::diagnostic::Diagnostics;
use crate::document::GraphFile;
use guard::Panics;

/// What a plan must offer beyond what its graph itself reads.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Wanted {
    /// The standard errors of truths whose producers can give them (a port named `stderr`).
    pub standard_errors: bool,
    /// The standard deviations of predictions whose makers can give them, and the bounds of intervals.
    pub intervals: bool,
}

impl Wanted {
    /// All of it, as whoever scores a model wants.
    pub const SCORES: Self = Self {
        standard_errors: true,
        intervals: true,
    };
}

/// What could be made of a graph that has mistakes: enough to look at its tests, not to run it.
#[derive(Debug)]
pub struct Part {
    plan: Plan,
    /// Nodes, signals and outputs of which something is missing.
    broken: BTreeSet<String>,
}

impl Part {
    /// The nodes that could be resolved.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// Whether something of a name may be missing, since a mistake in it, or in the module around it, has been told.
    pub fn is_broken(&self, name: &str) -> bool {
        let outer = name.split('/').next().unwrap_or_default();
        self.broken.contains(name) || self.broken.contains(outer)
    }
}

/// Compiles a graph. All mistakes are told; without one there is a plan.
///
/// # Panics
/// Where the code of a kind does, after a line on standard error that names the node: with [`compile_part`] that is a mistake too.
pub fn compile(graph: &GraphFile, wanted: Wanted, diagnostics: &mut Diagnostics) -> Option<Plan> {
    made(graph, wanted, Panics::GoOn, diagnostics).ok()
}

/// As [`compile`], with what could be made of a graph that has mistakes. A kind whose code panics is one of them.
///
/// # Errors
///
/// There are mistakes, all of which are told.
pub fn compile_part(
    graph: &GraphFile,
    wanted: Wanted,
    diagnostics: &mut Diagnostics,
) -> Result<Plan, Box<Part>> {
    made(graph, wanted, Panics::AreTold, diagnostics)
}

fn made(
    graph: &GraphFile,
    wanted: Wanted,
    panics: Panics,
    diagnostics: &mut Diagnostics,
) -> Result<Plan, Box<Part>> {
    let nodes = instance::read_kinds(graph, panics, diagnostics);
    let order = order::order(graph, &nodes, diagnostics);
    let resolver = resolver::Resolver::new(graph, panics, diagnostics);
    let (plan, mut broken) = resolver.resolve(&nodes, &order, wanted);
    if !diagnostics.has_errors() {
        return Ok(plan);
    }
    broken.extend(graph.outputs.iter().map(|output| output.name.clone()));
    Err(Box::new(Part { plan, broken }))
}
