//! The encoder: what a network remembers of the recent course of features, as features.

use athermal_core::channel::Channel;
use athermal_core::node::{
    Encoder, Feature, InputPort, Inputs, Mistake, Operator, OutputPort, Outputs, Predictor, Tick,
    Trainer, TrainingSetup,
};
use athermal_core::time::Duration;
use athermal_core::unit::Unit;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::estimator::mistakes;
use crate::fit::Fit;
use crate::learning::Learning;
use crate::network::MOST_UNITS;
use crate::sequence::Sequence;
use crate::training::Training;

/// What long short-term memory remembers of the recent course of features, as features for other estimators.
///
/// The network is that of `lstm`: it is fitted to predict the truth, and then gives `h_T`, what each unit shows at the end of
/// the sequence, a number between −1 and 1, in the channels `unit1`, `unit2` …. A linear estimator makes a prediction of them,
/// beside features of another origin; that is the encoder in the feature stage of the outlook of Mandelli, Dankwart and Napoli.
///
/// It gives nothing while a value of its sequence is absent.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LstmEncoder {
    /// What makes up a sequence, such as `{ steps = 12, every = "150s" }`.
    pub sequence: Sequence,
    /// How many units the network has, and so how many channels there are; 1 to 64.
    #[serde(default = "six")]
    #[schemars(range(min = 1, max = 64))]
    pub units: usize,
    /// How it is trained.
    #[serde(default)]
    pub training: Training,
}

fn six() -> usize {
    6
}

impl Feature for LstmEncoder {
    fn inputs() -> &'static [InputPort] {
        const {
            &[
                InputPort::held(
                    "features",
                    "what the sequence is made of, such as slopes of temperatures",
                ),
                InputPort::truth(
                    "what the network learns to predict, such as the drift of an axis",
                ),
            ]
        }
    }

    fn outputs(&self, inputs: &Inputs) -> Result<Vec<OutputPort>, Vec<Mistake>> {
        let mistakes = mistakes(&self.sequence, self.units, &self.training);
        if !mistakes.is_empty() {
            return Err(mistakes);
        }
        let from = inputs.port("features");
        let channel = |unit: usize| Channel {
            name: format!("unit{unit}"),
            unit: Unit::one(),
            span: from
                .iter()
                .map(|from| from.span)
                .max()
                .unwrap_or(Duration::ZERO),
            ahead: from
                .iter()
                .map(|from| from.ahead)
                .max()
                .unwrap_or(Duration::ZERO),
            max_age: from.iter().filter_map(|from| from.max_age).min(),
        };
        Ok(vec![OutputPort {
            name: "code",
            channels: (1..=self.units).map(channel).collect(),
        }])
    }

    fn encoder(&self) -> Option<&dyn Encoder> {
        Some(self)
    }

    fn build(&self, inputs: &Inputs, _wanted: &[bool]) -> Box<dyn Operator> {
        let fit = inputs.fit::<FittedEncoder>();
        let places = fit.map_or(&[][..], |(_, places)| places);
        Box::new(Encoding {
            fit: fit.map(|(fit, _)| fit.0.clone()),
            places: places.to_vec(),
            row: vec![f64::NAN; places.len()],
        })
    }
}

impl Encoder for LstmEncoder {
    fn lags(&self) -> Vec<Duration> {
        self.sequence.lags()
    }

    fn trainer(&self, setup: &TrainingSetup) -> Box<dyn Trainer> {
        let lags = self.sequence.lags();
        let finish = |fit| Box::new(FittedEncoder(fit)) as Box<dyn Predictor>;
        Box::new(Learning::new(
            self.training,
            self.units,
            &lags,
            setup,
            finish,
        ))
    }
}

/// What runs. It keeps no state: what is past is held for it by the framework.
struct Encoding {
    /// None where nothing has been fitted yet.
    fit: Option<Fit>,
    places: Vec<usize>,
    row: Vec<f64>,
}

impl Operator for Encoding {
    fn step(&mut self, tick: &Tick<'_>, outputs: &mut Outputs<'_>) {
        let values = tick.port(0);
        for (value, &place) in self.row.iter_mut().zip(&self.places) {
            *value = values[place];
        }
        let mut code = [f64::NAN; MOST_UNITS];
        if let Some(fit) = &self.fit
            && !self.row.iter().any(|value| value.is_nan())
        {
            fit.encode(&self.row, &mut code);
        }
        for (unit, &shown) in code.iter().take(outputs.len()).enumerate() {
            outputs.set(unit, shown);
        }
    }

    fn segment(&mut self) {}
}

/// A fitted [`LstmEncoder`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
struct FittedEncoder(Fit);

impl Predictor for FittedEncoder {
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

athermal_core::predictor!(FittedEncoder, "lstm_encoder");

athermal_core::register!(LstmEncoder, Feature, "lstm_encoder");

#[cfg(test)]
mod tests {
    use athermal_testkit::Bench;

    use super::*;

    #[test]
    fn it_shows_its_memory_and_nothing_while_a_step_is_absent() {
        let node = LstmEncoder {
            sequence: Sequence {
                steps: 3,
                every: "10s".parse().unwrap(),
            },
            units: 2,
            training: Training {
                epochs: 5,
                ..Training::default()
            },
        };
        let wave = |tick: usize| (tick as f64 / 7.0).sin();
        let rows = (0..200).map(|tick| (10.0 * tick as f64, [wave(tick), wave(tick + 3)]));
        let mut bench = Bench::of(&node)
            .input("features", 1, "K")
            .with("ahead = \"0s\"")
            .fitted_on(rows);
        // The value of tick 5 is absent, and a held value counts for 1 min: it is missed from when that has passed.
        let feature = |tick: usize| {
            if (5..14).contains(&tick) {
                f64::NAN
            } else {
                wave(tick)
            }
        };
        let fed = (0..30).map(|tick| (10.0 * tick as f64, [feature(tick), 1.0]));
        bench.feed(fed);
        let [one, two] = ["node.unit1", "node.unit2"].map(|unit| bench.output(unit));
        assert!(
            one.iter()
                .chain(&two)
                .all(|shown| shown.is_nan() || shown.abs() < 1.0)
        );
        let given: Vec<usize> = (0..30).filter(|&tick| !one[tick].is_nan()).collect();
        assert_eq!(given[..3], [2, 3, 4]);
        assert!(!given.contains(&12) && given.contains(&20), "{given:?}");
        assert_ne!(one[20], one[25]);
    }
}
