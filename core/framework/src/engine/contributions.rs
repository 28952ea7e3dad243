//! What a prediction of this tick is made of, regressor by regressor and voter by voter.

use super::Engine;
use super::tick::{Estimate, NodeRunner};
use crate::compile::PlannedRole;

/// A part of a prediction. All parts add up to it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Contribution {
    /// The node that gave it: an estimator, or a combiner for what its voters do not explain.
    pub node: usize,
    /// What the node weighs in the prediction.
    pub weight: f64,
    /// The slot of the regressor that it is by; none of a constant, or of what is no linear form.
    pub regressor: Option<usize>,
    /// In the unit of the prediction.
    pub value: f64,
}

impl Engine {
    /// What the value of a slot at this tick is made of, where it is that of an estimator or a combiner that ran; none otherwise.
    ///
    /// A linear form `constant + Σ b_j x_j` has a part for each regressor. Of votes that are weighed each part is multiplied by its weight;
    /// what is not known, such as of weights that nobody [looks at](crate::compile::Plan::looked_into), is a part of the node itself.
    #[must_use]
    pub fn contributions(&self, slot: usize) -> Option<Vec<Contribution>> {
        let node = self.plan.channels[slot].node?;
        let value = self.slots.now(slot);
        if value.is_nan() || self.plan.nodes[node].slots.start != slot {
            return None;
        }
        let mut parts = match (&self.nodes[node], &self.plan.nodes[node].role) {
            (NodeRunner::Estimate(of), _) => of
                .estimate
                .as_ref()
                .map_or_else(Vec::new, |of| self.of_form(node, of)),
            (NodeRunner::Vote(_), PlannedRole::Combiner { voters, beside, .. }) => beside
                .weights
                .map_or_else(Vec::new, |first| self.of_votes(*voters, first)),
            _ => return None,
        };
        let known: f64 = parts.iter().map(|of| of.value).sum();
        if value != known {
            parts.push(Contribution {
                node,
                weight: 1.0,
                regressor: None,
                value: value - known,
            });
        }
        Some(parts)
    }

    fn of_form(&self, node: usize, of: &Estimate) -> Vec<Contribution> {
        let mut row = vec![f64::NAN; of.width()];
        let mut rest = &mut row[..];
        for part in of.parts() {
            let (piece, after) = rest.split_at_mut(part.len());
            rest = after;
            let _ = part.read(&self.gathered, piece);
        }
        let entries = of
            .parts()
            .iter()
            .flat_map(|part| part.entries(&self.plan.gathers));
        let Some(form) = of.linear() else {
            return Vec::new();
        };
        let part = |regressor, value| Contribution {
            node,
            weight: 1.0,
            regressor,
            value,
        };
        let terms = form.coefficients.iter().zip(&row).zip(entries);
        let terms = terms.map(|((b, x), entry)| part(Some(entry.slot), b * x));
        let constant = part(None, form.constant);
        // Where a value is lacking, the form is not what was predicted.
        let all = std::iter::once(constant).chain(terms);
        all.filter(|of| of.value.is_finite() && of.value != 0.0)
            .collect()
    }

    fn of_votes(&self, gather: usize, first: usize) -> Vec<Contribution> {
        let entries = self.plan.gathers[gather].entries.iter().enumerate();
        let mut all = Vec::new();
        for (nth, entry) in entries {
            let (weight, vote) = (
                self.slots.now(first + nth),
                self.gathered[gather].values[nth],
            );
            if weight.is_nan() || weight == 0.0 || vote.is_nan() {
                continue;
            }
            let own = self.slots.now(entry.slot);
            let parts = self.contributions(entry.slot).filter(|_| own != 0.0);
            match (parts, self.plan.channels[entry.slot].node) {
                // In the unit of the vote, and not one that is held from before.
                (Some(parts), _) => all.extend(parts.into_iter().map(|part| Contribution {
                    weight: weight * part.weight,
                    value: weight * part.value * (vote / own),
                    ..part
                })),
                (None, Some(node)) => all.push(Contribution {
                    node,
                    weight,
                    regressor: None,
                    value: weight * vote,
                }),
                (None, None) => {}
            }
        }
        all
    }
}
