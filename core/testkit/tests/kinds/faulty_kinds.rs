//! A mistake in the code of a kind is told as one of its kind, at the node and beside all other mistakes, and stops no program.

use std::path::Path;
use std::sync::Arc;

use athermal_core::compile::{Plan, Wanted, compile_part};
use athermal_core::diagnostic::{Diagnostics, Sources};
use athermal_core::document::{Memory, declare, load_text};
use athermal_core::engine::{Engine, EngineError, Fitted};
use athermal_core::node::{
    Encoder, Estimator, Feature, InputPort, Inputs, Learns, Mistake, Operator, OutputPort, Outputs,
    Predictor, Reach, Regressors, Runs, Tick, Trained, Trainer, TrainingError, TrainingReport,
    TrainingSetup, TruthLags,
};
use athermal_core::time::{Duration, Instant};
use athermal_run::fit::{FitOptions, Outcome, fit};
use athermal_run::live::{LiveOptions, StageError, pair};
use athermal_run::model::Model;
use athermal_run::recording::Table;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What is wrong with a kind.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
enum Fault {
    Mistakes,
    Outputs,
    Memory,
    Reach,
    Warnings,
    Build,
    ClosesLoops,
    NegativeMemory,
    NegativeSpan,
    NoPort,
    FutureEncoder,
    PastEncoder,
    FutureFeatures,
    FutureTruths,
    Hurried,
    NoLearner,
    None,
}

const SECOND: Duration = Duration::from_ns(1_000_000_000);

/// Passes its input on, but for a fault.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Faulty {
    /// The fault.
    fault: Fault,
}

impl Faulty {
    fn panics_in(&self, fault: Fault) {
        assert!(self.fault != fault, "there is nothing here");
    }
}

impl Feature for Faulty {
    fn inputs() -> &'static [InputPort] {
        const {
            &[
                InputPort::fresh("signal", "what is passed on"),
                InputPort::truth("what it is fitted on").or_none(),
            ]
        }
    }

    fn mistakes(&self) -> Vec<Mistake> {
        self.panics_in(Fault::Mistakes);
        Vec::new()
    }

    fn outputs(&self, inputs: &Inputs) -> Result<Vec<OutputPort>, Vec<Mistake>> {
        self.panics_in(Fault::Outputs);
        let mut channels = inputs.port("signal").to_vec();
        if self.fault == Fault::NegativeSpan {
            channels.iter_mut().for_each(|of| of.span = -SECOND);
        }
        let name = "passed";
        let port = (self.fault != Fault::NoPort).then_some(OutputPort { name, channels });
        Ok(port.into_iter().collect())
    }

    fn warnings(&self, _inputs: &Inputs) -> Vec<Mistake> {
        self.panics_in(Fault::Warnings);
        Vec::new()
    }

    fn build(&self, _inputs: &Inputs, _wanted: &[bool]) -> Box<dyn Operator> {
        self.panics_in(Fault::Build);
        Box::new(Passing)
    }

    fn encoder(&self) -> Option<&dyn Encoder> {
        let encodes = matches!(self.fault, Fault::FutureEncoder | Fault::PastEncoder);
        encodes.then_some(self)
    }

    fn reach(&self, _port: &str) -> Reach {
        self.panics_in(Fault::Reach);
        Reach::Own
    }

    fn memory(&self) -> Duration {
        self.panics_in(Fault::Memory);
        if self.fault == Fault::NegativeMemory {
            -SECOND
        } else {
            Duration::ZERO
        }
    }

    fn closes_loops(&self) -> bool {
        self.panics_in(Fault::ClosesLoops);
        false
    }
}

impl Encoder for Faulty {
    fn lags(&self) -> Vec<Duration> {
        match self.fault {
            Fault::FutureEncoder => vec![Duration::ZERO, -SECOND],
            _ => vec![SECOND],
        }
    }

    fn trainer(&self, _setup: &TrainingSetup) -> Box<dyn Trainer> {
        Box::new(Counting)
    }
}

struct Passing;

impl Operator for Passing {
    fn step(&mut self, tick: &Tick<'_>, outputs: &mut Outputs<'_>) {
        outputs.set(0, tick.port(0)[0]);
    }

    fn segment(&mut self) {}
}

athermal_core::register!(Faulty, Feature, "faulty");

/// Predicts zero, but for a fault.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Guess {
    /// The fault.
    fault: Fault,
    /// Whether there is nothing to fit.
    #[serde(default)]
    fixed: bool,
}

impl Estimator for Guess {
    fn inputs() -> &'static [InputPort] {
        const {
            &[
                InputPort::fresh("features", "what nothing is made of"),
                InputPort::truth("what is predicted"),
            ]
        }
    }

    fn regressors(&self) -> Regressors {
        let mut wanted = Regressors {
            feature_lags: vec![Duration::ZERO],
            ..Regressors::default()
        };
        match self.fault {
            Fault::FutureFeatures => wanted.feature_lags.push(-SECOND),
            Fault::FutureTruths => wanted.truth_lags = TruthLags::At(vec![-SECOND]),
            Fault::Hurried => {
                let every = Some(Duration::ZERO);
                wanted.runs = Runs::BetweenTruths { every };
            }
            _ => {}
        }
        wanted
    }

    fn learns(&self) -> Learns {
        match self.fault {
            Fault::NoLearner => Learns::ByDefault,
            _ => Learns::Never { help: None },
        }
    }

    fn fixed(&self, _regressors: &[String]) -> Option<Box<dyn Predictor>> {
        self.fixed.then(|| Box::new(Zero::default()) as _)
    }

    fn trainer(&self, _setup: &TrainingSetup) -> Box<dyn Trainer> {
        Box::new(Counting)
    }
}

athermal_core::register!(Guess, Estimator, "guess");

struct Counting;

impl Trainer for Counting {
    fn row(&mut self, _regressors: &[f64], _truth: f64) {}

    fn finish(self: Box<Self>) -> Result<Trained, TrainingError> {
        Ok(Trained {
            predictor: Box::new(Zero::default()),
            report: TrainingReport::default(),
        })
    }
}

#[derive(Debug, Clone, Default, Serialize, Deserialize)]
struct Zero {
    uses: Vec<String>,
}

impl Predictor for Zero {
    fn uses(&self) -> &[String] {
        &self.uses
    }

    fn predict(&self, _regressors: &[f64]) -> f64 {
        0.0
    }
}

athermal_core::predictor!(Zero, "guess_of_zero");

fn compiled(node: &str) -> Result<Plan, String> {
    let text = format!(
        "schema = 1\n[signals.room]\nunit = \"nm\"\nchannels = [\"a\"]\nmax_age = \"3min\"\n\
         [signals.drift]\nunit = \"nm\"\nchannels = [\"X\"]\nmax_age = \"3min\"\n\
         [nodes.mine]\n{node}\n[nodes.after]\ntype = \"faulty\"\nfault = \"none\"\ninputs.signal = \"mine\"\n\
         [outputs]\nout = \"after\"\n"
    );
    let (mut sources, mut diagnostics) = (Sources::new(), Diagnostics::new());
    let graph = load_text(
        Path::new("graph.toml"),
        &text,
        &Memory::new(),
        &mut sources,
        &mut diagnostics,
    )
    .and_then(|document| declare(document, &mut diagnostics))
    .unwrap();
    let plan = compile_part(&graph, Wanted::default(), &mut diagnostics);
    plan.map_err(|_| diagnostics.render(&sources, false, 200))
}

fn feature(fault: &str) -> String {
    format!("type = \"faulty\"\nfault = \"{fault}\"\ninputs.signal = \"room\"")
}

fn estimator(fault: &str) -> String {
    format!(
        "type = \"guess\"\nahead = \"1s\"\nfault = \"{fault}\"\ninputs = {{ features = \"room\", truth = \"drift\" }}"
    )
}

/// Asserts that a mistake of the kind is told at its node, and nothing else.
#[track_caller]
fn told(node: &str, found: &str, remedy: &str) {
    let told = compiled(node).unwrap_err();
    assert!(told.contains(&format!("error[A180]: `{found}")), "{told}");
    assert!(told.contains("= note: node `mine`"), "{told}");
    assert!(told.contains("from athermal-testkit 0.1.0: "), "{told}");
    assert!(told.contains(remedy), "{told}");
    assert_eq!(told.matches("error[").count(), 1, "{told}");
}

#[test]
fn a_panic_while_a_graph_is_compiled_is_a_mistake_of_the_kind_at_its_node() {
    for fault in [
        "mistakes",
        "outputs",
        "memory",
        "reach",
        "warnings",
        "closes_loops",
    ] {
        let found = "faulty` panics while the graph is compiled: there is nothing here";
        told(&feature(fault), found, "never panics");
    }
    assert!(compiled(&feature("none")).is_ok());
}

#[test]
fn values_from_the_future_are_nobodys_to_want() {
    let lag = "at the lag -1s, which is in the future";
    told(
        &estimator("future_features"),
        &format!("guess` wants its features {lag}"),
        "`Regressors::feature_lags` is 0 or more",
    );
    told(
        &estimator("future_truths"),
        &format!("guess` wants past truths {lag}"),
        "`TruthLags::At` is 0 or more",
    );
    told(
        &fitted_feature("future_encoder"),
        &format!("faulty` is fitted on inputs {lag}"),
        "`Encoder::lags` is 0 or more",
    );
}

fn fitted_feature(fault: &str) -> String {
    format!(
        "{}\ninputs.truth = \"drift\"\nahead = \"1s\"",
        feature(fault)
    )
}

#[test]
fn lengths_of_time_that_are_none_are_the_authors_mistake() {
    told(
        &fitted_feature("past_encoder"),
        "faulty` is fitted without the present values of its inputs",
        "0 is among `Encoder::lags`",
    );
    told(
        &estimator("hurried"),
        "guess` wants to learn of truths every 0s",
        "`every` above 0, or none",
    );
    told(
        &feature("negative_memory"),
        "faulty` declares that its inputs reach back -1s",
        "`memory` is 0 or more",
    );
    told(
        &feature("negative_span"),
        "faulty` gives the channel `a` with span -1s",
        "0 or more",
    );
    told(
        &feature("no_port"),
        "faulty` has no output port",
        "at least one port",
    );
}

/// What comes of a fit of a node on a minute of rows.
fn outcome(node: &str) -> Outcome {
    let plan = Arc::new(compiled(node).unwrap());
    let mut rows = Table::default();
    for second in 0..60 {
        let value = second as f64;
        rows.push(Instant::from_ns(second * SECOND.as_ns()), &[value, -value]);
    }
    let (_, report) = fit(&plan, &rows, &FitOptions::default(), &mut |_| {}).unwrap();
    report.estimators[0].outcome.clone()
}

#[test]
fn a_kind_that_learns_and_gives_no_learner_is_told_as_at_fault() {
    let Outcome::Failed(error) = outcome(&estimator("no_learner")) else {
        panic!("it has nothing that learns");
    };
    let error = error.to_string();
    assert!(
        error.contains("a mistake of its own and not of the data: for the author of `guess`, from athermal-testkit 0.1.0"),
        "{error}"
    );
    assert!(error.contains("`Predictor::learner`"), "{error}");
    let still = format!("{}\nlearn = false", estimator("no_learner"));
    assert!(matches!(outcome(&still), Outcome::Fitted(_)));
}

#[test]
fn a_kind_that_needs_no_fit_and_gives_no_learner_is_told_as_at_fault() {
    let plan = compiled(&format!("{}\nfixed = true", estimator("no_learner"))).unwrap();
    let error = Engine::new(Arc::new(plan), &Fitted::new()).err().unwrap();
    assert!(matches!(error, EngineError::NoLearner { .. }), "{error}");
    let told = error.to_string();
    assert!(told.starts_with("`mine` is to learn"), "{told}");
    assert!(told.contains("for the author of `guess`"), "{told}");
}

/// A model of a graph in which nothing is fitted.
fn model(fault: &str) -> Model {
    let text = format!(
        r#"{{"athermal_model": 1, "card": null, "fitted": {{}}, "graph": {{
            "signals": {{"room": {{"unit": "nm", "channels": ["a"]}}}},
            "nodes": {{"mine": {{"type": "faulty", "fault": "{fault}", "inputs": {{"signal": "room"}}}}}},
            "outputs": {{"out": "mine"}}
        }}}}"#
    );
    Model::from_text("model.json", text).unwrap()
}

#[test]
fn a_graph_whose_node_panics_does_not_take_over_and_what_runs_goes_on() {
    let (mut stepper, mut control) = pair(&model("none"), LiveOptions::default()).unwrap();
    let mut step = |second: i64| {
        let now = Instant::from_ns(second * SECOND.as_ns());
        stepper
            .step(now, &[second as f64])
            .unwrap()
            .outputs
            .to_vec()
    };
    assert_eq!(step(1), [1.0]);
    let refused = control.stage(&model("build"), false);
    assert!(
        matches!(refused, Err(StageError::Panicked { .. })),
        "{refused:?}"
    );
    assert!(control.staged().is_none());
    assert_eq!(step(2), [2.0]);
    control.stage(&model("none"), false).unwrap();
    control.commit().unwrap();
    assert_eq!(step(3), [3.0]);
}
