//! An estimator fitted through a graph on rows of numbers, as oracles have them. Decides nothing that is expected.

use std::fmt::Debug;
use std::sync::Arc;

use athermal::core::compile::Plan;
use athermal::core::node::Predictor;
use athermal::run::fit::{EstimatorFit, FitOptions, Outcome, fit};
use athermal::run::recording::Table;

/// The numbers of a table, line by line, without its header.
pub fn numbers(text: &str) -> Vec<Vec<f64>> {
    let lines = text.lines().skip(1);
    lines
        .map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect())
        .collect()
}

/// A graph in which one node, of the type and parameters given, predicts `y.y`; a row each second has the inputs `x`, then `y`.
pub fn regression(inputs: &[impl Debug], node: &str) -> String {
    format!(
        r#"
schema = 1
[time]
column = "row"
step = "1s"
[signals.x]
unit = "1"
channels = {inputs:?}
max_age = "1 sample"
[signals.y]
unit = "1"
channels = ["y"]
max_age = "1 sample"
[nodes.model]
inputs.truth = "y.y"
ahead = "0s"
{node}
[outputs]
predicted = "model"
x = "x"
"#
    )
}

/// The one estimator of a graph, which can be fitted, and how its fit went.
pub fn fitted(plan: &Arc<Plan>, table: &Table) -> (Arc<dyn Predictor>, EstimatorFit) {
    let (fitted, mut report) = fit(plan, table, &FitOptions::default(), &mut |_| {}).unwrap();
    let report = report.estimators.remove(0);
    assert!(matches!(report.outcome, Outcome::Fitted(_)), "{report:?}");
    (Arc::clone(fitted.values().next().unwrap()), report)
}

/// The intercept of a linear predictor, and the coefficient of each regressor that it uses.
pub fn coefficients(predictor: &dyn Predictor) -> (f64, Vec<(String, f64)>) {
    let written = serde_json::to_value(predictor).unwrap();
    let values = written["coefficients"]
        .as_array()
        .unwrap()
        .iter()
        .map(|value| value.as_f64().unwrap());
    let named = predictor.uses().iter().cloned().zip(values).collect();
    (written["intercept"].as_f64().unwrap(), named)
}
