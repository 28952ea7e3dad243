//! Decides what makes two nodes the same: everything that their outputs follow from, and nothing of how it is spelt.

use serde_json::{Value, json};

use super::plan::{Gather, Plan, PlannedLearning, PlannedNode, PlannedRole, TruthLink};
use crate::time::Duration;

impl Plan {
    /// What a node's outputs follow from, beside the nodes that it reads: kind, parameters, inputs, truth, limits.
    ///
    /// Two nodes of the same identity compute the same from the same inputs; comments, order and spelling leave no trace.
    #[must_use]
    pub fn identity(&self, node: &PlannedNode) -> Value {
        let role = match &node.role {
            PlannedRole::Feature { gathers, .. } => {
                let inputs: Vec<_> = gathers.iter().map(|&gather| self.read(gather)).collect();
                json!({ "inputs": inputs })
            }
            PlannedRole::Estimator {
                gathers,
                truth,
                training,
                learning,
                ..
            } => {
                let inputs: Vec<_> = gathers.iter().map(|&gather| self.read(gather)).collect();
                json!({
                    "inputs": inputs,
                    "truth": self.link(truth),
                    "above": training.above.to_bits(),
                    "below": training.below.to_bits(),
                    "learning": learning.as_ref().map(|learning| self.learning(learning)),
                })
            }
            PlannedRole::Combiner { truth, .. } => json!({
                "inputs": node.role.gathers().map(|gather| self.read(gather)).collect::<Vec<_>>(),
                "truth": truth.as_ref().map(|truth| self.link(truth)),
            }),
        };
        json!({ "type": node.kind.name, "parameters": node.spec.parameters(), "role": role })
    }

    /// What a slot carries, by name.
    #[must_use]
    pub fn describe(&self, slot: usize) -> Value {
        let planned = &self.channels[slot];
        let range = self
            .sources
            .get(slot)
            .map(|source| [source.range.0.to_bits(), source.range.1.to_bits()]);
        json!({
            "channel": planned.name,
            "unit": planned.channel.unit.to_string(),
            "span": planned.channel.span,
            "ahead": planned.channel.ahead,
            "range": range,
        })
    }

    /// The time after which a node, started cold, knows all that it would know had it always run.
    pub(super) fn warm_up_of(&self, slot_warm_up: &[Duration], node: &PlannedNode) -> Duration {
        let entries = |gather: usize| &self.gathers[gather].entries;
        let before = || {
            let all = node.role.gathers().flat_map(entries);
            let ages = all.map(|entry| slot_warm_up[entry.slot] + entry.lag + entry.max_age);
            ages.max().unwrap_or(Duration::ZERO)
        };
        match (&node.role, node.spec.role()) {
            (PlannedRole::Feature { .. }, crate::node::Role::Feature(feature)) => {
                feature.memory() + before()
            }
            (PlannedRole::Combiner { truth, .. }, crate::node::Role::Combiner(combiner)) => {
                let learned = truth.map_or(Duration::ZERO, |truth| {
                    truth.embargo() + truth.ahead + truth.limit
                });
                combiner.memory() + learned + before()
            }
            (PlannedRole::Estimator { .. }, _) => before(),
            _ => unreachable!("a plan gives each node the role of its specification"),
        }
    }

    fn read(&self, gather: usize) -> Value {
        let Gather { read, entries, .. } = &self.gathers[gather];
        let entries: Vec<_> = entries
            .iter()
            .map(|entry| {
                json!({ "from": self.describe(entry.slot), "lag": entry.lag, "max_age": entry.max_age })
            })
            .collect();
        json!({ "fresh": *read == crate::node::Read::Fresh, "entries": entries })
    }

    fn learning(&self, learning: &PlannedLearning) -> Value {
        json!({
            "outliers": learning.outliers.to_bits(),
            "margin": learning.margin.to_bits(),
            "freeze": learning.freeze.map(|gather| self.read(gather)),
        })
    }

    fn link(&self, truth: &TruthLink) -> Value {
        json!({ "of": self.describe(truth.slot), "ahead": truth.ahead, "limit": truth.limit })
    }
}
