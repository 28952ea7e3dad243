//! The baseline "it goes on as it did".

use athermal_core::node::{
    Coefficients, Estimator, Factor, InputPort, Mistake, Of, Predictor, Regressors, Term, Trained,
    Trainer, TrainingError, TrainingReport, TrainingSetup, TruthLags,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Predicts the last truth that shares nothing with the predicted one: the truth at the smallest legal lag.
///
/// `ŷ(t + ahead) = y(t − L)`, with `L` that lag. It needs no fit, and runs at every tick.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Persistence {}

impl Estimator for Persistence {
    fn inputs() -> &'static [InputPort] {
        const { &[InputPort::truth("what is predicted to stay as it was")] }
    }

    fn regressors(&self) -> Regressors {
        Regressors {
            truth_lags: TruthLags::SmallestLegal,
            every_tick: true,
            ..Regressors::default()
        }
    }

    fn fixed(&self, regressors: &[String]) -> Option<Box<dyn Predictor>> {
        Some(Box::new(Same {
            regressors: regressors.to_vec(),
        }))
    }

    fn trainer(&self, setup: &TrainingSetup) -> Box<dyn Trainer> {
        Box::new(Same {
            regressors: setup
                .regressors
                .iter()
                .map(|regressor| regressor.name.clone())
                .collect(),
        })
    }
}

/// The prediction that repeats its only regressor.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Same {
    regressors: Vec<String>,
}

impl Predictor for Same {
    fn uses(&self) -> &[String] {
        &self.regressors
    }

    fn mistakes(&self) -> Vec<Mistake> {
        Mistake::of_lengths(1, &[("regressors", self.regressors.len())])
    }

    fn predict(&self, regressors: &[f64]) -> f64 {
        regressors[0]
    }

    fn coefficients(&self) -> Option<Coefficients> {
        Some(Coefficients {
            terms: vec![Term::new(Of::Product(vec![Factor::of(0)]), 1.0)],
            ..Coefficients::default()
        })
    }
}

athermal_core::predictor!(Same, "persistence");

impl Trainer for Same {
    fn row(&mut self, _regressors: &[f64], _truth: f64) {}

    fn finish(self: Box<Self>) -> Result<Trained, TrainingError> {
        Ok(Trained {
            predictor: self,
            report: TrainingReport::default(),
        })
    }
}

athermal_core::register!(Persistence, Estimator, "persistence");
