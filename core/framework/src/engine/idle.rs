//! Decides how a node is asked for answers that nobody wants, to find out whether asking changes it.

use super::{Engine, Running};
use crate::compile::PlannedRole;

impl Engine {
    /// Asks every estimator and combiner for answers to values that `value` draws.
    pub(crate) fn ask_idly(&self, value: &mut dyn FnMut() -> f64) {
        for (node, planned) in self.nodes.iter().zip(&self.plan.nodes) {
            match (node, &planned.role) {
                (Running::Estimate { estimate, .. }, _) => {
                    estimate
                        .iter()
                        .for_each(|estimate| estimate.ask_idly(value));
                }
                (Running::Vote(vote), PlannedRole::Combiner { voters, .. }) => {
                    let votes = self.gathered[*voters].values.iter().map(|_| value());
                    vote.ask_idly(votes.collect());
                }
                _ => {}
            }
        }
    }
}
