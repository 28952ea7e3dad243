//! An estimator that is written in Python.

use std::sync::OnceLock;

use athermal::core::node::KindFacts;
use athermal::core::node::prelude::*;
use athermal::core::predictor;
use pyo3::exceptions::PyException;
use pyo3::intern;
use pyo3::prelude::*;

use super::{Parameters, ask, raise};

/// An estimator that is written in Python, for trying things out: a class decorated with `@athermal.estimator`.
///
/// It runs only where Python does, in the package `athermal`, and a model with it imports the module that it names.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PythonEstimator {
    /// The class as `module:Name`; the name alone of what was decorated in this process.
    python: String,
    /// Its named arguments.
    #[serde(default)]
    parameters: Parameters,
    /// The lags at which each feature is read.
    #[serde(default = "now")]
    lags: Vec<Duration>,
}

fn now() -> Vec<Duration> {
    vec![Duration::ZERO]
}

impl Estimator for PythonEstimator {
    fn facts() -> KindFacts {
        KindFacts {
            can_change: true,
            ..KindFacts::default()
        }
    }

    fn inputs() -> &'static [InputPort] {
        const {
            &[
                InputPort::held("features", "what the prediction is made of"),
                InputPort::truth("what is predicted"),
            ]
        }
    }

    fn regressors(&self) -> Regressors {
        Regressors {
            feature_lags: self.lags.clone(),
            ..Regressors::default()
        }
    }

    fn mistakes(&self) -> Vec<Mistake> {
        let mut mistakes = Vec::new();
        let parameters = serde_json::Value::from(self.parameters.clone()).to_string();
        let checked = Python::attach(|py| ask(py, "check", (&self.python, parameters)).map(drop));
        if let Err(error) = checked {
            mistakes.push(Mistake::at("python", format!("`{}`: {error}", self.python)));
        }
        if self.lags.is_empty() || self.lags.iter().any(|lag| *lag < Duration::ZERO) {
            let message = "`lags` must have at least one, and none below 0";
            mistakes.push(Mistake::at("lags", message));
        }
        mistakes
    }

    fn keeps_range(&self) -> bool {
        false
    }

    fn trainer(&self, setup: &TrainingSetup) -> Box<dyn Trainer> {
        let regressors = setup.regressors.iter().map(|of| of.name.clone());
        Box::new(Rows {
            of: self.clone(),
            regressors: regressors.collect(),
            memory: setup.memory,
            rows: Vec::new(),
            truths: Vec::new(),
        })
    }
}

athermal::core::register!(PythonEstimator, Estimator, "python_estimator");

/// The rows of a fit.
struct Rows {
    of: PythonEstimator,
    regressors: Vec<String>,
    memory: usize,
    rows: Vec<Vec<f64>>,
    truths: Vec<f64>,
}

impl Rows {
    fn size(&self) -> usize {
        self.rows.len() * (self.regressors.len() + 1) * size_of::<f64>()
    }
}

impl Trainer for Rows {
    fn row(&mut self, regressors: &[f64], truth: f64) {
        if self.size() <= self.memory {
            self.rows.push(regressors.to_vec());
            self.truths.push(truth);
        }
    }

    fn finish(self: Box<Self>) -> Result<Trained, TrainingError> {
        let unsolvable = |reason: String| TrainingError::Unsolvable { reason };
        if self.rows.is_empty() {
            return Err(TrainingError::TooFewRows { rows: 0, needed: 1 });
        }
        if self.size() > self.memory {
            return Err(unsolvable(
                "an estimator of Python keeps all rows, which are more than the memory of the fit: raise `memory`".to_owned(),
            ));
        }
        let Self {
            of,
            regressors,
            rows,
            truths,
            ..
        } = *self;
        let parameters = serde_json::Value::from(of.parameters).to_string();
        let fitted = Python::attach(|py| {
            let fitted = ask(
                py,
                "fit",
                (&of.python, &parameters, &regressors, rows, truths),
            );
            let fitted = fitted.and_then(|of| of.extract::<(String, f64)>());
            fitted.map_err(|error| (error.is_instance_of::<PyException>(py), error))
        });
        match fitted {
            Ok((state, rmse)) => Ok(Trained {
                predictor: Box::new(Fit {
                    python: of.python,
                    parameters,
                    width: regressors.len(),
                    regressors,
                    state,
                    made: OnceLock::new(),
                }),
                report: TrainingReport {
                    in_sample_rmse: Some(rmse),
                    ..TrainingReport::default()
                },
            }),
            Err((true, error)) => Err(unsolvable(error.to_string())),
            Err((false, error)) => raise(error),
        }
    }
}

/// A fitted estimator.
#[derive(Debug, Serialize, Deserialize)]
struct Fit {
    python: String,
    /// As JSON.
    parameters: String,
    regressors: Vec<String>,
    /// How many regressors there were.
    width: usize,
    /// What it learned, as JSON.
    state: String,
    #[serde(skip)]
    made: OnceLock<Py<PyAny>>,
}

impl Fit {
    /// The object, made once.
    fn made(&self, py: Python<'_>) -> PyResult<&Py<PyAny>> {
        if let Some(made) = self.made.get() {
            return Ok(made);
        }
        let arguments = (
            &self.python,
            &self.parameters,
            &self.regressors,
            &self.state,
        );
        let made = ask(py, "fitted", arguments)?.unbind();
        Ok(self.made.get_or_init(|| made))
    }
}

impl Predictor for Fit {
    fn uses(&self) -> &[String] {
        &self.regressors
    }

    fn mistakes(&self) -> Vec<Mistake> {
        let lengths = Mistake::of_lengths(self.width, &[("regressors", self.regressors.len())]);
        if !lengths.is_empty() {
            return lengths;
        }
        let made = Python::attach(|py| self.made(py).map(drop));
        let made =
            made.map_err(|error| Mistake::at("python", format!("`{}`: {error}", self.python)));
        made.err().into_iter().collect()
    }

    fn predict(&self, regressors: &[f64]) -> f64 {
        let predicted = Python::attach(|py| -> PyResult<Option<f64>> {
            let predict = intern!(py, "predict");
            let row = regressors.to_vec();
            self.made(py)?
                .bind(py)
                .call_method1(predict, (row,))?
                .extract()
        });
        let predicted = predicted.unwrap_or_else(|error| raise(error));
        predicted
            .filter(|value| value.is_finite())
            .unwrap_or(ABSENT)
    }
}

predictor!(Fit, "python_estimator");
