//! What is put out at a tick, and what the outputs of the graph that follows must know of it.

use super::slots::Slots;
use crate::compile::Plan;
use crate::engine::state::{Blending, rate};
use crate::time::Instant;

/// The outputs of a running plan, in its order.
#[derive(Debug)]
pub(crate) struct OutputSlots {
    outputs: Box<[Output]>,
    /// What the last tick gave.
    values: Box<[f64]>,
}

/// Where an output is from, and how it passes over from one graph to the next.
#[derive(Debug)]
struct Output {
    slot: usize,
    /// How fast it passes over, in its unit per second; none where it steps over at once.
    rate: Option<f64>,
    blending: Blending,
}

impl OutputSlots {
    pub(crate) fn new(plan: &Plan) -> Self {
        let outputs = plan.outputs.iter().map(|output| Output {
            slot: output.slot,
            rate: rate(output, &plan.channels[output.slot].channel.unit),
            blending: Blending::default(),
        });
        Self {
            outputs: outputs.collect(),
            values: vec![f64::NAN; plan.outputs.len()].into(),
        }
    }

    /// What the last tick gave.
    pub(crate) fn values(&self) -> &[f64] {
        &self.values
    }

    /// Puts out what the nodes gave at the present tick; NaN where one did not run or gave nothing.
    pub(crate) fn put_out(&mut self, slots: &Slots, now: Instant) {
        for (value, output) in self.values.iter_mut().zip(&mut self.outputs) {
            *value = slots.now(output.slot);
            if value.is_nan() {
                continue;
            }
            match output.rate {
                None => output.blending = Blending::at_once(now, *value),
                Some(rate) => *value = output.blending.pass(now, *value, rate),
            }
        }
    }

    /// How an output passes over, and what it was last.
    pub(crate) fn blending(&self, index: usize) -> Blending {
        self.outputs[index].blending
    }

    /// Lets an output go on passing over as it did.
    pub(crate) fn go_on(&mut self, index: usize, blending: Blending) {
        self.outputs[index].blending = blending;
    }

    /// Lets outputs take over from those of another graph, both having been stepped to the same tick.
    pub(crate) fn take_over(&mut self, before: &Self, from: &[Option<usize>]) {
        for (output, from) in self.outputs.iter_mut().zip(from) {
            if let Some(from) = *from {
                output.blending.hand_over(&before.outputs[from].blending);
            }
        }
    }
}
