//! Decides what a compiled graph is: slots, gathers, nodes and the order of steps; not when it runs.

use std::ops::Range;
use std::sync::Arc;

use crate::channel::Channel;
use crate::document::TimeBase;
use crate::node::{Inputs, Kind, NodeSpec, Read, Regressor};
use crate::quantity::Quantity;
use crate::time::Duration;

/// A graph, resolved: what the engine steps.
#[derive(Debug, Clone)]
pub struct Plan {
    /// The graph's name.
    pub name: Option<String>,
    /// How tabular sources give time.
    pub time: TimeBase,
    /// The measured channels; the first slots, in this order.
    pub sources: Vec<SourceChannel>,
    /// Every slot, by number.
    pub channels: Vec<PlannedChannel>,
    /// The bundles of slots that nodes read.
    pub gathers: Vec<Gather>,
    /// Every instance of every node, in the order of the file.
    pub nodes: Vec<PlannedNode>,
    /// What is done at a tick, in order.
    pub steps: Vec<Step>,
    /// What comes out.
    pub outputs: Vec<PlannedOutput>,
    /// The time after which the graph, started cold, knows all that it would know had it always run.
    pub warm_up: Duration,
}

/// A measured channel and how tabular sources name it.
#[derive(Debug, Clone, PartialEq)]
pub struct SourceChannel {
    /// Signal and channel: `temperature.plate1`.
    pub name: String,
    /// The column of a table.
    pub column: String,
    /// Whether data may lack it.
    pub optional: bool,
    /// The lowest and highest value that count, in the signal's unit.
    pub range: (f64, f64),
}

/// A slot.
#[derive(Debug, Clone)]
pub struct PlannedChannel {
    /// The reference that names it: `gradients.plate1@150s`.
    pub name: String,
    /// What it carries.
    pub channel: Channel,
    /// The node that writes it; none for a measured channel.
    pub node: Option<usize>,
    /// How far back it is read, where it is read with a lag.
    pub history: Option<Duration>,
    /// The slot of the truth that it predicts, where it is a prediction.
    pub predicts: Option<usize>,
}

/// A bundle of slots read together.
#[derive(Debug, Clone, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Gather {
    /// Whether only new values count.
    pub read: Read,
    /// What is read, in order.
    pub entries: Vec<Entry>,
    /// The values that are given in another unit than their slots have.
    pub conversions: Vec<Conversion>,
}

/// A value of a gather that is given in another unit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Conversion {
    /// The position among the entries.
    pub entry: usize,
    /// The bits of the factor, so that gathers can be compared.
    bits: u64,
}

impl Conversion {
    /// A multiplication of an entry's value.
    #[must_use]
    pub const fn new(entry: usize, factor: f64) -> Self {
        Self {
            entry,
            bits: factor.to_bits(),
        }
    }

    /// What the value is multiplied by.
    #[must_use]
    pub const fn factor(self) -> f64 {
        f64::from_bits(self.bits)
    }
}

/// One value of a gather.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Entry {
    /// The slot.
    pub slot: usize,
    /// How far back, counted from the tick.
    pub lag: Duration,
    /// The age past which a value is absent, counted from the instant asked for.
    pub max_age: Duration,
}

/// One instance of a node.
#[derive(Debug, Clone)]
pub struct PlannedNode {
    /// The node's name in the file.
    pub name: String,
    /// The member of its sets, where it has `each`.
    pub member: Option<String>,
    /// Its kind.
    pub kind: &'static Kind,
    /// Its parameters.
    pub spec: Arc<dyn NodeSpec>,
    /// What it does.
    pub role: PlannedRole,
    /// The slots of its outputs: all ports, one after the other.
    pub slots: Range<usize>,
    /// Its output ports, as ranges of slots.
    pub ports: Vec<(&'static str, Range<usize>)>,
}

impl PlannedNode {
    /// The name of this instance: `thermal.Z1`.
    #[must_use]
    pub fn instance(&self) -> String {
        match &self.member {
            Some(member) => format!("{}.{member}", self.name),
            None => self.name.clone(),
        }
    }
}

/// What an instance does at a tick.
#[derive(Debug, Clone)]
pub enum PlannedRole {
    /// Channels from channels.
    Feature {
        /// The channels that reach it, for building it.
        inputs: Inputs,
        /// The gather of each input port.
        gathers: Vec<usize>,
        /// Which output ports somebody reads.
        wanted: Vec<bool>,
        /// Whether it runs at every tick.
        every_tick: bool,
        /// Whether its inputs are taken after all outputs are there.
        closes_loops: bool,
    },
    /// A prediction of a truth.
    Estimator {
        /// What makes up a row, over all gathers.
        regressors: Vec<Regressor>,
        /// The gathers of a row, one after the other.
        gathers: Vec<usize>,
        /// Whether it runs at every tick, or only when something in its first gather is fresh.
        every_tick: bool,
        /// What it predicts.
        truth: TruthLink,
        /// Which rows it is fitted on.
        training: TrainingLimits,
    },
    /// One prediction of several.
    Combiner {
        /// The gather of the votes.
        voters: usize,
        /// What is predicted, where it learns from errors.
        truth: Option<TruthLink>,
        /// Whether somebody reads its weights.
        weights: bool,
    },
}

impl PlannedRole {
    /// The gathers that it reads.
    pub(crate) fn gathers(&self) -> &[usize] {
        match self {
            Self::Feature { gathers, .. } | Self::Estimator { gathers, .. } => gathers,
            Self::Combiner { voters, .. } => std::slice::from_ref(voters),
        }
    }

    /// The slot of the truth that it predicts or learns from.
    pub(crate) fn truth(&self) -> Option<usize> {
        match self {
            Self::Feature { .. } => None,
            Self::Estimator { truth, .. } => Some(truth.slot),
            Self::Combiner { truth, .. } => truth.map(|truth| truth.slot),
        }
    }
}

impl Plan {
    /// The slots that a node reads, with its truth.
    pub(crate) fn reads<'a>(&'a self, node: &'a PlannedNode) -> impl Iterator<Item = usize> + 'a {
        let gathers = node.role.gathers().iter();
        let entries = gathers.flat_map(|&gather| &self.gathers[gather].entries);
        entries.map(|entry| entry.slot).chain(node.role.truth())
    }
}

/// A truth and how predictions are paired with it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TruthLink {
    /// The slot of the truth.
    pub slot: usize,
    /// The horizon of the predictions.
    pub ahead: Duration,
    /// The span of the truth.
    pub span: Duration,
    /// How long before `τ − ahead` the run may lie that a truth at `τ` is paired with.
    pub limit: Duration,
}

impl TruthLink {
    /// How much earlier than a prediction the newest truth may have arrived that it knows of: `max(0, span − ahead)`.
    #[must_use]
    pub fn embargo(&self) -> Duration {
        (self.span - self.ahead).max(Duration::ZERO)
    }
}

/// Which rows an estimator is fitted on, by the absolute value of the truth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrainingLimits {
    /// Rows at or above are left out, in the unit of the truth.
    pub below: f64,
    /// Rows below are left out, in the unit of the truth.
    pub above: f64,
}

impl TrainingLimits {
    /// No limits.
    pub const NONE: Self = Self {
        below: f64::INFINITY,
        above: 0.0,
    };

    /// Whether a row of this truth takes part.
    #[must_use]
    pub fn admits(&self, truth: f64) -> bool {
        let size = truth.abs();
        size < self.below && size >= self.above
    }
}

/// Something done at a tick.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Step {
    /// Read a bundle of slots.
    Gather(usize),
    /// Run a node.
    Run(usize),
    /// Hand a node its inputs for later ticks.
    Capture(usize),
}

/// A column of what comes out.
#[derive(Debug, Clone)]
pub struct PlannedOutput {
    /// Its name: `predicted.Z1`.
    pub name: String,
    /// The slot it shows.
    pub slot: usize,
    /// At which rate it passes from an old graph's value to a new one's.
    pub blend: Option<Quantity>,
}
