//! Decides what one node does at a tick: whether it runs, what it reads and where its outputs go; not in which order nodes do.

use super::estimate::Estimate;
use super::gather::Gathered;
use super::running::Running;
use super::slots::Slots;
use super::vote::Vote;
use crate::channel::unless_infinite;
use crate::compile::{PlannedNode, PlannedRole};
use crate::node::{Operator, Outputs, Tick};
use crate::time::Instant;

/// What all nodes see of a tick.
pub(super) struct Turn<'a> {
    pub(super) now: Instant,
    pub(super) slots: &'a mut Slots,
    pub(super) gathered: &'a [Gathered],
    /// Whether learning has been frozen on command.
    pub(super) frozen: bool,
}

impl Turn<'_> {
    #[inline]
    pub(super) fn of(self, running: &mut Running, node: &PlannedNode) {
        match running {
            Running::Operator {
                operator,
                gathers,
                every_tick,
                closes_loops,
            } => {
                let fresh = |&gather: &usize| self.gathered[gather].fresh;
                if *every_tick || gathers.iter().any(fresh) {
                    self.operator(&mut **operator, node, gathers, *closes_loops);
                }
            }
            Running::Estimate { estimate, trigger } => {
                self.estimate(estimate.as_mut(), *trigger, node);
            }
            Running::Vote(vote) => self.vote(vote, node),
        }
    }

    fn operator(
        self,
        operator: &mut dyn Operator,
        node: &PlannedNode,
        gathers: &[usize],
        closes_loops: bool,
    ) {
        let Self {
            now,
            slots,
            gathered,
            ..
        } = self;
        let oldest = |&gather: &usize| gathered[gather].oldest();
        let stamp = if closes_loops {
            None
        } else {
            gathers.iter().filter_map(oldest).min()
        };
        let range = node.slots.clone();
        let mut outputs = Outputs {
            values: &mut slots.values[range.clone()],
            given: &mut slots.given[range],
            tick: slots.tick,
            default_stamp: stamp.unwrap_or(now),
        };
        let tick = Tick {
            now,
            gathered,
            ports: gathers,
        };
        operator.step(&tick, &mut outputs);
    }

    #[inline]
    fn estimate(
        self,
        mut estimate: Option<&mut Estimate>,
        trigger: Option<usize>,
        node: &PlannedNode,
    ) {
        let Self {
            now,
            slots,
            gathered,
            frozen,
        } = self;
        let slot = node.slots.start;
        if let Some(learning) = estimate.as_mut().and_then(|estimate| estimate.learning()) {
            if learning.at_once() && slots.fresh(learning.truth()) {
                let truth = slots.values[learning.truth()];
                learning.observe(truth, now, gathered, !frozen);
            }
            if let Some((became, arrived)) = learning.release(now, gathered, !frozen) {
                slots.set(slot + 1, f64::from(became as u8), arrived);
            }
        }
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
        let (value, stamp) = estimate.run(gathered, now, !frozen);
        slots.set(slot, value, stamp);
        if let Some(slot) = node.role.deviation() {
            let known = if value.is_nan() {
                f64::NAN
            } else {
                estimate.deviation(now)
            };
            slots.set(slot, known, stamp);
        }
    }

    #[inline]
    fn vote(self, vote: &mut Vote, node: &PlannedNode) {
        let Self {
            now,
            slots,
            gathered,
            ..
        } = self;
        vote.release(now);
        let PlannedRole::Combiner {
            voters,
            state,
            beside,
            ..
        } = &node.role
        else {
            unreachable!("a vote is planned as a combiner")
        };
        let votes = &gathered[*voters];
        let mut fresh = votes.fresh;
        if let Some(state) = *state {
            vote.go_by(gathered[state].values[0], now);
            fresh |= gathered[state].fresh;
        }
        if !fresh {
            return;
        }
        let (value, stamp) = vote.run(votes, now);
        slots.set(node.slots.start, value, stamp);
        if beside.weights.is_some() || beside.deviation.is_some() {
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
        if let Some((slot, of_voters)) = beside.deviation {
            let of_voters = &gathered[of_voters].values;
            slots.set(slot, vote.deviation(votes, of_voters, value), stamp);
        }
    }
}
