//! What an identified model consists of; not how it is reported, nor how it is followed.

use athermal_core::node::numbers;
use athermal_core::time::Duration;
use athermal_numerics::{Beginning, Novelty, Polynomials};
use serde::{Deserialize, Serialize};

use crate::scaling::Scaling;

/// The most interleaved series.
pub(super) const MOST_SERIES: usize = 16;
/// How often the noise is integrated at most.
pub(super) const MOST_DIFFERENCES: usize = 2;

/// A model as it was identified.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Identified {
    pub(super) regressors: Vec<String>,
    pub(super) scaling: Scaling,
    /// On scaled inputs, in the unit of the truth.
    pub(super) model: Polynomials,
    /// The standard error of each coefficient, in its place; of a polynomial that has none, an empty list.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) errors: Option<Polynomials>,
    /// Whether the level is the mean of the rows of the fit, which do not tell it, so that it has no standard error.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub(super) mean_level: bool,
    pub(super) step: Duration,
    /// How many truths come within a step.
    pub(super) series: usize,
    /// The standard deviation of a prediction one step after the newest truth, two steps and so on.
    #[serde(with = "numbers")]
    pub(super) deviations: Vec<f64>,
    /// Where the filter of each input begins in a run, on scaled inputs, in the unit of the truth; nothing where at rest.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) beginnings: Vec<Beginning>,
    /// How far inputs are from those of the rows of the fit, where these say so.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) novelty: Option<Novelty>,
}

impl Identified {
    /// What is predicted where the inputs have always been like that and nothing is known of truths.
    pub(super) fn at_rest(&self, regressors: &[f64]) -> f64 {
        self.model.at_rest(self.scaling.of(regressors))
    }
}

/// A model that sums its input up, nearly.
#[cfg(test)]
pub(super) fn identified(step: Duration) -> Identified {
    Identified {
        beginnings: Vec::new(),
        regressors: vec!["input".to_owned()],
        scaling: Scaling {
            means: vec![0.0],
            scales: vec![1.0],
            truth: 0.0,
        },
        model: Polynomials {
            a: vec![-0.9995],
            inputs: vec![athermal_numerics::Transfer {
                delay: 0,
                b: vec![0.1],
                f: Vec::new(),
            }],
            c: Vec::new(),
            d: Vec::new(),
            differences: 0,
            level: 0.0,
        },
        errors: None,
        mean_level: false,
        step,
        series: 1,
        deviations: vec![1.0],
        novelty: None,
    }
}
