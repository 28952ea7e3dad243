//! Turns a graph file into a [`Plan`]: kinds read, an order found, references resolved, units, spans and horizons checked,
//! leaks found, steps laid out.
//!
//! The planner (`order`) only orders, one `gate` checks any order, and `steps` makes steps of it.

mod agreement;
mod column_unit;
mod combiner;
mod conversion;
mod diff;
mod estimator;
mod feature;
pub mod fed_back;
mod gate;
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
mod rare;
mod rates;
mod reference;
mod resolver;
mod row;
mod scope;
mod steps;
mod survey;

pub use diff::{
    Change, NodeChange, OutputChange, ParameterChange, PlanDiff, SignalChange, diff, meaning,
};
pub use gate::Misordered;
pub use keys::{EstimatorKeys, Outside};
pub use kind_fault::KindFault;
pub use plan::{
    AuxPorts, Conversion, Entry, Gather, Plan, Planned, PlannedChannel, PlannedFit,
    PlannedLearning, PlannedNode, PlannedOutput, PlannedRole, SourceChannel, Step, TrainingLimits,
    TruthLink,
};
pub use plan::{Rows, admits};
pub use port_channels::PortChannels;
pub use provenance::persistence_lag;
pub use rates::{Periods, RateError, Rates};
pub use reference::Reference;
pub use scope::outermost;

use std::collections::BTreeSet;

use crate::diagnostic::Diagnostics;
use crate::document::GraphFile;
use guard::Panics;
use resolver::Resolver;

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

    /// Whether something of a name may be missing, since a mistake in it, or in the module around it, has been reported.
    pub fn is_broken(&self, name: &str) -> bool {
        let outer = name.split('/').next().unwrap_or_default();
        self.broken.contains(name) || self.broken.contains(outer)
    }
}

/// Compiles a graph. All mistakes are reported; without one there is a plan.
///
/// # Panics
/// Where the code of a kind does, as a [`NodePanic`](crate::diagnostic::NodePanic): with [`compile_part`] that is a mistake too.
pub fn compile(graph: &GraphFile, wanted: Wanted, diagnostics: &mut Diagnostics) -> Option<Plan> {
    planned(graph, wanted, Panics::Propagate, diagnostics).ok()
}

/// As [`compile`], with what could be made of a graph that has mistakes. A kind whose code panics is one of them.
///
/// # Errors
/// There are mistakes, all of which are reported.
pub fn compile_part(
    graph: &GraphFile,
    wanted: Wanted,
    diagnostics: &mut Diagnostics,
) -> Result<Plan, Box<Part>> {
    planned(graph, wanted, Panics::Report, diagnostics)
}

fn planned(
    graph: &GraphFile,
    wanted: Wanted,
    panics: Panics,
    diagnostics: &mut Diagnostics,
) -> Result<Plan, Box<Part>> {
    // Kinds and their parameters, then an order in which each node follows what it reads.
    let nodes = instance::read_kinds(graph, panics, diagnostics);
    let order = order::order(graph, &nodes, diagnostics);
    let mut resolver = Resolver::new(graph, panics, diagnostics);
    // Names, then of each node in that order: references, shapes, units and spans.
    resolver.name_all(&order);
    let closing = resolver.resolve_nodes(&nodes, &order);
    // What loops bring back, and so what each value is made of; then who sees the future.
    resolver.close_loops(closing);
    resolver.spare_rare();
    resolver.name_sensors();
    resolver.find_leaks();
    let outputs = resolver.outputs();
    let (plan, broken) = resolver.finish(outputs, wanted);
    if !diagnostics.has_errors() {
        debug_assert_eq!(plan.check_order(), Ok(()));
        // Of a graph that is otherwise whole: outputs that are missing or never have a value, and what nobody uses.
        steps::check_use(graph, &plan, diagnostics);
        fed_back::check(graph, &plan, diagnostics);
    }
    if diagnostics.has_errors() {
        return Err(Box::new(Part { plan, broken }));
    }
    Ok(plan)
}
