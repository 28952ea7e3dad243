//! What is known of a tick by whoever looks on, without stepping it again.

use std::sync::Arc;

use crate::compile::{Plan, PlannedNode, PlannedRole};
use crate::engine::Engine;
use crate::node::Duty;
use crate::score::link;
use crate::time::Instant;

/// Stands for a slot that was given nothing, not even that it has no value: a NaN of bits that no arithmetic makes.
const IDLE: u64 = f64::NAN.to_bits() | 0x1d1e;

/// What a slot was given at a tick.
pub trait Slots {
    /// Whether a slot was given something, be it nothing.
    fn ran(&self, slot: usize) -> bool;

    /// The value that it was given; NaN where its node did not run or gave nothing.
    fn value(&self, slot: usize) -> f64;
}

impl Slots for Engine {
    fn ran(&self, slot: usize) -> bool {
        self.ran(slot)
    }

    fn value(&self, slot: usize) -> f64 {
        self.value(slot)
    }
}

/// The slots that are mirrored with each tick, in order: what is measured, all that predict, their truths, novelties, what learners say,
/// and what judges of drifts and sensors says, with what it says that of.
#[must_use]
pub fn mirrored(plan: &Plan) -> Arc<[usize]> {
    let predicts = |slot: usize| Some([slot, link(plan, slot)?.slot]);
    let novelty = plan.nodes.iter().filter_map(|node| match &node.role {
        PlannedRole::Estimator { novelty, .. } => *novelty,
        _ => None,
    });
    let learning = plan.nodes.iter().filter_map(PlannedNode::says_of_learning);
    let predict = (0..plan.channels.len()).filter_map(predicts).flatten();
    let says = |node: &&PlannedNode| {
        matches!(
            node.kind.duty(),
            Duty::Grade { .. } | Duty::Correct | Duty::Loss { .. } | Duty::Watch
        )
    };
    let read = |node: &PlannedNode| {
        let entries = node.role.inputs().flat_map(|of| &plan.gathers[of].entries);
        entries.map(|of| of.slot).collect::<Vec<_>>()
    };
    let said = plan.nodes.iter().filter(says);
    let said = said.flat_map(|node| node.slots.clone().chain(read(node)));
    let mut slots: Vec<usize> = (0..plan.sources.len())
        .chain(predict)
        .chain(novelty)
        .chain(learning)
        .chain(said)
        .collect();
    slots.sort_unstable();
    slots.dedup();
    slots.into()
}

/// What is mirrored of a tick beside its samples: outputs, then the slots that are shown.
pub(super) fn values<'a>(engine: &'a Engine, shown: &'a [usize]) -> impl Iterator<Item = f64> + 'a {
    let slot = |slot: &usize| match engine.ran(*slot) {
        true => engine.value(*slot),
        false => f64::from_bits(IDLE),
    };
    engine
        .outputs()
        .iter()
        .copied()
        .chain(shown.iter().map(slot))
}

/// A tick of the graph that runs, as the control thread knows it.
#[derive(Debug, Clone, Copy)]
pub struct TickView<'a> {
    /// The instant.
    pub at: Instant,
    /// How many ticks, breaks and freezes there were in this run, with it.
    pub event: u64,
    /// The revision of the graph.
    pub revision: &'a str,
    /// Its plan.
    pub plan: &'a Arc<Plan>,
    /// The outputs, in the order of the plan's.
    pub outputs: &'a [f64],
    /// What runs as it is after the tick, where there is a replica of it.
    pub engine: Option<&'a Engine>,
    pub(super) shown: &'a [usize],
    pub(super) values: &'a [f64],
}

/// Of the slots that are [mirrored](TickView::is_mirrored); of others where there is a replica.
impl Slots for TickView<'_> {
    fn ran(&self, slot: usize) -> bool {
        match self.engine {
            Some(engine) => engine.ran(slot),
            None => self.mirrored(slot).to_bits() != IDLE,
        }
    }

    fn value(&self, slot: usize) -> f64 {
        match self.engine {
            Some(engine) => engine.value(slot),
            None if self.ran(slot) => self.mirrored(slot),
            None => f64::NAN,
        }
    }
}

impl<'a> TickView<'a> {
    /// The last tick of an engine.
    #[must_use]
    pub fn of(at: Instant, engine: &'a Engine) -> Self {
        Self {
            at,
            event: 0,
            revision: engine.revision(),
            plan: engine.plan(),
            outputs: engine.outputs(),
            engine: Some(engine),
            shown: &[],
            values: &[],
        }
    }

    /// Whether the value of a slot is known where there is no replica.
    #[must_use]
    pub fn is_mirrored(&self, slot: usize) -> bool {
        self.shown.binary_search(&slot).is_ok()
    }

    fn mirrored(&self, slot: usize) -> f64 {
        let place = self.shown.binary_search(&slot);
        place.map_or(f64::from_bits(IDLE), |place| self.values[place])
    }
}
