//! Decides which features see the future: those that are made of what the truth is made of, too little delayed.
//!
//! It looks at the graph once all of it is known, since feedback through a delay brings what comes later in the order.

use super::plan::{PlannedRole, TruthLink};
use super::problem::CompileProblem;
use super::provenance::{Provenance, leaks};
use super::resolver::Resolver;
use crate::diagnostic::Place;
use crate::node::Role;
use crate::time::Duration;

/// Features of an estimator that are still to be looked at.
#[derive(Debug)]
pub(super) struct Suspect {
    pub(super) place: Place,
    pub(super) context: String,
    /// The slots that are read.
    pub(super) features: Vec<usize>,
    /// The lag at which they are read.
    pub(super) lag: Duration,
    /// The truth that is predicted.
    pub(super) link: TruthLink,
}

impl Resolver<'_> {
    /// Reports every feature that leaks.
    pub(super) fn find_leaks(&mut self) {
        for suspect in std::mem::take(&mut self.suspects) {
            let truth = self.provenance[suspect.link.slot].clone();
            let leak = suspect.features.iter().find_map(|&slot| {
                let (source, delay) = self.nearest(slot, &truth)?;
                let lag = delay + suspect.lag;
                leaks(lag, suspect.link.span, suspect.link.ahead).then_some((slot, source, lag))
            });
            let Some((slot, source, lag)) = leak else {
                continue;
            };
            let path = self.way(slot, source);
            let problem = self.leak(slot, lag, &suspect.link, path);
            let Suspect { place, context, .. } = suspect;
            self.diagnostics.report_in(context, place, problem);
        }
    }

    /// The measured channel that a slot shares with the truth and has with the smallest delay.
    fn nearest(&self, slot: usize, truth: &Provenance) -> Option<(usize, Duration)> {
        let sources = self.provenance[slot].sources();
        let shared = sources.filter(|(source, _)| truth.delay_of(*source).is_some());
        shared.min_by_key(|(_, delay)| *delay)
    }

    pub(super) fn leak(
        &self,
        slot: usize,
        lag: Duration,
        link: &TruthLink,
        path: Vec<String>,
    ) -> CompileProblem {
        CompileProblem::Leak {
            regressor: self.regressor(slot, lag, slot == link.slot).name,
            lag,
            truth: self.channels[link.slot].name.clone(),
            span: link.span,
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
            let before = self.channels[at]
                .node
                .into_iter()
                .flat_map(|node| self.parts(node));
            let mut next = before.filter(|&(slot, own)| {
                let known = self.provenance[slot].delay_of(source);
                known.is_some_and(|known| known + own == delay)
            });
            let Some((slot, _)) = next.next() else { break };
            way.push(self.channels[slot].name.clone());
            at = slot;
        }
        way
    }

    /// What a node reads as data, with the delay at which that reaches its outputs.
    fn parts(&self, node: usize) -> Vec<(usize, Duration)> {
        let node = &self.nodes[node];
        let own = match node.spec.role() {
            Role::Feature(feature) => feature.delay(),
            Role::Estimator(_) | Role::Combiner(_) => Duration::ZERO,
        };
        let entries = node
            .role
            .gathers()
            .iter()
            .flat_map(|&gather| &self.gathers[gather].entries);
        entries.map(|entry| (entry.slot, entry.lag + own)).collect()
    }

    /// Takes into account what loops bring back, until that changes nothing.
    ///
    /// Delays only ever fall, and each is that of a path without a loop, so that it comes to an end.
    pub(super) fn follow_loops(&mut self) {
        let mut changed = true;
        while changed {
            changed = false;
            for node in 0..self.nodes.len() {
                let parts = self.parts(node);
                let ports: Vec<_> = self.nodes[node]
                    .ports
                    .iter()
                    .map(|(_, s)| s.len())
                    .collect();
                let behind = match &self.nodes[node].role {
                    PlannedRole::Feature { .. } => {
                        let delay = parts.first().map_or(Duration::ZERO, |(_, delay)| *delay);
                        let slots: Vec<_> = parts.iter().map(|(slot, _)| *slot).collect();
                        self.behind(&slots, ports.into_iter(), delay)
                    }
                    PlannedRole::Estimator { .. } | PlannedRole::Combiner { .. } => {
                        let parts = parts.iter();
                        let all = parts.map(|&(slot, lag)| (&self.provenance[slot], lag));
                        vec![Provenance::of(all)]
                    }
                };
                for (slot, behind) in self.nodes[node].slots.clone().zip(behind) {
                    if self.provenance[slot] != behind {
                        self.provenance[slot] = behind;
                        changed = true;
                    }
                }
            }
        }
    }
}
