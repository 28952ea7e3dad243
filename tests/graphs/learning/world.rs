//! A world in which a shift follows two temperatures linearly, until it follows them otherwise.

use std::sync::Arc;

use athermal::core::compile::Plan;
use athermal::core::engine::{Engine, Fitted};
use athermal::core::prng::Prng;
use athermal::run::fit::{FitOptions, Outcome, fit};
use athermal::run::recording::Table;

use crate::workbench::{Graph, plan, secs};

/// A model of the kind and parameters given, `ahead` 20 s.
pub fn graph(node: &str) -> Graph {
    Graph::new()
        .signal("temperature", "K", "a b", "1min")
        .signal("shift", "nm", "Z", "1min")
        .signal("hold", "1", "door", "30s")
        .section("nodes.model", node)
        .with("inputs.features = 'temperature'; inputs.truth = 'shift'; ahead = '20s'")
        .outputs("out = 'model'; learning = 'model:learning'; hold = 'hold'")
}

pub const RLS: &str = "type = \"rls\"\nmemory = \"500s\"\nlearn = { outliers = 6.0, margin = 0.5 }";
pub const SGD: &str = "type = \"linear\"\nsolver = { type = \"sgd\", eta0 = 0.05, power = 0.0 }\nlearn = { outliers = 6.0, margin = 0.5 }";

/// Samples in the order of the plan: two temperatures, the shift, and the door.
pub type Row = [f64; 4];

/// A tick every 10 s. The shift is `3a − 2b + 5` of 20 s ago, from row `change` on `a + 2b − 4`, with noise of 0.1.
pub fn rows(seed: u64, count: usize, change: usize) -> Vec<Row> {
    let mut random = Prng::stream(seed, "world");
    let (mut a, mut b) = (0.0, 0.0);
    let mut past = Vec::new();
    let mut rows = Vec::with_capacity(count);
    for tick in 0..count {
        a = 0.9 * a + 0.3 * random.normal();
        b = 0.8 * b + 0.4 * random.normal();
        past.push((a, b));
        let shift = match tick.checked_sub(2).map(|then| past[then]) {
            None => f64::NAN,
            Some((a, b)) if tick < change => 3.0 * a - 2.0 * b + 5.0,
            Some((a, b)) => a + 2.0 * b - 4.0,
        };
        rows.push([a, b, shift + 0.1 * random.normal(), 0.0]);
    }
    rows
}

/// The plan of a graph, and its fit on 500 rows without a change.
pub fn fitted(text: &str) -> (Arc<Plan>, Fitted) {
    fitted_on(text, &rows(1, 500, usize::MAX))
}

/// The same on other rows, a tick every 10 s.
pub fn fitted_on(text: &str, rows: &[impl AsRef<[f64]>]) -> (Arc<Plan>, Fitted) {
    let plan = plan(text);
    let mut table = Table::default();
    for (tick, row) in rows.iter().enumerate() {
        table.push(secs(10.0 * tick as f64), row.as_ref());
    }
    let (fitted, report) = fit(&plan, &table, &FitOptions::default(), &mut |_| {}).unwrap();
    for estimator in report.estimators {
        assert!(
            matches!(estimator.outcome, Outcome::Fitted(_)),
            "{estimator:?}"
        );
    }
    (plan, fitted)
}

pub fn engine(text: &str) -> Engine {
    let (plan, fitted) = fitted(text);
    Engine::new(plan, &fitted).unwrap()
}

/// Steps through rows that begin at a tick; what each gave.
pub fn run(engine: &mut Engine, first: usize, rows: &[impl AsRef<[f64]>]) -> Vec<Vec<f64>> {
    let step = |(tick, row): (usize, &_)| {
        let time = secs(10.0 * (first + tick) as f64);
        engine.step(time, AsRef::as_ref(row)).unwrap().to_vec()
    };
    rows.iter().enumerate().map(step).collect()
}

/// Root mean square error of the predictions from a row on; the truth of a prediction is that of two rows later.
pub fn error(rows: &[Row], outputs: &[Vec<f64>], from: usize) -> f64 {
    let pairs = outputs[from..].iter().zip(&rows[from + 2..]);
    let squares = pairs.map(|(output, row)| (output[0] - row[2]).powi(2));
    (squares.sum::<f64>() / (rows.len() - from - 2) as f64).sqrt()
}

/// Whether two runs gave the same bits.
pub fn same(a: &[Vec<f64>], b: &[Vec<f64>]) -> bool {
    let bits =
        |run: &[Vec<f64>]| -> Vec<u64> { run.iter().flatten().map(|v| v.to_bits()).collect() };
    bits(a) == bits(b)
}
