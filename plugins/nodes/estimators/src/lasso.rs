//! The estimator that leaves features out by the size of their coefficients.

use athermal_core::node::{Estimator, InputPort, Mistake, Regressors, Trainer, TrainingSetup};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::elastic_net::{SparsePenalty, SparseTrainer};
use crate::features::{FEATURES_AND_TRUTH, present_features, too_many};

/// Linear regression of the truth on features that leaves out those it can do without.
///
/// Minimises `1/(2n) Σ(y − ŷ)² + α Σ|w_j|` over the coefficients `w`, the intercept free, with features and truth standardised
/// (Tibshirani 1996), so that `α` means the same in all units. Note that `α` stands against the *mean* of squares, that of ridge against their sum.
///
/// The port `novelty` shows how far the features are outside of those of the fit, as that of `linear` does.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Lasso {
    /// The penalty, at least 0; or a table such as `{ folds = 5 }`, and the best of a range is chosen by cross-validation.
    #[serde(default)]
    pub alpha: SparsePenalty,
}

impl Estimator for Lasso {
    fn inputs() -> &'static [InputPort] {
        FEATURES_AND_TRUTH
    }

    fn regressors(&self) -> Regressors {
        present_features()
    }

    fn has_novelty(&self) -> bool {
        true
    }

    fn mistakes_for(&self, features: usize) -> Vec<Mistake> {
        too_many(features, 1)
    }

    fn trainer(&self, setup: &TrainingSetup) -> Box<dyn Trainer> {
        Box::new(SparseTrainer::new(setup, self.alpha, 1.0))
    }
}

athermal_core::register!(Lasso, Estimator, "lasso");
