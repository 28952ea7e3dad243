//! The plain average of votes.

use athermal_core::node::{Combine, Combiner, InputPort, Votes};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The mean of the votes that are there. The port `weights` shows an equal one for each of them.
///
/// `ŷ = Σ ŷ_i / n`. Where all voters have a standard deviation, the port `std_dev` is that of their mixture, as of
/// `auto_weighted`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Mean {}

impl Combiner for Mean {
    fn inputs() -> &'static [InputPort] {
        const { &[InputPort::held("voters", "predictions of the same truth")] }
    }

    fn has_weights(&self) -> bool {
        true
    }

    fn build(&self, _voters: usize) -> Box<dyn Combine> {
        Box::new(Average)
    }
}

/// The mean of the votes that are there; NaN where there is none.
pub(crate) fn mean(votes: Votes<'_>) -> f64 {
    let (sum, count) = votes.present().fold((0.0, 0.0), |(sum, count), (_, vote)| {
        (sum + vote, count + 1.0)
    });
    if count > 0.0 { sum / count } else { f64::NAN }
}

/// Gives each vote that is there what it counts in the mean.
pub(crate) fn equal(votes: Votes<'_>, weights: &mut [f64]) {
    let count = votes.present().count() as f64;
    for (voter, _) in votes.present() {
        weights[voter] = 1.0 / count;
    }
}

struct Average;

impl Combine for Average {
    fn combine(&self, votes: Votes<'_>) -> f64 {
        mean(votes)
    }

    fn weights(&self, votes: Votes<'_>, weights: &mut [f64]) {
        equal(votes, weights);
    }
}

athermal_core::register!(Mean, Combiner, "mean");

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn absent_voters_drop_out_of_the_mean() {
        assert_eq!(Average.combine(Votes(&[1.0, f64::NAN, 4.0])), 2.5);
        assert!(Average.combine(Votes(&[f64::NAN])).is_nan());
        let mut weights = [f64::NAN; 3];
        Average.weights(Votes(&[1.0, f64::NAN, 4.0]), &mut weights);
        assert!(weights[0] == 0.5 && weights[1].is_nan() && weights[2] == 0.5);
    }
}
