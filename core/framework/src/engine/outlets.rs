//! Decides what is put out at a tick, and what the outputs of the graph that follows must know of it.

use super::blend::{Blending, rate};
use super::slots::Slots;
use crate::compile::Plan;
use crate::time::Instant;

/// The outputs of a running plan, side by side in its order.
#[derive(Debug)]
pub(super) struct Outlets {
    /// Where they are from.
    slots: Box<[usize]>,
    /// What the last tick gave.
    values: Box<[f64]>,
    /// What those that step over at once were last, and when; of the others, and before a graph has given anything of its own, at
    /// [`Instant::MIN`].
    last: Box<[f64]>,
    at: Box<[Instant]>,
    /// Those that do not step over at once, and how fast they pass over, in their units per second.
    passing: Box<[(usize, f64)]>,
    /// How each passes over, unless it has stepped over.
    blendings: Box<[Blending]>,
}

impl Outlets {
    pub(super) fn new(plan: &Plan) -> Self {
        let count = plan.outputs.len();
        let rates = plan
            .outputs
            .iter()
            .enumerate()
            .filter_map(|(index, output)| {
                let unit = &plan.channels[output.slot].channel.unit;
                Some((index, rate(output, unit)?))
            });
        Self {
            slots: plan.outputs.iter().map(|output| output.slot).collect(),
            values: vec![f64::NAN; count].into(),
            last: vec![f64::NAN; count].into(),
            at: vec![Instant::MIN; count].into(),
            passing: rates.collect(),
            blendings: vec![Blending::default(); count].into(),
        }
    }

    /// What the last tick gave.
    pub(super) fn values(&self) -> &[f64] {
        &self.values
    }

    /// Puts out what the nodes gave at the present tick; NaN where one did not run or gave nothing.
    pub(super) fn put_out(&mut self, slots: &Slots, now: Instant) {
        let last = self.last.iter_mut().zip(&mut self.at);
        for ((value, (last, at)), &slot) in self.values.iter_mut().zip(last).zip(&self.slots) {
            *value = slots.now(slot);
            if !value.is_nan() {
                (*last, *at) = (*value, now);
            }
        }
        for &(index, rate) in &self.passing {
            self.at[index] = Instant::MIN;
            let value = &mut self.values[index];
            if !value.is_nan() {
                *value = self.blendings[index].pass(now, *value, rate);
            }
        }
    }

    /// How an output passes over, and what it was last.
    pub(super) fn blending(&self, index: usize) -> Blending {
        if self.at[index] == Instant::MIN {
            self.blendings[index]
        } else {
            Blending::at_once(self.at[index], self.last[index])
        }
    }

    /// Lets an output go on passing over as it did.
    pub(super) fn go_on(&mut self, index: usize, blending: Blending) {
        self.blendings[index] = blending;
        self.at[index] = Instant::MIN;
    }

    /// Lets outputs take over from those of another graph, both having been stepped to the same tick.
    pub(super) fn take_over(&mut self, before: &Self, from: &[Option<usize>]) {
        for (index, from) in from.iter().enumerate() {
            if let Some(from) = *from {
                let mut blending = self.blending(index);
                blending.hand_over(&before.blending(from));
                self.go_on(index, blending);
            }
        }
    }
}
