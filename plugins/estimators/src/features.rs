//! What estimators ask for that predict from features as they are now.

use athermal_core::node::{InputPort, Regressors};
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

/// The features as they are now.
pub(crate) fn present_features() -> Regressors {
    Regressors {
        feature_lags: vec![Duration::ZERO],
        ..Regressors::default()
    }
}
