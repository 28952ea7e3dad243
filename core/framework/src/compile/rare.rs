//! Which values that a node holds are of signals so rare that they must not age what is made of them.

use super::plan::{Entry, PlannedRole};
use super::resolver::Resolver;
use crate::node::Read;
use crate::time::Duration;

impl Resolver<'_> {
    /// Finds them, once loops have been followed. A combiner has none: its output is as old as the votes.
    pub(super) fn spare_rare(&mut self) {
        for node in 0..self.nodes.len() {
            let own = self.nodes[node].slots.clone();
            let counts = own.filter_map(|slot| self.channels[slot].channel.default_max_age());
            let Some(counts) = counts.min() else {
                continue;
            };
            let (mut spared, hindsight) = match &self.nodes[node].role {
                PlannedRole::Feature {
                    gathers, inputs, ..
                } => (gathers.clone(), inputs.hindsight),
                PlannedRole::Estimator { gathers, .. } => (gathers.clone(), None),
                PlannedRole::Combiner { .. } => continue,
            };
            // What is known later stays as old as it is.
            let own = hindsight.map_or(spared.len(), |of| of.port);
            for gather in &mut spared[..own] {
                *gather = self.sparing(*gather, counts);
            }
            if let PlannedRole::Feature { gathers, .. } | PlannedRole::Estimator { gathers, .. } =
                &mut self.nodes[node].role
            {
                *gathers = spared;
            }
        }
    }

    /// The gather that reads the same for a node whose output counts so long.
    fn sparing(&mut self, gather: usize, counts: Duration) -> usize {
        let of = &self.gathers[gather];
        if of.read != Read::Held {
            return gather;
        }
        let entries = of.entries.iter().enumerate();
        let ages = entries.map(|(place, entry)| (place, self.unaging(entry)));
        let rare: Vec<_> = ages.filter(|&(_, age)| age > counts).collect();
        if rare.is_empty() {
            return gather;
        }
        let of = of.clone();
        self.gathers.insert_full(super::Gather { rare, ..of }).0
    }

    /// Until which age a value is as its signal or its reader lets it be; none of what is predicted or planned.
    fn unaging(&self, entry: &Entry) -> Duration {
        let of = &self.channels[entry.slot];
        if of.predicts.is_some() || entry.lag.is_negative() {
            return Duration::ZERO;
        }
        if of.channel.default_max_age() != Some(entry.max_age) {
            return entry.max_age;
        }
        let sources = self.provenance[entry.slot].sources();
        let ages = sources.filter_map(|(source, _)| self.channels[source].channel.max_age);
        ages.max().unwrap_or_default().min(entry.max_age)
    }
}
