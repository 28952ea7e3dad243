//! Features that are fitted: which rows they learn from, when, and what stands in the model.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use athermal::core::compile::Plan;
use athermal::core::diagnostic::{Diagnostics, Sources};
use athermal::core::document::{Memory, declare, load_text};
use athermal::core::engine::Fitted;
use athermal::core::node::{
    Encoder, Estimator, Feature, InputPort, Inputs, Mistake, Operator, OutputPort, Outputs,
    Predictor, Regressors, Tick, Trained, Trainer, TrainingError, TrainingReport, TrainingSetup,
};
use athermal::core::time::Duration;
use athermal::core::unit::Unit;
use athermal::run::fit::{FitOptions, FitProgress, FitReport, fit};
use athermal::run::model::Model;
use athermal::run::recording::{Event, Table};
use athermal::{Engine, Instant};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::fitting::recording;
use crate::workbench::{Graph, compiled, plan, problems, slot};

/// The rows that a fit was given, and when their truths were measured.
type Seen = Vec<(Instant, Vec<f64>, f64)>;

/// The rows of every fit, by the label of the node: tests share a process.
static FITS: Mutex<BTreeMap<String, Vec<Seen>>> = Mutex::new(BTreeMap::new());

fn fits(label: &str) -> Vec<Seen> {
    let fits = FITS.lock().unwrap_or_else(PoisonError::into_inner);
    fits.get(label).cloned().unwrap_or_default()
}

/// The sum of the regressors, each times its covariance with the truth.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Along {
    /// Under which name the rows of its fits are kept.
    label: String,
    /// The lags of a row.
    #[serde(default = "now")]
    lags: Vec<Duration>,
}

fn now() -> Vec<Duration> {
    vec![Duration::ZERO]
}

impl Feature for Along {
    fn inputs() -> &'static [InputPort] {
        const {
            &[
                InputPort::held("features", "what is summed up"),
                InputPort::truth("what it goes along with"),
            ]
        }
    }

    fn outputs(&self, inputs: &Inputs) -> Result<Vec<OutputPort>, Vec<Mistake>> {
        let mut along = inputs.port("features")[0].clone();
        along.name = "along".to_owned();
        along.unit = Unit::one();
        let channels = vec![along];
        Ok(vec![OutputPort {
            name: "sum",
            channels,
        }])
    }

    fn encoder(&self) -> Option<&dyn Encoder> {
        Some(self)
    }

    fn build(&self, inputs: &Inputs, _wanted: &[bool]) -> Box<dyn Operator> {
        Box::new(Summing {
            fit: inputs
                .fit::<Covariances>()
                .map(|(fit, places)| (fit.clone(), places.to_vec())),
        })
    }
}

impl Encoder for Along {
    fn lags(&self) -> Vec<Duration> {
        self.lags.clone()
    }

    fn trainer(&self, setup: &TrainingSetup) -> Box<dyn Trainer> {
        let names = setup.regressors.iter();
        Box::new(Collecting {
            label: self.label.clone(),
            uses: names.map(|regressor| regressor.name.clone()).collect(),
            rows: Vec::new(),
        })
    }
}

struct Collecting {
    label: String,
    uses: Vec<String>,
    rows: Seen,
}

impl Trainer for Collecting {
    fn row(&mut self, _regressors: &[f64], _truth: f64) {}

    fn row_at(&mut self, at: Instant, regressors: &[f64], truth: f64) {
        self.rows.push((at, regressors.to_vec(), truth));
    }

    fn finish(self: Box<Self>) -> Result<Trained, TrainingError> {
        let rows = || {
            self.rows
                .iter()
                .map(|(_, regressors, truth)| (regressors, truth))
        };
        let count = self.rows.len() as f64;
        let mean = rows().map(|(_, truth)| truth).sum::<f64>() / count;
        let covariance = |i: usize| {
            let products = rows().map(|(regressors, truth)| regressors[i] * (truth - mean));
            products.sum::<f64>() / count
        };
        let fit = Covariances {
            weights: (0..self.uses.len()).map(covariance).collect(),
            uses: self.uses,
        };
        let mut fits = FITS.lock().unwrap_or_else(PoisonError::into_inner);
        fits.entry(self.label).or_default().push(self.rows);
        Ok(Trained {
            predictor: Box::new(fit),
            report: TrainingReport::default(),
        })
    }
}

#[derive(Debug, Clone, Serialize, Deserialize)]
struct Covariances {
    uses: Vec<String>,
    weights: Vec<f64>,
}

impl Predictor for Covariances {
    fn uses(&self) -> &[String] {
        &self.uses
    }

    fn predict(&self, regressors: &[f64]) -> f64 {
        let products = self.weights.iter().zip(regressors);
        products.map(|(weight, value)| weight * value).sum()
    }
}

athermal::core::predictor!(Covariances, "test_along");

struct Summing {
    fit: Option<(Covariances, Vec<usize>)>,
}

impl Operator for Summing {
    fn step(&mut self, tick: &Tick<'_>, outputs: &mut Outputs<'_>) {
        let Some((fit, places)) = &self.fit else {
            outputs.set(0, f64::NAN);
            return;
        };
        let row: Vec<f64> = places.iter().map(|&place| tick.port(0)[place]).collect();
        outputs.set(0, fit.predict(&row));
    }

    fn segment(&mut self) {}
}

athermal::core::register!(Along, Feature, "test_along");

/// The same as an estimator.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Weighing {
    label: String,
}

impl Estimator for Weighing {
    fn inputs() -> &'static [InputPort] {
        Along::inputs()
    }

    fn regressors(&self) -> Regressors {
        Regressors {
            feature_lags: now(),
            ..Regressors::default()
        }
    }

    fn trainer(&self, setup: &TrainingSetup) -> Box<dyn Trainer> {
        let (label, lags) = (self.label.clone(), now());
        Along { label, lags }.trainer(setup)
    }
}

athermal::core::register!(Weighing, Estimator, "test_weighing");

/// An encoder of the temperatures, and an estimator of what it gives.
fn nodes(label: &str, more: &str) -> Graph {
    super::samples()
        .model("code", "test_along", "temperature", "position.Z", "30s")
        .with(&format!("label = '{label}'; lags = ['0s', '20s']"))
        .with(more)
        .model("plain", "linear", "code", "position.Z", "30s")
        .with("outside = 'pass'")
}

fn with_output(text: &str, output: &str) -> String {
    format!("{text}[outputs]\nout = \"{output}\"\n")
}

fn fitted(plan: &Arc<Plan>) -> (Fitted, FitReport) {
    let mut told = (0, 0);
    let made = fit(
        plan,
        &recording(),
        &FitOptions::default(),
        &mut |progress| {
            if let FitProgress::Ticks { fit, of, .. } = progress {
                told = (fit, of);
            }
        },
    );
    assert_eq!(told.0, told.1, "as many fits as were told to come");
    made.unwrap()
}

fn samples() -> Vec<(Instant, Vec<f64>)> {
    let row = |(event, values): &(Event, Vec<f64>)| match event {
        Event::Row(now) => (*now, values.clone()),
        Event::Segment => unreachable!("the recording is in one piece"),
    };
    recording().events().iter().map(row).collect()
}

#[test]
fn it_learns_from_its_inputs_at_the_run_that_a_truth_belongs_to() {
    let plan = plan(&with_output(&nodes("rows", ""), "plain"));
    fitted(&plan);
    let fits = fits("rows");
    let [rows] = &fits[..] else {
        panic!("{} fits", fits.len())
    };
    // The run 30 s before the truth is three ticks back, the values 20 s before it another two.
    let samples = samples();
    for (at, regressors, truth) in rows {
        let tick = samples.iter().position(|(now, _)| now == at).unwrap();
        let [run, before] = [3, 5].map(|back| &samples[tick - back].1);
        assert_eq!(*truth, samples[tick].1[2]);
        assert_eq!(*regressors, [run[0], run[1], before[0], before[1]]);
    }
    assert_eq!(rows.len(), samples.len() - 5, "the lags are cold at first");
}

#[test]
fn what_reads_it_is_fitted_after_it_on_what_it_then_gives() {
    let plan = plan(&with_output(&nodes("order", ""), "plain"));
    let (fitted, report) = fitted(&plan);
    let told: Vec<_> = report
        .estimators
        .iter()
        .map(|fit| (&*fit.node, fit.kind))
        .collect();
    assert_eq!(told, [("code", "test_along"), ("plain", "linear")]);
    let mut engine = Engine::new(Arc::clone(&plan), &fitted).unwrap();
    let (code, out) = (slot(&plan, "code.along"), slot(&plan, "plain.Z"));
    let (mut squares, mut rows) = (0.0, 0.0);
    let mut predicted: Vec<f64> = Vec::new();
    for (tick, (now, values)) in samples().into_iter().enumerate() {
        engine.step(now, &values).unwrap();
        assert_eq!(engine.value(code).is_nan(), tick < 2, "{tick}");
        predicted.push(engine.value(out));
        if tick >= 5 {
            squares += (predicted[tick - 3] - values[2]).powi(2);
            rows += 1.0;
        }
    }
    let in_sample = match &report.estimators[1].outcome {
        athermal::run::fit::Outcome::Fitted(report) => report.in_sample_rmse.unwrap(),
        athermal::run::fit::Outcome::Failed(error) => panic!("{error}"),
    };
    let rmse = f64::sqrt(squares / rows);
    assert!(
        (rmse - in_sample).abs() < 1e-9 * rmse,
        "{rmse} and {in_sample}"
    );
}

#[test]
fn it_is_fitted_once_where_what_it_feeds_is_stacked() {
    let stacked = format!(
        "{}
[nodes.stack]
type = \"stack\"
inputs.voters = [\"plain\"]
inputs.truth = \"position.Z\"
ahead = \"30s\"
",
        nodes("stacked", "")
    );
    let (fitted, _) = fitted(&plan(&with_output(&stacked, "stack")));
    assert_eq!(fits("stacked").len(), 1, "two fits mean different things");
    assert_eq!(fitted.len(), 3);
}

#[test]
fn what_is_stacked_is_fitted_without_each_third_of_the_data_and_what_is_not_is_fitted_once() {
    let weighing = |label: &str| {
        format!(
            "[nodes.{label}]\ntype = \"test_weighing\"\ninputs.features = \"code\"\ninputs.truth = \"position.Z\"\n\
             ahead = \"30s\"\nlabel = \"{label}\"\n"
        )
    };
    let graph = format!(
        "{}{}{}[nodes.stack]\ntype = \"stack\"\ninputs.voters = [\"plain\", \"voter\"]\n\
         inputs.truth = \"position.Z\"\nahead = \"30s\"\n",
        nodes("beside", ""),
        weighing("voter"),
        weighing("alone")
    );
    fitted(&plan(&with_output(&graph, "stack")));
    assert_eq!([fits("voter").len(), fits("alone").len()], [4, 1]);
}

/// A model of the graph, in which nothing has been fitted yet.
fn model(label: &str) -> Model {
    let text = with_output(&nodes(label, ""), "plain");
    let (mut sources, mut diagnostics) = (Sources::new(), Diagnostics::new());
    let graph = load_text(
        "graph.toml",
        &text,
        &Memory::new(),
        &mut sources,
        &mut diagnostics,
    )
    .and_then(|read| declare(read, &mut diagnostics))
    .unwrap();
    Model {
        graph: graph.into(),
        plan: plan(&text),
        fitted: Fitted::new(),
        card: None,
    }
}

#[test]
fn its_fit_stands_in_the_model_and_comes_back_to_the_last_bit() {
    let mut model = model("model");
    assert_eq!(model.unfitted(), ["code", "plain"]);
    model.fitted = fitted(&model.plan).0;
    assert!(model.unfitted().is_empty());
    let read = Model::from_text("model.json", model.to_text().unwrap()).unwrap();
    assert_eq!(read.to_text().unwrap(), model.to_text().unwrap());
    let (mut one, mut other) = (model.engine().unwrap(), read.engine().unwrap());
    let mut given = 0;
    for (now, values) in samples() {
        let bits = |values: &[f64]| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        let outputs = bits(one.step(now, &values).unwrap());
        assert_eq!(outputs, bits(other.step(now, &values).unwrap()));
        given += usize::from(!one.outputs()[0].is_nan());
    }
    assert!(given > 1900);
}

#[test]
fn a_model_of_a_node_type_that_this_program_lacks_is_told_by_the_name_of_the_type() {
    let mut model = model("lacking");
    model.fitted = fitted(&model.plan).0;
    let text = model.to_text().unwrap().replace("test_along", "bellows");
    let told = match Model::from_text("model.json", text) {
        Err(athermal::run::model::ModelError::Graph {
            diagnostics,
            sources,
        }) => diagnostics.render(&sources, false, 200),
        other => panic!("{other:?}"),
    };
    assert!(told.contains("there is no node type `bellows`"), "{told}");
    let plugins = "`athermal build --with CRATE` brings those of a plugin crate";
    assert!(told.contains(plugins), "{told}");
}

#[test]
fn without_a_fit_it_gives_nothing() {
    let plan = plan(&with_output(&nodes("unfitted", ""), "code"));
    let mut engine = Engine::new(plan, &Fitted::new()).unwrap();
    for (now, values) in &samples()[..20] {
        assert!(engine.step(*now, values).unwrap()[0].is_nan());
    }
}

#[test]
fn truths_outside_of_its_limits_are_left_out() {
    let limits = "train.abs_truth = { below = \"80 nm\" }";
    let (_, report) = fitted(&plan(&with_output(&nodes("limits", limits), "plain")));
    let [code, plain] = &report.estimators[..] else {
        panic!("{report:?}")
    };
    assert!(code.dropped.outside_limits > 0 && plain.dropped.outside_limits == 0);
    let mut fits = fits("limits").into_iter().flatten();
    assert!(fits.all(|(_, _, truth)| truth.abs() < 80.0));
}

#[test]
fn a_dead_channel_costs_it_a_regressor_and_not_its_rows() {
    let mut table = Table::default();
    for (now, mut values) in samples() {
        values[1] = f64::NAN;
        table.push(now, &values);
    }
    let plan = plan(&with_output(&nodes("dead", ""), "code"));
    let (fitted, report) = fit(&plan, &table, &FitOptions::default(), &mut |_| {}).unwrap();
    let dropped: Vec<_> = report.estimators[0].dropped_candidates.iter().collect();
    assert_eq!(dropped.len(), 2, "{dropped:?}");
    assert_eq!(
        fitted["code"].uses(),
        ["temperature.room", "temperature.room lag 20s"]
    );
    let mut engine = Engine::new(plan, &fitted).unwrap();
    for (tick, (now, values)) in samples().iter().take(20).enumerate() {
        assert_eq!(engine.step(*now, values).unwrap()[0].is_nan(), tick < 2);
    }
}

#[test]
fn it_needs_a_horizon_and_sees_nothing_of_the_future() {
    let without = nodes("mistakes", "").replacen("ahead = \"30s\"\n", "", 1);
    let told = problems(&with_output(&without, "code"));
    assert!(told.contains("A055"), "{told}");
    let leaking = nodes("mistakes", "")
        .replacen(
            "inputs.features = \"temperature\"",
            "inputs.features = { from = \"position.Z\", max_age = \"3min\" }",
            1,
        )
        .replacen("ahead = \"30s\"", "ahead = \"0s\"", 1);
    let told = problems(&with_output(&leaking, "code"));
    assert!(told.contains("position.Z"), "{told}");
    assert!(told.contains("leak") || told.contains("future"), "{told}");
    let learning = nodes("mistakes", "learn = true");
    assert!(compiled(&with_output(&learning, "code")).is_err());
}

#[test]
fn another_horizon_is_another_node() {
    let [one, other] = ["30s", "40s"].map(|ahead| {
        let ahead = format!("ahead = \"{ahead}\"");
        let text = nodes("diff", "").replacen("ahead = \"30s\"", &ahead, 1);
        plan(&with_output(&text, "code"))
    });
    let diff = athermal::core::compile::diff(&one, &other);
    let changes: Vec<_> = match diff.node("code") {
        Some(athermal::core::compile::Change::Changed(changes)) => {
            changes.iter().map(|change| change.path.as_str()).collect()
        }
        other => panic!("{other:?}"),
    };
    assert_eq!(changes, ["ahead"]);
}
