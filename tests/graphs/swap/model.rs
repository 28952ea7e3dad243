//! Models from text, with coefficients made up rather than fitted.

use std::collections::BTreeMap;
use std::sync::Arc;

use athermal::Model;
use athermal::core::compile::PlannedRole;
use athermal::core::engine::{Engine, fnv_1a};
use athermal::core::node::Predictor;
use athermal::{Duration, Instant};
use serde_json::json;

use crate::workbench::Read;

pub fn s(seconds: i64) -> Instant {
    Instant::from_ns(seconds * 1_000_000_000)
}

pub fn d(seconds: i64) -> Duration {
    Duration::from_ns(seconds * 1_000_000_000)
}

/// A graph whose linear estimators have coefficients that follow from their names and `salt`.
pub fn model(text: &str, salt: &str) -> Model {
    let mut read = Read::new(text);
    let (Some(graph), Some(plan)) = (read.graph.take(), read.plan.take()) else {
        panic!("{}\n{text}", read.told());
    };
    let mut fitted = BTreeMap::new();
    for node in &plan.nodes {
        let PlannedRole::Estimator { fit, .. } = &node.role else {
            continue;
        };
        if !["linear", "ar", "arx"].contains(&node.kind.name) {
            continue;
        }
        let names: Vec<_> = fit.regressors.iter().map(|r| r.name.clone()).collect();
        // Two of three regressors are used, so that some may be absent without harm.
        let number = |name: &str| {
            let hash = fnv_1a(format!("{}/{name}/{salt}", node.instance()).as_bytes());
            (hash % 2001) as f64 / 1000.0 - 1.0
        };
        let used: Vec<_> = names.iter().filter(|name| number(name) < 0.33).collect();
        let coefficients: Vec<_> = used.iter().map(|name| number(name) / 8.0).collect();
        let fit = json!({
            "type": "linear",
            "regressors": used,
            "coefficients": coefficients,
            "intercept": number(""),
        });
        let fit: Box<dyn Predictor> = serde_json::from_value(fit).unwrap();
        fitted.insert(node.instance(), Arc::from(fit));
    }
    Model {
        graph: Arc::new(graph),
        plan: Arc::new(plan),
        fitted,
        card: None,
    }
}

/// What happens to an engine: a row of samples by channel, or a segment break.
#[derive(Debug, Clone)]
pub enum Happening {
    Row(Instant, Vec<f64>),
    Break,
}

/// The output columns of a plan.
pub fn columns(plan: &athermal::core::compile::Plan) -> Vec<String> {
    plan.outputs.iter().map(|o| o.name.clone()).collect()
}

/// The bits of an engine's outputs by name.
pub fn bits(names: &[String], outputs: &[f64]) -> BTreeMap<String, u64> {
    let bits = outputs.iter().map(|value| value.to_bits());
    names.iter().cloned().zip(bits).collect()
}

/// The outputs of a model that runs from its beginning, one for each row; `feed` are the channels of a row.
pub fn run(model: &Model, feed: &[String], happenings: &[Happening]) -> Vec<BTreeMap<String, u64>> {
    let mut engine: Engine = model.engine().unwrap();
    let names = columns(&model.plan);
    let places: Vec<_> = model
        .plan
        .sources
        .iter()
        .map(|source| feed.iter().position(|f| *f == source.name).unwrap())
        .collect();
    let mut rows = Vec::new();
    for happening in happenings {
        match happening {
            Happening::Row(time, samples) => {
                let samples: Vec<_> = places.iter().map(|&place| samples[place]).collect();
                rows.push(bits(&names, engine.step(*time, &samples).unwrap()));
            }
            Happening::Break => engine.segment(),
        }
    }
    rows
}
