//! What one node does at a tick: whether it runs, what it reads and where its outputs go.

use super::estimate::Estimate;
use super::gather::Gathered;
use super::runner::{EstimateRunner, NodeRunner, OperatorRunner};
use super::slots::Slots;
use super::vote::Vote;
use crate::channel::unless_infinite;
use crate::engine::at_work::AtWork;
use crate::engine::leap::Leaps;
use crate::engine::learning::GatedLearner;
use crate::node::{Outputs, Tick};
use crate::time::Instant;

/// What all nodes see of a tick.
pub(crate) struct TickContext<'a> {
    pub(crate) now: Instant,
    pub(crate) slots: &'a mut Slots,
    pub(crate) gathered: &'a mut [Gathered],
    pub(crate) leaps: &'a mut Leaps,
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
            NodeRunner::Operator(node) => {
                let changed = |&gather: &usize| {
                    let gathered = &self.gathered[gather];
                    gathered.fresh | gathered.ended
                };
                if node.every_tick || node.gathers.iter().any(changed) {
                    self.operator(node);
                }
            }
            NodeRunner::Estimate(node) => self.estimate(node),
            NodeRunner::Vote(vote) => self.vote(vote),
        }
    }

    /// Lets a node take what it needs of values that are not yet there when it runs.
    #[inline(never)]
    pub(crate) fn capture(&self, running: &mut NodeRunner) {
        if let NodeRunner::Operator(node) = running {
            node.operator.capture(&Tick {
                now: self.now,
                gathered: &&*self.gathered,
                ports: &node.gathers,
            });
        }
    }

    fn operator(&mut self, node: &mut OperatorRunner) {
        let stamp = if node.closes_loops {
            None
        } else {
            let oldest = |&gather: &usize| self.gathered[gather].oldest();
            node.gathers.iter().filter_map(oldest).min()
        };
        let mut outputs = Outputs {
            values: &mut self.slots.values[node.slots.clone()],
            given: &mut self.slots.given[node.slots.clone()],
            tick: self.slots.tick,
            default_stamp: stamp.unwrap_or(self.now),
        };
        let tick = Tick {
            now: self.now,
            gathered: &&*self.gathered,
            ports: &node.gathers,
        };
        node.operator.step(&tick, &mut outputs);
        if !node.truths.is_empty() {
            self.leaps.refuse(node.truths.clone(), self.slots, self.now);
        }
    }

    /// Lets an estimator learn before it runs; the outcome of the newest truth stands beside its prediction.
    #[inline]
    pub(crate) fn learn(&mut self, learning: &mut GatedLearner, slot: usize) {
        let (now, on) = (self.now, !self.frozen);
        if learning.at_once() && self.slots.fresh(learning.truth()) {
            let truth = self.slots.values[learning.truth()];
            learning.observe(truth, now, self.gathered, on);
        }
        let said = self.slots.values[slot + 1];
        if let Some((says, arrived)) = learning.release(now, self.gathered, on, said) {
            self.slots.set(slot + 1, says, arrived);
        }
    }

    /// Lets an estimator learn, then predict.
    #[inline(never)]
    fn estimate(&mut self, node: &mut EstimateRunner) {
        if let Some(learning) = node.estimate.as_mut().and_then(Estimate::learning) {
            self.learn(learning, node.slot);
        }
        if node.trigger.is_some_and(|of| !self.gathered[of].fresh) {
            return;
        }
        let now = self.now;
        let Some(estimate) = &mut node.estimate else {
            self.slots.set(node.slot, f64::NAN, now);
            return;
        };
        if let Some(feedback) = estimate.feedback() {
            feedback.before_run(self.slots, now);
        }
        let row = &mut self.row[..estimate.width()];
        let (value, stamp) = estimate.run(self.gathered, row, now, !self.frozen);
        self.slots.set(node.slot, value, stamp);
        if let Some(slot) = node.std_dev {
            let known = if value.is_nan() {
                f64::NAN
            } else {
                estimate.std_dev(row, value, now)
            };
            self.slots.set(slot, known, stamp);
        }
        if let Some(slot) = node.novelty {
            self.slots.set(slot, estimate.novelty, stamp);
        }
    }

    #[inline]
    fn vote(&mut self, vote: &mut Vote) {
        let (now, gathered, slots) = (self.now, &*self.gathered, &mut *self.slots);
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
        vote.heed(gathered);
        let (value, stamp) = vote.run(votes, now);
        slots.set(vote.wires.slot, value, stamp);
        let Some(&beside) = vote.wires.beside.as_deref() else {
            return;
        };
        if beside.weights.is_some() || beside.std_dev.is_some() || beside.novelty.is_some() {
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
        if let Some(slot) = beside.novelty {
            slots.set(slot, unless_infinite(vote.novelty()), stamp);
        }
        if let Some((slot, of_voters)) = beside.std_dev {
            let of_voters = &gathered[of_voters].values;
            slots.set(slot, vote.std_dev(votes, of_voters, value), stamp);
        }
    }
}
