//! What becomes of predictions from regressors outside of the rows of the fit.

use crate::compile::Outside;

/// What predictions become beyond the edge of the rows of a fit.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Edge {
    outside: Outside,
}

impl Edge {
    pub(crate) fn new(outside: Outside) -> Self {
        Self { outside }
    }

    /// What a prediction becomes at a novelty: the same to the bit up to the edge. The centre is what is predicted in the middle of the
    /// rows of the fit.
    #[inline]
    pub(crate) fn bounded(
        self,
        prediction: f64,
        novelty: f64,
        centre: impl FnOnce() -> f64,
    ) -> f64 {
        if novelty > 1.0 {
            match self.outside {
                Outside::Pass => prediction,
                Outside::Absent => f64::NAN,
                Outside::Shrink => {
                    let centre = centre();
                    centre + (prediction - centre) / novelty
                }
            }
        } else {
            prediction
        }
    }

    /// The standard deviation of the truth about what a prediction has become at a novelty, from that about the prediction `ŷ` of the
    /// fit: `√((ν σ)² + (ŷ − ŷ′)²)` where it has shrunk to `ŷ′`.
    pub(crate) fn widened(
        self,
        std_dev: f64,
        bounded: f64,
        novelty: f64,
        centre: impl FnOnce() -> f64,
    ) -> f64 {
        if novelty > 1.0 && self.outside == Outside::Shrink {
            let moved = (bounded - centre()) * (novelty - 1.0);
            ((novelty * std_dev).powi(2) + moved * moved).sqrt()
        } else {
            std_dev
        }
    }
}
