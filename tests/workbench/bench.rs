//! A graph from text, stepped by hand. Decides nothing that is expected.

use std::path::Path;
use std::sync::Arc;

use athermal::core::compile::{Plan, Wanted, compile};
use athermal::core::diagnostic::{Diagnostics, Sources};
use athermal::core::document::{self, Disk, GraphFile};
use athermal::core::engine::Fitted;
use athermal::core::node::Predictor;
use athermal::{Engine, EngineError, Instant};

/// A graph, as far as it can be read and compiled, and what was told of it.
pub struct Read {
    pub graph: Option<GraphFile>,
    pub plan: Option<Plan>,
    pub diagnostics: Diagnostics,
    sources: Sources,
}

impl Read {
    /// Reads a graph, which may extend those of this project.
    pub fn new(text: &str) -> Self {
        Self::wanting(text, Wanted::default())
    }

    /// The same with what else is wanted of it.
    pub fn wanting(text: &str, wanted: Wanted) -> Self {
        let (mut sources, mut diagnostics) = (Sources::new(), Diagnostics::new());
        let name = Path::new(env!("CARGO_MANIFEST_DIR")).join("graphs/text.toml");
        let graph = document::load_text(name, text, &Disk, &mut sources, &mut diagnostics)
            .and_then(|read| document::declare(read, &mut diagnostics));
        let plan = graph
            .as_ref()
            .and_then(|graph| compile(graph, wanted, &mut diagnostics));
        Self {
            graph,
            plan,
            diagnostics,
            sources,
        }
    }

    /// All that was told, as a user sees it.
    pub fn told(&self) -> String {
        self.diagnostics.render(&self.sources, false, 200)
    }
}

/// Compiles a graph, which may extend those of this project, or tells what is wrong with it.
pub fn compiled(text: &str) -> Result<Plan, String> {
    let mut read = Read::new(text);
    let plan = read.plan.take();
    plan.ok_or_else(|| read.told())
}

/// A graph that has to be right.
pub fn plan(text: &str) -> Arc<Plan> {
    Arc::new(compiled(text).unwrap_or_else(|problems| panic!("{problems}")))
}

/// What is wrong with a graph.
pub fn problems(text: &str) -> String {
    compiled(text).expect_err("the graph has mistakes")
}

/// An instant in seconds.
pub fn secs(seconds: f64) -> Instant {
    Instant::from_ns((seconds * 1e9).round() as i64)
}

/// The slot that a reference names.
pub fn slot(plan: &Plan, name: &str) -> usize {
    let found = plan
        .channels
        .iter()
        .position(|channel| channel.name == name);
    found.unwrap_or_else(|| {
        let known: Vec<_> = plan.channels.iter().map(|channel| &channel.name).collect();
        panic!("there is no `{name}` in {known:?}")
    })
}

/// A linear predictor: regressors with their coefficients, and the intercept.
pub fn linear(terms: &[(&str, f64)], intercept: f64) -> Arc<dyn Predictor> {
    let (regressors, coefficients): (Vec<_>, Vec<_>) = terms.iter().copied().unzip();
    let written = serde_json::json!({
        "type": "linear",
        "regressors": regressors,
        "coefficients": coefficients,
        "intercept": intercept,
    });
    let read: Box<dyn Predictor> =
        serde_json::from_value(written).expect("a predictor as models hold it");
    Arc::from(read)
}

/// An engine on a bench: samples by name, values by name.
pub struct Bench {
    pub engine: Engine,
}

impl Bench {
    /// The graph, with what is taken for fitted.
    pub fn new(text: &str, fitted: &[(&str, Arc<dyn Predictor>)]) -> Self {
        let fitted: Fitted = fitted
            .iter()
            .map(|(node, predictor)| ((*node).to_owned(), Arc::clone(predictor)))
            .collect();
        let engine = Engine::new(plan(text), &fitted).expect("the fit belongs to the graph");
        Self { engine }
    }

    /// Steps to an instant with these samples, or tells that the engine refuses.
    pub fn try_tick(
        &mut self,
        seconds: f64,
        samples: &[(&str, f64)],
    ) -> Result<Vec<f64>, EngineError> {
        let plan = Arc::clone(self.engine.plan());
        let mut values = vec![f64::NAN; plan.sources.len()];
        for (name, value) in samples {
            values[slot(&plan, name)] = *value;
        }
        self.engine
            .step(secs(seconds), &values)
            .map(<[f64]>::to_vec)
    }

    /// Steps to an instant with these samples.
    pub fn tick(&mut self, seconds: f64, samples: &[(&str, f64)]) -> Vec<f64> {
        self.try_tick(seconds, samples).expect("ticks are in order")
    }

    /// What a channel was given at this tick; NaN where its node did not run or gave nothing.
    pub fn value(&self, name: &str) -> f64 {
        self.engine.value(slot(self.engine.plan(), name))
    }

    /// The stamp of a channel's last value, in seconds.
    pub fn stamp(&self, name: &str) -> f64 {
        self.engine.stamp(slot(self.engine.plan(), name)).as_ns() as f64 / 1e9
    }

    /// Whether a channel was given something at this tick, be it nothing.
    pub fn ran(&self, name: &str) -> bool {
        self.engine.ran(slot(self.engine.plan(), name))
    }
}
