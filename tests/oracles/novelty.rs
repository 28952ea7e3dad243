//! How far regressors are outside of those of a fit: what is shown of it.

use std::sync::Arc;

use crate::workbench::Bench;
use athermal::core::node::Predictor;

/// Two sensors of which the length is half the sum.
const GRAPH: &str = r#"
schema = 1
signals.temperature = { unit = "K", channels = ["one", "two"], max_age = "1s" }
signals.length = { unit = "nm", channels = ["y"], max_age = "1s" }

[nodes.growth]
type = "linear"
inputs = { features = "temperature", truth = "length.y" }
ahead = "0s"

[outputs]
growth = "growth"
novelty = "growth:novelty"
"#;

/// `0.5 one + 0.5 two`, with 20 as the mean of both and a scale of 2; in the fit they went together.
fn growth(is_known: bool) -> Arc<dyn Predictor> {
    let mut written = serde_json::json!({
        "type": "linear",
        "regressors": ["temperature.one", "temperature.two"],
        "coefficients": [0.5, 0.5],
        "intercept": 0.0,
    });
    if is_known {
        let along = 0.5_f64.sqrt();
        written["novelty"] = serde_json::json!({
            "edge": 0.04,
            "means": [20.0, 20.0],
            "scales": [2.0, 2.0],
            "directions": [along, along],
        });
    }
    let read: Box<dyn Predictor> = serde_json::from_value(written).unwrap();
    Arc::from(read)
}

/// The novelty of two temperatures as [`growth`] has it: what lies across the direction that they took in the fit.
fn expected(one: f64, two: f64) -> f64 {
    let (a, b) = ((one - 20.0) / 2.0, (two - 20.0) / 2.0);
    let across = (a - b).powi(2) / 2.0;
    (across / (a * a + b * b + 2.0) / 0.04).sqrt()
}

#[test]
fn novelty_grows_with_what_lies_across_the_directions_of_the_fit() {
    let mut bench = Bench::new(GRAPH, &[("growth", growth(true))]);
    for (second, (one, two)) in [(20.0, 20.5), (30.0, 30.5), (21.0, 19.0), (30.0, 10.0)]
        .into_iter()
        .enumerate()
    {
        let samples = [("temperature.one", one), ("temperature.two", two)];
        let found = bench.tick(second as f64, &samples)[1];
        let expected = expected(one, two);
        assert!(
            (found - expected).abs() < 1e-9 * expected,
            "{found} instead of {expected}"
        );
    }
    let gone = bench.tick(10.0, &[("temperature.one", 20.0)]);
    assert!(gone.iter().all(|value| value.is_nan()), "{gone:?}");
}

#[test]
fn a_model_that_knows_no_novelty_predicts_and_shows_none() {
    let mut bench = Bench::new(GRAPH, &[("growth", growth(false))]);
    let samples = [("temperature.one", 30.0), ("temperature.two", 10.0)];
    let found = bench.tick(0.0, &samples);
    assert_eq!(found[0], 20.0);
    assert!(found[1].is_nan());
}
