//! What can go wrong with an engine.

use std::fmt;

use crate::time::Instant;

/// Why an engine cannot be built, or refuses a tick.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum EngineError {
    /// A tick that is not after the last one. The engine is as it was.
    NotAfter {
        /// The instant refused.
        time: Instant,
        /// The last instant taken.
        last: Instant,
    },
    /// A row with another number of values than the plan has channels.
    WrongWidth {
        /// Values given.
        found: usize,
        /// Channels of the plan.
        expected: usize,
    },
    /// A fitted estimator uses a regressor that its node does not have.
    UnknownRegressor {
        /// The node.
        node: String,
        /// The regressor that is missing.
        regressor: String,
        /// The regressors that the node has.
        known: Vec<String>,
    },
    /// A node that is to learn while it runs, with a fit that stays as it is.
    DoesNotLearn {
        /// The node.
        node: String,
    },
    /// A node that is to learn while it runs, of a kind that needs no fit and gives nothing that learns: a mistake of the kind.
    NoLearner {
        /// The node.
        node: String,
        /// Whom that is for.
        author: String,
    },
    /// Something fitted for a node of this graph that needs no fit, or for none.
    NotAnEstimator {
        /// The node.
        node: String,
    },
}

impl fmt::Display for EngineError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotAfter { time, last } => write!(
                f,
                "the tick at {time} s is not after the last one at {last} s: ticks must come in the order of time"
            ),
            Self::WrongWidth { found, expected } => {
                write!(
                    f,
                    "{found} values were given and the graph has {expected} measured channels"
                )
            }
            Self::UnknownRegressor {
                node,
                regressor,
                known,
            } => write!(
                f,
                "the fit of `{node}` uses `{regressor}`, which the node does not have (it has {}): fit the graph again",
                known.join(", ")
            ),
            Self::DoesNotLearn { node } => write!(
                f,
                "`{node}` is to learn while it runs, and its fit was not made for that: fit the graph again"
            ),
            Self::NoLearner { node, author } => write!(
                f,
                "`{node}` is to learn while it runs, and its kind gives nothing that does, which is a mistake of its own: for {author}: \
                 `Predictor::learner` gives a learner, or `Estimator::learns` is `Never`; until then `learn = false` does without"
            ),
            Self::NotAnEstimator { node } => {
                write!(
                    f,
                    "the model has a fit for `{node}`, which is no node of its graph that is fitted: fit the graph again"
                )
            }
        }
    }
}

impl std::error::Error for EngineError {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_that_are_a_nanosecond_apart_have_different_texts() {
        let now = Instant::from_ns(1_700_000_000_123_456_789);
        let (time, last) = (now, Instant::from_ns(now.as_ns() + 1));
        let text = EngineError::NotAfter { time, last }.to_string();
        let at =
            "the tick at 1700000000.123456789 s is not after the last one at 1700000000.12345679 s";
        assert!(text.starts_with(at), "{text}");
    }
}
