//! What is planned: when a value that came ahead of its time begins to hold.

use super::history::History;
use super::slots::Slots;
use crate::compile::Plan;
use crate::node::SlotTime;
use crate::time::{Duration, Instant};

/// A channel of which values come before they apply.
///
/// Its slot holds what applies at the tick, as if that had been measured when it began to. Its history goes on beyond the tick.
pub(crate) struct PlannedSlot {
    pub(crate) slot: usize,
    /// The place of its history, where it has one.
    history: Option<usize>,
    /// The slot of the instant from which on a value applies.
    applies_at: usize,
    /// What applied before the tick.
    before: (f64, SlotTime),
}

impl PlannedSlot {
    /// Those of a plan; `with_history` are the slots that have one.
    pub(crate) fn all(plan: &Plan, with_history: &[usize]) -> Vec<Self> {
        let sources = plan.sources.iter().enumerate();
        let planned = sources.filter_map(|(slot, source)| {
            Some(Self {
                slot,
                history: with_history.binary_search(&slot).ok(),
                applies_at: source.planned?.applies_at,
                before: (f64::NAN, SlotTime::NEVER),
            })
        });
        planned.collect()
    }

    /// Keeps what applied before the samples of a tick are taken in.
    pub(crate) fn keep(&mut self, slots: &Slots) {
        self.before = (slots.values[self.slot], slots.given[self.slot]);
    }

    /// Writes down what was announced at the tick, and gives what begins to apply.
    pub(crate) fn take(&self, slots: &mut Slots, histories: &mut [History], now: Instant) {
        let Some(history) = self.history.map(|of| &mut histories[of]) else {
            return;
        };
        if slots.fresh(self.slot) {
            let from = slots.now(self.applies_at);
            let from = Duration::from_secs_f64(from).map_or(now, |from| Instant::from_ns(0) + from);
            history.plan(now, from.max(now), slots.values[self.slot]);
        }
        let (before, given) = self.before;
        (slots.values[self.slot], slots.given[self.slot]) = self.before;
        let (value, from) = history.planned(now, Duration::MAX);
        let is_new = from != given.stamp || value.to_bits() != before.to_bits();
        if !value.is_nan() && is_new {
            slots.set(self.slot, value, from);
        }
    }
}
