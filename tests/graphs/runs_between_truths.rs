//! What a trainer is told that asks for the runs between truths: the same whether rows are kept or streamed.

use crate::workbench::{Graph, plan, secs};
use athermal::core::node::{
    Estimator, InputPort, Predictor, Regressors, Runs, Trained, Trainer, TrainingError,
    TrainingReport, TrainingSetup,
};
use athermal::run::fit::{FitOptions, Outcome, fit};
use athermal::run::recording::Table;
use athermal::{Duration, Instant};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Writes down what it is told in a fit.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Diary {}

impl Estimator for Diary {
    fn inputs() -> &'static [InputPort] {
        const {
            &[
                InputPort::held("features", "what it is told of each run"),
                InputPort::truth("what is missing now and then"),
            ]
        }
    }

    fn regressors(&self) -> Regressors {
        Regressors {
            feature_lags: vec![Duration::ZERO],
            runs: Runs::BetweenTruths { every: None },
            ..Regressors::default()
        }
    }

    fn trainer(&self, _setup: &TrainingSetup) -> Box<dyn Trainer> {
        Box::new(Writing::default())
    }
}

athermal::core::register!(Diary, Estimator, "test_diary");

#[derive(Default)]
struct Writing {
    told: TrainingReport,
}

impl Writing {
    fn write(&mut self, what: &str, at: Instant, regressors: &[f64]) {
        let second = at.as_ns() / 1_000_000_000;
        let told = format!("{what} {second}: {}", regressors[0]);
        self.told.notes.push(told);
    }
}

impl Trainer for Writing {
    fn row(&mut self, _regressors: &[f64], _truth: f64) {
        unreachable!("it takes rows with their instants")
    }

    fn row_at(&mut self, at: Instant, regressors: &[f64], _truth: f64) {
        self.write("row", at, regressors);
    }

    fn run_at(&mut self, of: Instant, regressors: &[f64]) {
        self.write("run", of, regressors);
    }

    fn segment(&mut self) {
        self.told.notes.push("segment".to_owned());
    }

    fn finish(self: Box<Self>) -> Result<Trained, TrainingError> {
        Ok(Trained {
            predictor: Box::new(Nothing {}),
            report: self.told,
        })
    }
}

#[derive(Debug, Serialize, Deserialize)]
struct Nothing {}

impl Predictor for Nothing {
    fn uses(&self) -> &[String] {
        &[]
    }

    fn predict(&self, _regressors: &[f64]) -> f64 {
        0.0
    }
}

athermal::core::predictor!(Nothing, "test_diary");

fn diary() -> Graph {
    Graph::new()
        .signal("temperature", "K", "T", "5s")
        .signal("shift", "nm", "Z", "10s")
        .model("diary", "test_diary", "temperature", "shift", "10s")
        .with("train.abs_truth = { below = '100 nm' }")
        .outputs("out = 'diary'")
}

/// A run every 5 s, which is told its instant, but for some; a truth every 10 s, but for some, and one too large.
fn told(memory: usize) -> Vec<String> {
    let mut table = Table::default();
    for segment in 0..2 {
        if segment > 0 {
            table.segment();
        }
        for second in (0..=120).step_by(5) {
            let truth = match second {
                60 | 70 => f64::NAN,
                90 => 1e3,
                second if second % 10 == 0 => 1.0,
                _ => f64::NAN,
            };
            let temperature = if second == 55 {
                f64::NAN
            } else {
                f64::from(second)
            };
            table.push(
                secs(f64::from(200 * segment + second)),
                &[temperature, truth],
            );
        }
    }
    let options = FitOptions {
        memory,
        ..FitOptions::default()
    };
    let (_, mut report) = fit(&plan(&diary()), &table, &options, &mut |_| {}).unwrap();
    let found = report.estimators.remove(0);
    assert_eq!(found.streamed, memory == 0);
    let Outcome::Fitted(report) = found.outcome else {
        panic!("{found:?}");
    };
    report.notes
}

#[test]
fn a_trainer_is_told_of_runs_only_where_truths_are_missing_kept_or_streamed() {
    let kept = told(1 << 20);
    assert_eq!(kept, told(0));
    let first: Vec<&str> = kept.iter().map(String::as_str).collect();
    let first = first.split(|told| *told == "segment").next().unwrap();
    let expected = [
        "row 10: 0",
        "row 20: 10",
        "row 30: 20",
        "row 40: 30",
        "row 50: 40",
        // The run at 55 s, of 65 s, lacks its temperature.
        "run 55: 45",
        "run 60: 50",
        "run 70: 60",
        "run 75: 65",
        "row 80: 70",
        // The truth at 90 s is outside of the limits of the fit.
        "run 85: 75",
        "run 90: 80",
        "run 95: 85",
        "row 100: 90",
        "row 110: 100",
        "row 120: 110",
    ];
    assert_eq!(first, expected);
    let runs = kept.iter().filter(|told| told.starts_with("run"));
    assert_eq!(runs.count(), 2 * 7, "as many in each segment: {kept:?}");
}
