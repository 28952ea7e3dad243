//! What becomes of predictions from regressors outside of the rows of the fit.

use std::sync::Arc;

use crate::channel::unless_infinite;
use crate::compile::Outside;
use crate::node::Predictor;

/// The edge of the rows of a fit, and what its predictions become beyond.
#[derive(Debug, Clone)]
pub(crate) struct Edge {
    predictor: Arc<dyn Predictor>,
    outside: Outside,
    /// What no model would predict.
    centre: f64,
}

impl Edge {
    pub(crate) fn new(predictor: &Arc<dyn Predictor>, outside: Outside) -> Self {
        Self {
            centre: predictor.centre(),
            predictor: Arc::clone(predictor),
            outside,
        }
    }

    /// How far a row is outside, 1 at the edge; NaN where that is not known.
    #[inline]
    pub(crate) fn novelty(&self, row: &[f64]) -> f64 {
        unless_infinite(self.predictor.novelty(row))
    }

    /// What a prediction becomes at a novelty: the same to the bit up to the edge.
    #[inline]
    pub(crate) fn bounded(&self, prediction: f64, novelty: f64) -> f64 {
        if novelty > 1.0 {
            match self.outside {
                Outside::Pass => prediction,
                Outside::Absent => f64::NAN,
                Outside::Shrink => self.centre + (prediction - self.centre) / novelty,
            }
        } else {
            prediction
        }
    }

    /// The standard deviation of the truth about what a prediction has become at a novelty, from that about the prediction `ŷ` of the
    /// fit: `√((ν σ)² + (ŷ − ŷ′)²)` where it has shrunk to `ŷ′`.
    pub(crate) fn widened(&self, std_dev: f64, bounded: f64, novelty: f64) -> f64 {
        if novelty > 1.0 && self.outside == Outside::Shrink {
            let moved = (bounded - self.centre) * (novelty - 1.0);
            ((novelty * std_dev).powi(2) + moved * moved).sqrt()
        } else {
            std_dev
        }
    }
}
