//! Asks nodes for answers that nobody uses, to find out what they are and whether asking changes the node.

use super::Engine;
use super::tick::NodeRunner;

/// What a combiner makes of votes.
#[derive(Debug)]
pub struct Answer {
    /// The combined prediction; NaN where there is none.
    pub combined: f64,
    /// NaN for each vote where it does not weigh.
    pub weights: Vec<f64>,
    /// Both ends, NaN where there is none.
    pub interval: [f64; 2],
}

impl Engine {
    /// Asks every estimator and combiner for answers to values that `value` draws.
    pub fn ask_idly(&self, value: &mut dyn FnMut() -> f64) {
        for node in &self.nodes {
            match node {
                NodeRunner::Operator(_) => {}
                NodeRunner::Estimate(node) => {
                    node.estimate.iter().for_each(|of| of.ask_idly(value));
                }
                NodeRunner::Vote(vote) => {
                    let votes = self.gathered[vote.wires.voters].values.iter();
                    let mut votes: Vec<f64> = votes.map(|_| value()).collect();
                    vote.answer(&votes);
                    if let Some(first) = votes.first_mut() {
                        *first = f64::NAN;
                    }
                    vote.answer(&votes);
                }
            }
        }
    }

    /// What the only combiner would make of votes; none where there is no combiner.
    pub fn answer(&self, votes: &[f64]) -> Option<Answer> {
        self.nodes.iter().find_map(|node| match node {
            NodeRunner::Vote(vote) => Some(vote.answer(votes)),
            NodeRunner::Operator(_) | NodeRunner::Estimate(_) => None,
        })
    }
}
