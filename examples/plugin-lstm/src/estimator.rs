//! The estimator: a network from the recent course of features to the truth.

use athermal_core::node::{
    Estimator, InputPort, Mistake, Predictor, Regressors, Trainer, TrainingSetup,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::fit::Fit;
use crate::learning::Learning;
use crate::network::MOST_UNITS;
use crate::sequence::Sequence;
use crate::training::Training;

/// Long short-term memory from the recent course of features to the truth.
///
/// With `z = (x_t, h_(t−1), 1)` of the standardised features: `i, f, o = σ(W z)`, `g = tanh(W z)`, `c_t = f c_(t−1) + i g`,
/// `h_t = o tanh(c_t)`, and the prediction `v·h_T + d` of the last step (Hochreiter and Schmidhuber 1997; forget gate of Gers
/// et al. 2000). Weights come from Adam (Kingma and Ba 2015) on the gradient of back-propagation through time.
///
/// Slopes of temperatures make good features: of temperatures themselves a network sees how warm it is rather than how it
/// changes. It can learn what a linear model cannot, needs more data for it, and knows nothing outside of what it has seen.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Lstm {
    /// What makes up a sequence, such as `{ steps = 12, every = "150s" }`.
    pub sequence: Sequence,
    /// How many units the network has, 1 to 64.
    #[serde(default = "twelve")]
    #[schemars(range(min = 1, max = 64))]
    pub units: usize,
    /// How it is trained.
    #[serde(default)]
    pub training: Training,
}

pub(crate) fn twelve() -> usize {
    12
}

/// What is out of range in parameters that both kinds have.
pub(crate) fn mistakes(sequence: &Sequence, units: usize, training: &Training) -> Vec<Mistake> {
    let mut mistakes = sequence.mistakes();
    if !(1..=MOST_UNITS).contains(&units) {
        let message = format!("`units` is {units} and must be from 1 to {MOST_UNITS}");
        mistakes.push(Mistake::at("units", message));
    }
    mistakes.extend(training.mistakes());
    mistakes
}

impl Estimator for Lstm {
    fn inputs() -> &'static [InputPort] {
        const {
            &[
                InputPort::held(
                    "features",
                    "what the sequence is made of, such as slopes of temperatures",
                ),
                InputPort::truth("what is predicted, such as the drift of an axis"),
            ]
        }
    }

    fn regressors(&self) -> Regressors {
        Regressors {
            feature_lags: self.sequence.lags(),
            ..Regressors::default()
        }
    }

    fn mistakes(&self) -> Vec<Mistake> {
        mistakes(&self.sequence, self.units, &self.training)
    }

    fn trainer(&self, setup: &TrainingSetup) -> Box<dyn Trainer> {
        let lags = self.sequence.lags();
        Box::new(Learning::new(
            self.training,
            self.units,
            &lags,
            setup,
            predictor,
        ))
    }
}

/// A fitted [`Lstm`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
struct FittedLstm(Fit);

pub(crate) fn predictor(fit: Fit) -> Box<dyn Predictor> {
    Box::new(FittedLstm(fit))
}

impl Predictor for FittedLstm {
    fn uses(&self) -> &[String] {
        &self.0.uses
    }

    fn mistakes(&self) -> Vec<Mistake> {
        self.0.mistakes()
    }

    fn predict(&self, regressors: &[f64]) -> f64 {
        self.0.predict(regressors)
    }
}

athermal_core::predictor!(FittedLstm, "lstm");

athermal_core::register!(Lstm, Estimator, "lstm");

#[cfg(test)]
mod tests {
    use athermal_core::prng::Prng;
    use athermal_testkit::Bench;

    use super::*;

    /// A feature that jumps every 10 s, and a truth that is twice what it was 20 s before, unless it has turned round since.
    fn rows() -> Vec<(f64, [f64; 2])> {
        let mut random = Prng::stream(11, "rows");
        let features: Vec<f64> = (0..1200).map(|_| random.between(-1.0, 1.0)).collect();
        let row = |tick: usize| {
            let (now, before) = (features[tick], features[tick.saturating_sub(2)]);
            let truth = if now * before > 0.0 {
                2.0 * before
            } else {
                0.0
            };
            (10.0 * tick as f64, [now, truth])
        };
        (0..features.len()).map(row).collect()
    }

    #[test]
    fn what_no_linear_model_of_the_past_finds_is_predicted() {
        let node = Lstm {
            sequence: Sequence {
                steps: 3,
                every: "10s".parse().unwrap(),
            },
            units: 8,
            training: Training {
                epochs: 150,
                patience: 30,
                rate: 0.02,
                ..Training::default()
            },
        };
        let rows = rows();
        let mut bench = Bench::of(&node)
            .input("features", 1, "K")
            .with("ahead = \"0s\"")
            .fitted_on(rows.iter().copied());
        bench.feed(
            rows.iter()
                .map(|&(at, [feature, _])| (at, [feature, f64::NAN])),
        );
        let predictions = bench.output("node.a");
        assert!(
            predictions[..2]
                .iter()
                .all(|prediction| prediction.is_nan())
        );
        let pairs = || rows.iter().zip(&predictions).skip(2);
        let mean_square = |of: &dyn Fn(f64, f64) -> f64| {
            let squares =
                pairs().map(|((_, [_, truth]), prediction)| of(*truth, *prediction).powi(2));
            squares.sum::<f64>() / pairs().count() as f64
        };
        let left = mean_square(&|truth, prediction| truth - prediction);
        let all = mean_square(&|truth, _| truth);
        // The best line through the value 20 s before explains half.
        assert!(left < 0.15 * all, "{left} of {all}");
    }
}
