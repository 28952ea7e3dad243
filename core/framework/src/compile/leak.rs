//! Which features see the future: those that are made of what the truth is made of, too little delayed.
//!
//! It looks at the graph once all of it is known, since feedback through a delay brings what comes later in the order.

use super::plan::{PlannedNode, PlannedRole, TruthLink};
use super::problem;
use super::provenance::{Provenance, leaks};
use super::resolver::{Resolver, Suspect};
use crate::node::Role;
use crate::time::Duration;

impl Resolver<'_> {
    /// Reports every feature that leaks.
    pub(super) fn find_leaks(&mut self) {
        for suspect in std::mem::take(&mut self.suspects) {
            let truth = self.provenance[suspect.link.slot].clone();
            let leak = suspect.features.iter().find_map(|&slot| {
                let (source, delay, late) = self.nearest(slot, &truth)?;
                let (lag, link) = (delay + suspect.lag, &suspect.link);
                leaks(lag - late, link.span, link.ahead).then_some((slot, source, lag, late))
            });
            let Some((slot, source, lag, late)) = leak else {
                continue;
            };
            let path = self.way(slot, source);
            let problem = self.leak((slot, suspect.lag), (lag, late), &suspect.link, path);
            let Suspect { place, context, .. } = suspect;
            self.diagnostics.report_in(context, place, problem);
        }
    }

    /// The measured channel that a slot shares with the truth and has with the smallest delay behind it: with the delays of both.
    fn nearest(&self, slot: usize, truth: &Provenance) -> Option<(usize, Duration, Duration)> {
        let sources = self.provenance[slot].sources();
        // A plan was known when it was read, whatever is made of it.
        let measured = sources.filter(|(source, _)| self.planned(*source).is_none());
        let shared =
            measured.filter_map(|(source, delay)| Some((source, delay, truth.delay_of(source)?)));
        shared.min_by_key(|(_, delay, late)| *delay - *late)
    }

    /// The problem of a slot that is read at a lag, behind its sources by `lag` in all, of a truth that is `late` behind them.
    pub(super) fn leak(
        &self,
        (slot, read_at): (usize, Duration),
        (lag, late): (Duration, Duration),
        link: &TruthLink,
        path: Vec<String>,
    ) -> problem::Leak {
        problem::Leak {
            regressor: self.regressor(slot, read_at, slot == link.slot).name,
            lag,
            truth: self.channels[link.slot].name.clone(),
            span: link.span,
            late,
            ahead: link.ahead,
            path,
        }
    }

    /// The channels from a slot back to a measured channel, along the smallest delay.
    fn way(&self, slot: usize, source: usize) -> Vec<String> {
        let mut way = vec![self.channels[slot].name.clone()];
        let mut at = slot;
        while at != source && way.len() <= self.channels.len() {
            let Some(delay) = self.provenance[at].delay_of(source) else {
                break;
            };
            let node = self.channels[at].node;
            let before = node.map_or_else(Vec::new, |node| self.parts(node, at));
            let mut next = before.into_iter().filter(|&(slot, own)| {
                let known = self.provenance[slot].delay_of(source);
                known.is_some_and(|known| known + own == delay)
            });
            let Some((slot, _)) = next.next() else { break };
            way.push(self.channels[slot].name.clone());
            at = slot;
        }
        way
    }

    /// What a slot of a node is made of: the slots that the node reads for it, and the truth that it learns from, with the delay at
    /// which each reaches it.
    fn parts(&self, node: usize, slot: usize) -> Vec<(usize, Duration)> {
        let node = &self.nodes[node];
        let entries = |gather: usize| &self.gathers[gather].entries;
        if let Role::Feature(feature) = node.spec.role() {
            let port = node.ports.iter().find(|(_, slots)| slots.contains(&slot));
            return port.map_or_else(Vec::new, |(name, slots)| {
                let inputs = self.inputs_of(node);
                feature
                    .reach(name)
                    .parts(&inputs, slot - slots.start, slots.len())
            });
        }
        let entries = node.role.inputs().flat_map(entries);
        let read = entries.map(|entry| (entry.slot, entry.lag));
        let learned = match &node.role {
            PlannedRole::Estimator { fit, learning, .. } if learning.is_some() => {
                Some(fit.truth.learned_from())
            }
            _ => None,
        };
        read.chain(learned).collect()
    }

    /// The slots that a feature reads as data, port by port.
    fn inputs_of(&self, node: &PlannedNode) -> Vec<Vec<usize>> {
        let slots = |gather: usize| {
            let entries = self.gathers[gather].entries.iter();
            let present = entries.filter(|entry| entry.lag.is_zero());
            present.map(|entry| entry.slot).collect()
        };
        node.role.inputs().map(slots).collect()
    }

    /// Takes into account what loops bring back, until that changes nothing.
    ///
    /// Delays only ever fall, and each is that of a path without a loop, so that it comes to an end.
    pub(super) fn follow_loops(&mut self) {
        let mut changed = true;
        while changed {
            changed = false;
            for node in 0..self.nodes.len() {
                let planned = &self.nodes[node];
                let behind = match planned.spec.role() {
                    Role::Feature(feature) => {
                        let ports = planned.ports.iter();
                        let widths = ports.map(|(name, slots)| (*name, slots.len()));
                        self.behind(feature, &self.inputs_of(planned), widths)
                    }
                    Role::Estimator(_) | Role::Combiner(_) => {
                        let parts = self.parts(node, planned.slots.start);
                        let parts = parts.iter();
                        let all = parts.map(|&(slot, lag)| (&self.provenance[slot], lag));
                        vec![Provenance::of(all); planned.slots.len()]
                    }
                };
                for (slot, behind) in self.nodes[node].slots.clone().zip(behind) {
                    let behind = behind.spanning(self.channels[slot].channel.span);
                    if self.provenance[slot] != behind {
                        self.provenance[slot] = behind;
                        changed = true;
                    }
                }
            }
        }
    }
}
