//! What estimators ask for that predict from features as they are now.

use athermal_core::node::{InputPort, Mistake, Regressors};
use athermal_core::time::Duration;

/// The features.
pub(crate) const FEATURES: InputPort = InputPort::held(
    "features",
    "what the prediction is made of, such as slopes of temperatures",
);

/// What is predicted from them.
pub(crate) const TRUTH: InputPort =
    InputPort::truth("what is predicted, such as the drift of an axis");

/// The ports of estimators that do not learn while they run.
pub(crate) const FEATURES_AND_TRUTH: &[InputPort] = &[FEATURES, TRUTH];

/// The most regressors of features of estimators that keep, or solve for, the products of each with each.
const MOST_REGRESSORS: usize = 4_000;

/// What is wrong with so many features at so many lags.
pub(crate) fn too_many(features: usize, lags: usize) -> Vec<Mistake> {
    too_many_at("inputs.features", features, lags)
}

/// What is wrong with so many channels of an input at so many lags: there is no room for the products of each with each.
pub(crate) fn too_many_at(input: &str, channels: usize, lags: usize) -> Vec<Mistake> {
    let count = channels.saturating_mul(lags);
    if count <= MOST_REGRESSORS {
        return Vec::new();
    }
    let message = format!(
        "it would learn from {count} regressors, more than the {MOST_REGRESSORS} that there is room for"
    );
    let help = "give it fewer features or lags: a `pick` passes on some channels of a node";
    vec![Mistake::at(input, message).help(help)]
}

/// The features as they are now.
pub(crate) fn present_features() -> Regressors {
    Regressors {
        feature_lags: vec![Duration::ZERO],
        ..Regressors::default()
    }
}
