//! What one node does at a tick: whether it runs, what it reads and where its outputs go.

use std::ops::Range;

use super::estimate::Estimate;
use super::gather::Gathered;
use super::runner::NodeRunner;
use super::slots::Slots;
use super::vote::Vote;
use crate::channel::unless_infinite;
use crate::engine::at_work::AtWork;
use crate::engine::learning::GatedLearner;
use crate::node::{Operator, Outputs, Tick};
use crate::time::Instant;

/// What all nodes see of a tick.
pub(crate) struct TickContext<'a> {
    pub(crate) now: Instant,
    pub(crate) slots: &'a mut Slots,
    pub(crate) gathered: &'a mut [Gathered],
    /// Room for the regressors of any estimator.
    pub(crate) row: &'a mut [f64],
    /// Whether learning has been frozen on command.
    pub(crate) frozen: bool,
    pub(crate) at_work: &'a mut AtWork,
}

impl TickContext<'_> {
    #[inline]
    pub(crate) fn run(&mut self, running: &mut NodeRunner) {
        match running {
            NodeRunner::Operator {
                operator,
                gathers,
                every_tick,
                closes_loops,
                slots,
            } => {
                let changed = |&gather: &usize| {
                    let gathered = &self.gathered[gather];
                    gathered.fresh | gathered.ended
                };
                if *every_tick || gathers.iter().any(changed) {
                    self.operator(&mut **operator, slots.clone(), gathers, *closes_loops);
                }
            }
            NodeRunner::Estimate {
                estimate,
                trigger,
                slot,
                std_dev,
            } => self.estimate(estimate.as_mut(), *trigger, *slot, *std_dev),
            NodeRunner::Vote(vote) => self.vote(vote),
        }
    }

    /// Lets a node take what it needs of values that are not yet there when it runs.
    #[inline(never)]
    pub(crate) fn capture(&self, running: &mut NodeRunner) {
        if let NodeRunner::Operator {
            operator, gathers, ..
        } = running
        {
            operator.capture(&Tick {
                now: self.now,
                gathered: &&*self.gathered,
                ports: gathers,
            });
        }
    }

    fn operator(
        &mut self,
        operator: &mut dyn Operator,
        range: Range<usize>,
        gathers: &[usize],
        closes_loops: bool,
    ) {
        let Self {
            now,
            slots,
            gathered,
            ..
        } = self;
        let now = *now;
        let oldest = |&gather: &usize| gathered[gather].oldest();
        let stamp = if closes_loops {
            None
        } else {
            gathers.iter().filter_map(oldest).min()
        };
        let mut outputs = Outputs {
            values: &mut slots.values[range.clone()],
            given: &mut slots.given[range],
            tick: slots.tick,
            default_stamp: stamp.unwrap_or(now),
        };
        let tick = Tick {
            now,
            gathered: &&**gathered,
            ports: gathers,
        };
        operator.step(&tick, &mut outputs);
    }

    /// Lets an estimator learn before it runs; the outcome of the newest truth stands beside its prediction.
    #[inline]
    pub(crate) fn learn(&mut self, learning: &mut GatedLearner, slot: usize) {
        let (now, on) = (self.now, !self.frozen);
        if learning.at_once() && self.slots.fresh(learning.truth()) {
            let truth = self.slots.values[learning.truth()];
            learning.observe(truth, now, self.gathered, on);
        }
        if let Some((became, arrived)) = learning.release(now, self.gathered, on) {
            self.slots.set(slot + 1, f64::from(became as u8), arrived);
        }
    }

    /// Lets an estimator learn, then predict.
    #[inline(never)]
    fn estimate(
        &mut self,
        mut estimate: Option<&mut Estimate>,
        trigger: Option<usize>,
        slot: usize,
        std_dev: Option<usize>,
    ) {
        if let Some(learning) = estimate.as_mut().and_then(|estimate| estimate.learning()) {
            self.learn(learning, slot);
        }
        let Self {
            now,
            slots,
            gathered,
            row,
            frozen,
            ..
        } = self;
        let (now, on) = (*now, !*frozen);
        if trigger.is_some_and(|gather| !gathered[gather].fresh) {
            return;
        }
        let Some(estimate) = estimate else {
            slots.set(slot, f64::NAN, now);
            return;
        };
        if let Some(feedback) = estimate.feedback() {
            feedback.before_run(slots, now);
        }
        let row = &mut row[..estimate.width()];
        let (value, stamp) = estimate.run(gathered, row, now, on);
        slots.set(slot, value, stamp);
        if let Some(slot) = std_dev {
            let known = if value.is_nan() {
                f64::NAN
            } else {
                estimate.std_dev(row, now)
            };
            slots.set(slot, known, stamp);
        }
    }

    #[inline]
    fn vote(&mut self, vote: &mut Vote) {
        let Self {
            now,
            slots,
            gathered,
            ..
        } = self;
        let now = *now;
        vote.release(now);
        let votes = &gathered[vote.wires.voters];
        let mut fresh = votes.fresh;
        if let Some(state) = vote.wires.state {
            vote.go_by(gathered[state].values[0], now);
            fresh |= gathered[state].fresh;
        }
        if !fresh {
            return;
        }
        let (value, stamp) = vote.run(votes, now);
        slots.set(vote.wires.slot, value, stamp);
        let Some(&beside) = vote.wires.beside.as_deref() else {
            return;
        };
        if beside.weights.is_some() || beside.std_dev.is_some() {
            let weights = vote.weigh(votes);
            if let Some(first) = beside.weights {
                for (slot, &weight) in (first..).zip(weights) {
                    slots.set(slot, unless_infinite(weight), stamp);
                }
            }
        }
        if let Some(slot) = beside.reason {
            slots.set(slot, unless_infinite(vote.reason(votes)), stamp);
        }
        if let Some((lower, upper)) = beside.bounds {
            let ends = vote.interval();
            slots.set(lower, unless_infinite(ends[0]), stamp);
            slots.set(upper, unless_infinite(ends[1]), stamp);
        }
        if let Some((slot, of_voters)) = beside.std_dev {
            let of_voters = &gathered[of_voters].values;
            slots.set(slot, vote.std_dev(votes, of_voters, value), stamp);
        }
    }
}
