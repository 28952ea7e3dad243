//! Decides what is put out at a tick, and what the outputs of the graph that follows must know of it.

use std::ops::Range;

use super::slots::Slots;
use crate::compile::Plan;
use crate::engine::state::{Blending, rate};
use crate::time::Instant;

/// The outputs of a running plan, side by side in its order.
#[derive(Debug)]
pub(crate) struct OutputSlots {
    /// Where they are from: runs of them whose slots lie side by side, and the first slot of each.
    runs: Box<[(Range<usize>, usize)]>,
    /// What the last tick gave.
    values: Box<[f64]>,
    /// What the one before gave.
    before: Box<[f64]>,
    /// When the last one was, where it gave all of them and none passes over.
    whole: Option<Instant>,
    /// Otherwise what those that step over at once were last, and when; of the others, and before a graph has given anything of its
    /// own, at [`Instant::MIN`].
    last: Box<[f64]>,
    at: Box<[Instant]>,
    /// Those that do not step over at once, and how fast they pass over, in their units per second.
    passing: Box<[(usize, f64)]>,
    /// How each passes over, unless it has stepped over.
    blendings: Box<[Blending]>,
}

impl OutputSlots {
    pub(crate) fn new(plan: &Plan) -> Self {
        let count = plan.outputs.len();
        let slots: Vec<_> = plan.outputs.iter().map(|output| output.slot).collect();
        let mut first = 0;
        let runs = slots.chunk_by(|slot, next| slot + 1 == *next).map(|run| {
            let outputs = first..first + run.len();
            first = outputs.end;
            (outputs, run[0])
        });
        let rates = plan
            .outputs
            .iter()
            .enumerate()
            .filter_map(|(index, output)| {
                let unit = &plan.channels[output.slot].channel.unit;
                Some((index, rate(output, unit)?))
            });
        Self {
            runs: runs.collect(),
            values: vec![f64::NAN; count].into(),
            before: vec![f64::NAN; count].into(),
            whole: None,
            last: vec![f64::NAN; count].into(),
            at: vec![Instant::MIN; count].into(),
            passing: rates.collect(),
            blendings: vec![Blending::default(); count].into(),
        }
    }

    /// What the last tick gave.
    pub(crate) fn values(&self) -> &[f64] {
        &self.values
    }

    /// Puts out what the nodes gave at the present tick; NaN where one did not run or gave nothing.
    pub(crate) fn put_out(&mut self, slots: &Slots, now: Instant) {
        std::mem::swap(&mut self.values, &mut self.before);
        let mut lacks = false;
        for (outputs, first) in &self.runs {
            let values = &mut self.values[outputs.clone()];
            // Several at once are not worth their preparation for one.
            if let [value] = values {
                *value = slots.now(*first);
                lacks |= value.is_nan();
                continue;
            }
            let slots_of_run = *first..first + values.len();
            let given = slots.given[slots_of_run.clone()].iter();
            let from = slots.values[slots_of_run].iter().zip(given);
            for (value, (&last, given)) in values.iter_mut().zip(from) {
                *value = if given.tick == slots.tick {
                    last
                } else {
                    f64::NAN
                };
                lacks |= value.is_nan();
            }
        }
        if lacks || !self.passing.is_empty() {
            self.put_out_apart(now);
        } else {
            self.whole = Some(now);
        }
    }

    /// The same where not all of them were given, or some pass over.
    #[inline(never)]
    fn put_out_apart(&mut self, now: Instant) {
        if let Some(whole) = self.whole.take() {
            self.last.copy_from_slice(&self.before);
            self.at.fill(whole);
        }
        let last = self.last.iter_mut().zip(&mut self.at);
        for (value, (last, at)) in self.values.iter().zip(last) {
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
    pub(crate) fn blending(&self, index: usize) -> Blending {
        match self.whole {
            Some(whole) => Blending::at_once(whole, self.values[index]),
            None if self.at[index] == Instant::MIN => self.blendings[index],
            None => Blending::at_once(self.at[index], self.last[index]),
        }
    }

    /// Lets an output go on passing over as it did.
    pub(crate) fn go_on(&mut self, index: usize, blending: Blending) {
        if let Some(whole) = self.whole.take() {
            self.last.copy_from_slice(&self.values);
            self.at.fill(whole);
        }
        self.blendings[index] = blending;
        self.at[index] = Instant::MIN;
    }

    /// Lets outputs take over from those of another graph, both having been stepped to the same tick.
    pub(crate) fn take_over(&mut self, before: &Self, from: &[Option<usize>]) {
        for (index, from) in from.iter().enumerate() {
            if let Some(from) = *from {
                let mut blending = self.blending(index);
                blending.hand_over(&before.blending(from));
                self.go_on(index, blending);
            }
        }
    }
}
