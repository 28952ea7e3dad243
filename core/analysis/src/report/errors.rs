//! How the errors of a prediction are summarised: their spread and how long they last.

use serde::Serialize;

use super::{Axis, Voter, rms};
use crate::diagnosis::residual::Residuals;

const BINS: usize = 41;

/// The errors of an axis: histogram and autocorrelation.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Errors {
    /// The axis.
    pub axis: String,
    /// Errors, prediction minus truth, that there are.
    pub count: usize,
    /// The middles of the bins of the histogram, in the unit of the axis.
    pub centres: Vec<f64>,
    /// How many errors lie in each; the outermost take what lies beyond.
    pub counts: Vec<f64>,
    /// What is left of the truth, one per window or horizon, and how long it lasts; none where nothing was measured.
    pub residuals: Option<Residuals>,
}

impl Axis {
    /// Prediction minus truth of what is put out, for each truth.
    #[must_use]
    pub fn errors(&self) -> Vec<f64> {
        self.errors_of(self.put_out())
    }

    /// The same of any prediction of it.
    pub(super) fn errors_of(&self, voter: &Voter) -> Vec<f64> {
        let pairs = voter.value.iter().zip(&self.truth.value);
        pairs.map(|(p, y)| p - y).collect()
    }
}

impl Errors {
    pub(super) fn of(axis: &Axis, residuals: &[Residuals]) -> Self {
        let errors = axis.errors();
        let present: Vec<f64> = errors.iter().copied().filter(|e| e.is_finite()).collect();
        let largest = present.iter().fold(0.0_f64, |edge, e| edge.max(e.abs()));
        // Nearly all errors are small, and a few large ones would leave them in one bin.
        let edge = largest
            .min(5.0 * rms(present.iter().copied()).unwrap_or(1.0))
            .max(1e-12);
        let width = 2.0 * edge / BINS as f64;
        let mut counts = vec![0.0; BINS];
        for error in &present {
            let bin = ((error + edge) / width).floor();
            counts[bin.clamp(0.0, BINS as f64 - 1.0) as usize] += 1.0;
        }
        Self {
            axis: axis.name.clone(),
            count: present.len(),
            centres: (0..BINS)
                .map(|bin| (bin as f64 + 0.5) * width - edge)
                .collect(),
            counts,
            residuals: residuals
                .iter()
                .find(|of| of.prediction == axis.put_out().prediction)
                .cloned(),
        }
    }
}
