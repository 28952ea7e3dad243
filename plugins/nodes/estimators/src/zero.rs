//! The baseline "nothing moves".

use athermal_core::node::{
    Coefficients, Estimator, InputPort, Predictor, Regressors, Trained, Trainer, TrainingError,
    TrainingReport, TrainingSetup,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Predicts zero: what a machine without a model does.
///
/// `ŷ = 0`. It needs no fit, and runs at every tick.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Zero {}

impl Estimator for Zero {
    fn inputs() -> &'static [InputPort] {
        const { &[InputPort::truth("what is predicted to be zero")] }
    }

    fn regressors(&self) -> Regressors {
        Regressors {
            every_tick: true,
            ..Regressors::default()
        }
    }

    fn fixed(&self, _regressors: &[String]) -> Option<Box<dyn Predictor>> {
        Some(Box::new(Nothing {}))
    }

    fn trainer(&self, _setup: &TrainingSetup) -> Box<dyn Trainer> {
        Box::new(Nothing {})
    }
}

/// The prediction zero.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Nothing {}

impl Predictor for Nothing {
    fn uses(&self) -> &[String] {
        &[]
    }

    fn predict(&self, _regressors: &[f64]) -> f64 {
        0.0
    }

    fn coefficients(&self) -> Option<Coefficients> {
        Some(Coefficients::linear(0.0, &[], None))
    }
}

athermal_core::predictor!(Nothing, "zero");

impl Trainer for Nothing {
    fn row(&mut self, _regressors: &[f64], _truth: f64) {}

    fn finish(self: Box<Self>) -> Result<Trained, TrainingError> {
        Ok(Trained {
            predictor: self,
            report: TrainingReport::default(),
        })
    }
}

athermal_core::register!(Zero, Estimator, "zero");
