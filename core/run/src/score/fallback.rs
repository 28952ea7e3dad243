//! How often an output is a fallback's and not that of the voter that should be passed on, and why.

use std::collections::BTreeMap;

use serde::Serialize;

use super::hide_much;
use crate::compile::{Plan, PlannedRole};
use crate::diagnostic::count;
use crate::engine::Engine;
use crate::node::Duty;

/// A `fallback` node whose first voter was not there.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FellBack {
    /// The node: `now/result.Z`.
    pub node: String,
    /// Its first voter.
    pub voter: String,
    /// Ticks at which it gave something.
    pub ticks: u64,
    /// Those at which that was another voter's.
    pub fell_back: u64,
    /// What lacked most often then: a measured channel, or a node all of whose inputs were there.
    pub lacked: String,
}

impl FellBack {
    /// A sentence for each that is more than a cold start.
    #[must_use]
    pub fn warnings(of: &[Self]) -> Vec<String> {
        let often = of.iter().filter(|of| {
            let (fell_back, ticks) = (of.fell_back as usize, of.ticks as usize);
            hide_much(fell_back, ticks)
        });
        often.map(Self::sentence).collect()
    }

    fn sentence(&self) -> String {
        let Self {
            node,
            voter,
            lacked,
            ..
        } = self;
        let share = 100.0 * self.fell_back as f64 / self.ticks as f64;
        format!(
            "{node} was its fallback at {share:.0}% of {} ticks, where {voter} had no value: most often {lacked} had none that counts",
            count(self.ticks)
        )
    }
}

/// What is counted of one such node.
#[derive(Debug)]
pub(super) struct Fallen {
    slot: usize,
    gather: usize,
    voter: usize,
    ticks: u64,
    lacked: BTreeMap<String, u64>,
}

impl Fallen {
    /// One for each `fallback`.
    pub(super) fn all(plan: &Plan) -> Vec<Self> {
        let nodes = plan
            .nodes
            .iter()
            .filter(|of| of.kind.duty() == Duty::Fallback);
        let watched = nodes.filter_map(|node| match node.role {
            PlannedRole::Combiner { voters, .. } => Some(Self {
                slot: node.slots.start,
                gather: voters,
                voter: plan.gathers[voters].entries.first()?.slot,
                ticks: 0,
                lacked: BTreeMap::new(),
            }),
            _ => None,
        });
        watched.collect()
    }

    /// Looks at what a tick did.
    pub(super) fn look(&mut self, engine: &Engine) {
        if engine.value(self.slot).is_nan() {
            return;
        }
        self.ticks += 1;
        if engine.gathered(self.gather).0[0].is_nan() {
            *self.lacked.entry(engine.lacking(self.voter)).or_default() += 1;
        }
    }

    /// How often each was the fallback.
    pub(super) fn found(all: &[Self], plan: &Plan) -> Vec<FellBack> {
        let found = all.iter().filter_map(|of| {
            let (lacked, _) = of.lacked.iter().max_by_key(|(_, times)| **times)?;
            Some(FellBack {
                node: plan.channels[of.slot].name.clone(),
                voter: plan.channels[of.voter].name.clone(),
                ticks: of.ticks,
                fell_back: of.lacked.values().sum(),
                lacked: lacked.clone(),
            })
        });
        found.collect()
    }
}
