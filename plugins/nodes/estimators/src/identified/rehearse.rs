//! Decides how far an identified model is off on the rows of its fit when it predicts them as it does beside a machine; not how it
//! is followed.

use std::collections::VecDeque;

use athermal_core::node::{LearningGate, LearningLimits, Predictor};
use athermal_core::time::{Duration, Instant};

use super::model::Identified;
use super::rows::Rows;

/// What lies between a prediction, its run and the truths that it may know of.
#[derive(Debug, Clone, Copy)]
pub(super) struct Reach {
    /// How far ahead of a run that is.
    pub(super) ahead: Duration,
    /// How much earlier than what is predicted the newest truth arrived.
    pub(super) earlier: Duration,
    /// Whether the model will follow truths while it runs.
    pub(super) follows: bool,
    /// The span of the truth.
    pub(super) window: Duration,
    /// Which truths it will not follow.
    pub(super) limits: LearningLimits,
}

/// The root mean square error, the horizon ahead and from the truths that the embargo lets through; none where no row is predicted.
pub(super) fn error(rows: &Rows, of: &Identified, reach: Reach) -> Option<f64> {
    let mut following = of.learner()?;
    let mut gate = LearningGate::new(reach.limits, reach.window, &mut *following);
    let mut withheld = VecDeque::new();
    let (mut squares, mut count) = (0.0, 0_u64);
    let mut first = Instant::MIN;
    for seen in rows.all() {
        if seen.begins {
            // What was withheld moves nothing any more but how large an error is for an outlier.
            for (at, inputs, truth) in withheld.drain(..) {
                gate.offer(&mut *following, of, inputs, truth, at);
            }
            following.segment(Duration::ZERO);
            first = seen.of + reach.ahead;
        }
        // Without inputs rows are truths, of which the first ones come before what the first run predicts.
        if seen.inputs.is_empty() && seen.of < first {
            continue;
        }
        let newest = seen.of - reach.earlier;
        while let Some(&(at, inputs, truth)) = withheld.front()
            && at <= newest
        {
            gate.offer(&mut *following, of, inputs, truth, at);
            withheld.pop_front();
        }
        following.run(seen.inputs, seen.of, newest);
        let Some(truth) = seen.truth else {
            continue;
        };
        let predicted = if reach.follows {
            following.predict(seen.inputs, seen.of)
        } else {
            of.predict(seen.inputs)
        };
        if !predicted.is_nan() {
            squares += (predicted - truth).powi(2);
            count += 1;
        }
        withheld.push_back((seen.of, seen.inputs, truth));
    }
    (count > 0).then(|| (squares / count as f64).sqrt())
}
