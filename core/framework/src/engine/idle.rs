//! Decides how a node is asked for answers that nobody wants, to find out whether asking changes it.

use super::{Engine, Running};

impl Engine {
    /// Asks every estimator and combiner for answers to values that `value` draws.
    pub(crate) fn ask_idly(&self, value: &mut dyn FnMut() -> f64) {
        for node in &self.nodes {
            match node {
                Running::Operator { .. } => {}
                Running::Estimate { estimate, .. } => {
                    estimate
                        .iter()
                        .for_each(|estimate| estimate.ask_idly(value));
                }
                Running::Vote(vote) => {
                    let votes = self.gathered[vote.wires.voters].values.iter();
                    vote.ask_idly(votes.map(|_| value()).collect());
                }
            }
        }
    }
}
