//! What a compiled graph is: slots, gathers, nodes and the order of steps.

use std::ops::Range;
use std::sync::Arc;

use super::instance::instance_name;
use super::keys::Outside;
use super::origins::upstream;
use super::persistence_lag;
use super::provenance::smallest_lag;
use crate::channel::Channel;
use crate::document::{TableBase, TimeBase};
use crate::node::{Inputs, Kind, LearningLimits, NodeSpec, Predictor, Read, Regressor, Role};
use crate::quantity::Quantity;
use crate::time::Duration;

/// A graph, resolved: what the engine steps.
#[derive(Debug, Clone)]
pub struct Plan {
    /// The graph's name.
    pub name: Option<String>,
    /// How tabular sources give time.
    pub time: TimeBase,
    /// How tabular sources lay out their text.
    pub table: TableBase,
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
    /// Of what is planned: how far ahead it is known, and from when on a value applies.
    pub planned: Option<Planned>,
    /// Whether its values are the instants at which those of a planned channel begin to apply: in seconds, as the time of a row.
    pub is_instant: bool,
}

/// What is known of a planned channel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Planned {
    /// How long before it applies a value is known.
    pub known_ahead: Duration,
    /// The source, by number, that says from when on a value applies; a value without it applies at once.
    pub applies_at: usize,
}

impl SourceChannel {
    /// Whether a sample, in the signal's unit, counts: it is finite and within the range. NaN, which is no sample, does not.
    #[must_use]
    pub fn admits(&self, sample: f64) -> bool {
        admits(self.range, sample)
    }

    /// Whether it may well have no new value, or the same, for long: data may lack it, or it is planned.
    #[must_use]
    pub fn rests(&self) -> bool {
        self.optional || self.planned.is_some() || self.is_instant
    }
}

/// Whether a sample is finite and within a range.
#[inline]
pub fn admits((lowest, highest): (f64, f64), sample: f64) -> bool {
    sample.is_finite() && sample >= lowest && sample <= highest
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
    /// The values, by position, of signals that are measured so rarely that nobody would take what is made of them: until this age they
    /// do not age it.
    pub rare: Vec<(usize, Duration)>,
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
    /// How far back its inputs reach that its outputs depend on, or what it learned counts, as its kind says.
    pub memory: Duration,
    /// Whether its values depend on all of the past.
    pub endless: bool,
    /// The slots of its outputs: all ports, one after the other.
    pub slots: Range<usize>,
    /// Its output ports, as ranges of slots.
    pub ports: Vec<(&'static str, Range<usize>)>,
}

impl PlannedNode {
    /// The name of this instance: `thermal.Z1`.
    #[must_use]
    pub fn instance(&self) -> String {
        instance_name(&self.name, self.member.as_deref())
    }

    /// The slots of an output port; none where it has no port of that name.
    #[must_use]
    pub fn port(&self, name: &str) -> Option<Range<usize>> {
        let mut ports = self.ports.iter();
        let (_, slots) = ports.find(|(port, _)| *port == name)?;
        Some(slots.clone())
    }

    /// The slot in which an estimator that goes on learning says what became of truths, and who speaks.
    #[must_use]
    pub fn says_of_learning(&self) -> Option<usize> {
        let PlannedRole::Estimator { learning, .. } = &self.role else {
            return None;
        };
        learning
            .as_ref()
            .and(self.port("learning"))
            .map(|of| of.start)
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
        /// What it is fitted on, where it is fitted.
        fit: Option<PlannedFit>,
    },
    /// A prediction of a truth.
    Estimator {
        /// What it is fitted on; its truth is what it predicts.
        fit: PlannedFit,
        /// The gathers of a row, one after the other.
        gathers: Vec<usize>,
        /// Whether it runs at every tick, or only when something in its first gather is fresh.
        every_tick: bool,
        /// How it goes on learning while it runs, where it does.
        learning: Option<PlannedLearning>,
        /// The slot of its standard deviation, where somebody reads it.
        std_dev: Option<usize>,
        /// The slot of the novelty of its regressors, where somebody reads it.
        novelty: Option<usize>,
        /// What becomes of its predictions where that is above 1.
        outside: Outside,
    },
    /// One prediction of several.
    Combiner {
        /// The gather of the votes.
        voters: usize,
        /// The gather of their standard deviations, where all have one: read only for one of the combination.
        std_devs: Option<usize>,
        /// The gather of the novelties of those votes that have one, and which these are.
        novelties: Option<(usize, Vec<usize>)>,
        /// The gather of the state that it goes by, where it goes by one.
        state: Option<usize>,
        /// What is predicted, where it learns from errors.
        truth: Option<TruthLink>,
        /// What it gives beside its prediction.
        beside: AuxPorts,
    },
}

impl PlannedRole {
    /// What the input ports read as data: their gathers, in order.
    pub fn inputs(&self) -> impl Iterator<Item = usize> + '_ {
        let (many, voters, state) = match self {
            Self::Feature { gathers, .. } | Self::Estimator { gathers, .. } => {
                (&gathers[..], None, None)
            }
            Self::Combiner { voters, state, .. } => (&[][..], Some(*voters), *state),
        };
        many.iter().copied().chain(voters).chain(state)
    }

    /// All that is read at a tick: the gathers of the input ports, then what else there is.
    pub fn gathers(&self) -> impl Iterator<Item = usize> + '_ {
        let more = match self {
            Self::Feature { .. } => None,
            Self::Estimator { learning, .. } => learning.as_ref().and_then(|l| l.freeze),
            Self::Combiner { beside, .. } => beside.std_dev.map(|(_, of_voters)| of_voters),
        };
        let novelties = match self {
            Self::Combiner { beside, .. } => beside.novelties,
            Self::Feature { .. } | Self::Estimator { .. } => None,
        };
        self.inputs().chain(more).chain(novelties)
    }

    /// What it is fitted on, where it is fitted, or would be if it were not known what it predicts by.
    #[must_use]
    pub fn fit(&self) -> Option<&PlannedFit> {
        match self {
            Self::Feature { fit, .. } => fit.as_ref(),
            Self::Estimator { fit, .. } => Some(fit),
            Self::Combiner { .. } => None,
        }
    }

    /// What is predicted, or compared with predictions.
    #[must_use]
    pub fn truth(&self) -> Option<&TruthLink> {
        match self {
            Self::Combiner { truth, .. } => truth.as_ref(),
            role => role.fit().map(|fit| &fit.truth),
        }
    }

    /// The slots of both ends of its intervals, where it gives them.
    #[must_use]
    pub fn bounds(&self) -> Option<(usize, usize)> {
        match self {
            Self::Feature { .. } | Self::Estimator { .. } => None,
            Self::Combiner { beside, .. } => beside.bounds,
        }
    }

    /// The slot of the standard deviation of its predictions, where somebody reads it.
    #[must_use]
    pub fn std_dev(&self) -> Option<usize> {
        match self {
            Self::Feature { .. } => None,
            Self::Estimator { std_dev, .. } => *std_dev,
            Self::Combiner { beside, .. } => beside.std_dev.map(|(slot, _)| slot),
        }
    }
}

/// What a node is fitted on.
#[derive(Debug, Clone)]
pub struct PlannedFit {
    /// What makes up a row, over all gathers.
    pub regressors: Vec<Regressor>,
    /// The truth that it learns from.
    pub truth: TruthLink,
    /// Which rows it is fitted on.
    pub training: TrainingLimits,
}

/// The rows that a node is fitted on.
#[derive(Debug, Clone, Copy)]
pub struct Rows<'a> {
    /// What they are made of, and which of them count.
    pub fit: &'a PlannedFit,
    /// The gathers of a row, one after the other; not those that look back.
    pub gathers: &'a [usize],
    /// The gathers of which one must be fresh for the node to run; none where it runs at every tick.
    pub triggers: &'a [usize],
}

impl PlannedNode {
    /// What an estimator that needs no fit predicts by.
    pub(crate) fn fixed(&self) -> Option<Box<dyn Predictor>> {
        let Role::Estimator(estimator) = self.spec.role() else {
            return None;
        };
        let regressors = self.role.fit()?.regressors.iter();
        let names: Vec<_> = regressors.map(|of| of.name.clone()).collect();
        estimator.fixed(&names)
    }

    /// The rows that the node is fitted on; none where it needs no fit.
    pub fn rows(&self) -> Option<Rows<'_>> {
        let fit = self.role.fit().filter(|_| self.fixed().is_none())?;
        let (gathers, triggers, every_tick) = match &self.role {
            PlannedRole::Feature {
                inputs,
                gathers,
                every_tick,
                ..
            } => {
                let own = inputs.hindsight.map_or(gathers.len(), |of| of.port);
                (&gathers[..own], own, *every_tick)
            }
            PlannedRole::Estimator {
                gathers,
                every_tick,
                ..
            } => (&gathers[..], gathers.len().min(1), *every_tick),
            PlannedRole::Combiner { .. } => return None,
        };
        Some(Rows {
            fit,
            gathers,
            triggers: &gathers[..if every_tick { 0 } else { triggers }],
        })
    }
}

/// The port of the standard deviation of the truth about a prediction.
pub(super) const STD_DEV: &str = "std_dev";

/// The port of how far regressors are outside of those of the fit.
pub(super) const NOVELTY: &str = "novelty";

/// The port of the weights of votes.
pub(super) const WEIGHTS: &str = "weights";

/// What a combiner gives beside its prediction: the slots.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct AuxPorts {
    /// The first of the weights, where somebody reads them.
    pub weights: Option<usize>,
    /// Of the reason.
    pub reason: Option<usize>,
    /// Of both ends of its intervals.
    pub bounds: Option<(usize, usize)>,
    /// Of the standard deviation, where somebody reads it, and the gather of those of the voters.
    pub std_dev: Option<(usize, usize)>,
    /// Of the novelty, where somebody reads it.
    pub novelty: Option<usize>,
    /// The gather of the novelties of voters, where it heeds them or shows its own.
    pub novelties: Option<usize>,
}

/// How an estimator goes on learning while it runs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlannedLearning {
    /// What is not learned from.
    pub limits: LearningLimits,
    /// The gather of the channels that must all be 0 for learning to go on.
    pub freeze: Option<usize>,
}

impl Plan {
    /// The slots that a node reads, with its truth.
    pub fn reads<'a>(&'a self, node: &'a PlannedNode) -> impl Iterator<Item = usize> + 'a {
        let gathers = node.role.gathers();
        let entries = gathers.flat_map(|gather| &self.gathers[gather].entries);
        let truth = node.role.truth().map(|truth| truth.slot);
        entries.map(|entry| entry.slot).chain(truth)
    }

    /// By slot, whether it is one of these or one that they depend on.
    pub fn behind(&self, slots: impl IntoIterator<Item = usize>) -> Vec<bool> {
        upstream(self, slots, |node| self.reads(node).collect())
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
        smallest_lag(self.span, self.ahead)
    }

    /// The truth that a learner's predictions are made of beside their regressors, with the delay of the newest that it has seen.
    pub(crate) fn learned_from(&self) -> (usize, Duration) {
        (self.slot, persistence_lag(self.span, self.ahead))
    }

    /// Whether the truth of a run's own tick is a regressor that it may have: the window of what it predicts begins where that
    /// truth's ends, or later.
    #[must_use]
    pub(crate) fn allows_present(&self) -> bool {
        self.ahead > Duration::ZERO && self.embargo().is_zero()
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
