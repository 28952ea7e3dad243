//! State-space models of one output by subspace identification. Decides which states the past has and how they go on; does not
//! decide how far apart samples are, nor what they are of.

mod identify;
mod lagged;
mod model;
mod refine;
#[cfg(test)]
mod tests;

pub(crate) use lagged::pseudo_inverse_above;

pub use identify::{Identification, StateOrder, Subspace, Weighting};
pub use model::{DifferenceEquation, StateSpace};

/// Evenly spaced samples without a gap.
#[derive(Debug, Clone, Copy)]
pub struct Record<'a> {
    /// The inputs, those of one sample after the other.
    pub inputs: &'a [f64],
    /// The outputs.
    pub outputs: &'a [f64],
}

impl Record<'_> {
    fn len(&self) -> usize {
        self.outputs.len()
    }

    fn input(&self, sample: usize) -> &[f64] {
        let width = self.inputs.len() / self.outputs.len().max(1);
        &self.inputs[sample * width..(sample + 1) * width]
    }
}
