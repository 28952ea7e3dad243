//! What can go wrong with an engine.

use thiserror::Error;

use crate::time::Instant;

/// Why an engine cannot be built, or refuses a tick.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum EngineError {
    /// A tick that is not after the last one. The engine is as it was.
    #[error(
        "the tick at {time} s is not after the last one at {last} s: ticks must come in the order of time"
    )]
    NotAfter {
        /// The instant refused.
        time: Instant,
        /// The last instant taken.
        last: Instant,
    },
    /// A row with another number of values than the plan has channels.
    #[error("{found} values were given and the graph has {expected} measured channels")]
    WrongWidth {
        /// Values given.
        found: usize,
        /// Channels of the plan.
        expected: usize,
    },
    /// A fitted estimator uses a regressor that its node does not have.
    #[error(
        "the fit of `{node}` uses `{regressor}`, which the node does not have (it has {}): fit the graph again",
        known.join(", ")
    )]
    UnknownRegressor {
        /// The node.
        node: String,
        /// The regressor that is missing.
        regressor: String,
        /// The regressors that the node has.
        known: Vec<String>,
    },
    /// A node that is to learn while it runs, with a fit that stays as it is.
    #[error(
        "`{node}` is to learn while it runs, and its fit was not made for that: fit the graph again"
    )]
    DoesNotLearn {
        /// The node.
        node: String,
    },
    /// A node that is to learn while it runs, of a kind that needs no fit and gives nothing that learns: a mistake of the kind.
    #[error(
        "`{node}` is to learn while it runs, and its kind gives nothing that does, which is a mistake of its own: for {author}: \
         `Predictor::learner` gives a learner, or `Estimator::learns` is `Never`; until then `learn = false` does without"
    )]
    NoLearner {
        /// The node.
        node: String,
        /// Whom that is for.
        author: String,
    },
    /// Something fitted for a node of this graph that needs no fit, or for none.
    #[error(
        "the model has a fit for `{node}`, which is no node of its graph that is fitted: fit the graph again"
    )]
    NotAnEstimator {
        /// The node.
        node: String,
    },
}
