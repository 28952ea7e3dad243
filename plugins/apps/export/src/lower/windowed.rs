//! Leaps of what truths with a window are taken over: where they are looked for, and which truths are then none.

use std::collections::BTreeMap;

use athermal_core::compile::origins;

use super::Lowering;
use crate::form::{Field, Record};

/// How many integers and numbers are kept of a series in which leaps are looked for.
const KEPT: [usize; 2] = [14, 18];

impl Lowering<'_> {
    /// The truths with a window that something reads, each with the series that it is taken over.
    pub(super) fn windowed(&mut self, nodes: &[Record]) -> Vec<Record> {
        let plan = self.plan;
        let mut places = BTreeMap::new();
        let mut course = |lowering: &mut Self, slot: usize| {
            let [ints, reals] = *places
                .entry(slot)
                .or_insert_with(|| [lowering.ints(KEPT[0]), lowering.reals(KEPT[1])]);
            Record::new("course", plan.channels[slot].name.clone())
                .int("slot", slot)
                .int("ints", ints)
                .int("reals", reals)
        };
        let mut all = Vec::new();
        for (slot, over) in origins::windowed(plan) {
            if self.is_read(slot, nodes) {
                let channel = &plan.channels[slot];
                let courses: Vec<Record> = over.iter().map(|of| course(self, *of)).collect();
                let windowed = Record::new("windowed", channel.name.clone())
                    .int("slot", slot)
                    .int("count", courses.len())
                    .with("courses", Field::Structs(courses))
                    .with("span", Field::Int(channel.channel.span.as_ns()));
                all.push(windowed);
            }
        }
        all
    }

    /// Whether a node goes by a slot, learns from it or weighs by it, or an output gives it.
    fn is_read(&self, slot: usize, nodes: &[Record]) -> bool {
        let mut entries = self.gathers.iter().flat_map(|of| &of.entries);
        let is_truth = |of: &Record| of.int_of("truth") == slot as i64;
        entries.any(|of| of.slot == slot)
            || self.plan.outputs.iter().any(|of| of.slot == slot)
            || (nodes.iter())
                .any(|of| is_truth(of) || of.struct_of("learner").is_some_and(is_truth))
    }
}
