//! An estimator that predicts what it has been told, known to these tests only.

use athermal::Duration;
use athermal::Instant;
use athermal::core::node::{
    Estimator, InputPort, Learner, Learns, Predictor, Regressors, Restored, State, Trainer,
    TrainingSetup,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Predicts something about the last truth that it was told; −1 before the first.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Told {
    /// What.
    about: About,
}

#[derive(Debug, Clone, Copy, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
enum About {
    /// When it was measured, in seconds.
    Arrival,
    /// The regressor that it came with.
    Regressor,
}

impl Estimator for Told {
    fn inputs() -> &'static [InputPort] {
        const {
            &[
                InputPort::held("features", "one of them is shown"),
                InputPort::truth("what it is told"),
            ]
        }
    }

    fn regressors(&self) -> Regressors {
        Regressors {
            feature_lags: vec![Duration::ZERO],
            ..Regressors::default()
        }
    }

    fn fixed(&self, regressors: &[String]) -> Option<Box<dyn Predictor>> {
        Some(Box::new(Start {
            about: self.about,
            regressors: regressors[..1].to_vec(),
        }))
    }

    fn learns(&self) -> Learns {
        Learns::OnRequest
    }

    fn trainer(&self, _setup: &TrainingSetup) -> Box<dyn Trainer> {
        unreachable!("it needs no fit")
    }
}

athermal::core::register!(Told, Estimator, "test_told");

#[derive(Debug, Serialize, Deserialize)]
struct Start {
    about: About,
    regressors: Vec<String>,
}

impl Predictor for Start {
    fn uses(&self) -> &[String] {
        &self.regressors
    }

    fn predict(&self, _regressors: &[f64]) -> f64 {
        -2.0
    }

    fn learner(&self) -> Option<Box<dyn Learner>> {
        Some(Box::new(Last {
            about: self.about,
            shown: -1.0,
        }))
    }
}

athermal::core::predictor!(Start, "test_told");

#[derive(Debug, Clone, Serialize, Deserialize)]
struct Last {
    about: About,
    shown: f64,
}

impl Learner for Last {
    fn predict(&self, _regressors: &[f64], _of: Instant) -> f64 {
        self.shown
    }

    fn learn(&mut self, regressors: &[f64], _truth: f64, at: Instant) {
        self.shown = match self.about {
            About::Arrival => at.as_ns() as f64 / 1e9,
            About::Regressor => regressors[0],
        };
    }

    fn snapshot(&self) -> Box<dyn State> {
        Box::new(self.clone())
    }

    fn restore(&mut self, state: Box<dyn State>) -> Restored {
        match state.known() {
            Ok(known) => {
                *self = known;
                Restored::Accepted
            }
            Err(cold) => cold,
        }
    }
}

athermal::core::state!(Last, "test_told/1");
