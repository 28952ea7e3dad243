//! A combiner of athermal: a mean of votes that weighs each by how close its voter has been.

use athermal_core::node::prelude::*;

/// The mean of the votes, each weighed by how close its voter has been lately.
///
/// A voter counts by `1 / e`, where `e` is its absolute error, smoothed: `e ← (1 − pace) e + pace |vote − truth|`. A voter
/// of which no error is known counts like the mean of the others. The framework hands over only truths that
/// the embargo lets through.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MyNode {
    /// How fast errors are forgotten, above 0 (never) to 1 (only the last one counts).
    #[serde(default = "tenth")]
    #[schemars(range(max = 1.0), extend("exclusiveMinimum" = 0.0))]
    pub pace: f64,
}

fn tenth() -> f64 {
    0.1
}

impl Combiner for MyNode {
    fn inputs() -> &'static [InputPort] {
        const {
            &[
                InputPort::held("voters", "predictions of the same truth"),
                InputPort::truth("what the voters predict, for their errors"),
            ]
        }
    }

    fn is_endless(&self) -> bool {
        // So many truths take as long as they please. What counts for a time instead says so in `memory`.
        true
    }

    fn build(&self, voters: usize) -> Box<dyn Combine> {
        Box::new(Weighing {
            pace: self.pace,
            errors: vec![f64::NAN; voters],
        })
    }
}

/// What runs.
struct Weighing {
    pace: f64,
    /// The smoothed error of each voter; NaN while none is known.
    errors: Vec<f64>,
}

impl Weighing {
    fn weight(&self, voter: usize) -> Option<f64> {
        let error = self.errors[voter];
        // An error of exactly zero counts as a very small one.
        error.is_finite().then(|| 1.0 / error.max(1e-150))
    }
}

impl Combine for Weighing {
    fn combine(&self, votes: Votes<'_>) -> f64 {
        let known = || votes.present().filter_map(|(voter, _)| self.weight(voter));
        let count = known().count();
        let unknown = if count > 0 {
            known().sum::<f64>() / count as f64
        } else {
            1.0
        };
        let weighed = votes
            .present()
            .map(|(voter, vote)| (self.weight(voter).unwrap_or(unknown), vote));
        let (sum, weights) = weighed.fold((0.0, 0.0), |(sum, weights), (weight, vote)| {
            (sum + weight * vote, weights + weight)
        });
        sum / weights
    }

    fn observe(&mut self, votes: Votes<'_>, truth: f64, _arrived: Instant) {
        for (voter, vote) in votes.present() {
            let (known, error) = (self.errors[voter], (vote - truth).abs());
            let smoothed = known + self.pace * (error - known);
            self.errors[voter] = if smoothed.is_finite() {
                smoothed
            } else {
                error
            };
        }
    }

    fn snapshot(&self) -> Option<Box<dyn State>> {
        Some(Box::new(Errors {
            errors: self.errors.clone(),
        }))
    }

    fn restore(&mut self, state: Box<dyn State>) -> Restored {
        state.accept(|state: Errors| {
            let fits = state.errors.len() == self.errors.len();
            fits.then(|| self.errors = state.errors)
                .ok_or("the number of voters differs")
        })
    }
}

/// The state. Give it another name, "my_node/2", when its form changes, and keep this one to be read.
#[derive(Debug, Serialize, Deserialize)]
struct Errors {
    errors: Vec<f64>,
}

athermal_core::state!(Errors, "my_node/1");
athermal_core::register!(MyNode, Combiner, "my_node");

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whoever_was_closer_counts_more() {
        let mut weighing = Weighing {
            pace: 1.0,
            errors: vec![f64::NAN; 2],
        };
        assert_eq!(weighing.combine(Votes(&[1.0, 5.0])), 3.0);
        weighing.observe(Votes(&[1.0, 5.0]), 2.0, Instant::from_ns(0));
        // Errors of 1 and 3: weights of 3/4 and 1/4.
        assert_eq!(weighing.combine(Votes(&[1.0, 5.0])), 2.0);
        assert_eq!(weighing.combine(Votes(&[f64::NAN, 5.0])), 5.0);
    }
}
