//! How far regressors are outside of those of a fit: what is shown of it.

use std::sync::Arc;

use crate::workbench::{Bench, Graph, problems};
use athermal::core::node::Predictor;

/// Two sensors of which the length is half the sum.
fn two_sensors() -> Graph {
    Graph::new()
        .signal("temperature", "K", "one two", "1s")
        .signal("length", "nm", "y", "1s")
        .model("growth", "linear", "temperature", "length.y", "0s")
        .outputs("growth = 'growth'; novelty = 'growth:novelty'")
}

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

/// The graph with `outside`, or more lines of the estimator, and more beside it.
fn graph(outside: &str, more: &str) -> String {
    let estimator = format!("ahead = \"0s\"\n{outside}\n");
    two_sensors().replace("ahead = \"0s\"\n", &estimator) + more
}

/// The novelty of two temperatures as [`growth`] has it: what lies across the direction that they took in the fit.
fn expected(one: f64, two: f64) -> f64 {
    let (a, b) = ((one - 20.0) / 2.0, (two - 20.0) / 2.0);
    let across = (a - b).powi(2) / 2.0;
    (across / (a * a + b * b + 2.0) / 0.04).sqrt()
}

#[test]
fn novelty_grows_with_what_lies_across_the_directions_of_the_fit() {
    let text = graph("outside = \"pass\"", "");
    let mut bench = Bench::new(&text, &[("growth", growth(true))]);
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
    let mut bench = Bench::new(&two_sensors(), &[("growth", growth(false))]);
    let samples = [("temperature.one", 30.0), ("temperature.two", 10.0)];
    let found = bench.tick(0.0, &samples);
    assert_eq!(found[0], 20.0);
    assert!(found[1].is_nan());
}

/// One temperature at 40 K and one at 20 K: far outside, where the form predicts 30 nm and the mean of the fit is 20 nm.
const OUTSIDE: [(&str, f64); 2] = [("temperature.one", 40.0), ("temperature.two", 20.0)];

#[test]
fn a_prediction_outside_shrinks_is_absent_or_passes() {
    let shrunk = 20.0 + 10.0 / expected(40.0, 20.0);
    for (outside, expected) in [
        ("", Some(shrunk)),
        ("outside = \"shrink\"", Some(shrunk)),
        ("outside = \"absent\"", None),
        ("outside = \"pass\"", Some(30.0)),
    ] {
        let mut bench = Bench::new(&graph(outside, ""), &[("growth", growth(true))]);
        let inside = bench.tick(
            0.0,
            &[("temperature.one", 20.25), ("temperature.two", 20.5)],
        );
        assert_eq!(inside[0], 0.5 * 20.25 + 0.5 * 20.5, "{outside}");
        assert!(inside[1] < 1.0);
        let found = bench.tick(1.0, &OUTSIDE);
        assert!(
            found[1] > 3.0,
            "{outside}: it is shown how far outside it is"
        );
        match expected {
            Some(expected) => assert!((found[0] - expected).abs() < 1e-9, "{outside}: {found:?}"),
            None => assert!(found[0].is_nan(), "{outside}: {found:?}"),
        }
    }
}

#[test]
fn the_deviation_of_a_prediction_that_has_shrunk_grows_with_its_novelty_and_with_how_far_it_moved()
{
    let text = graph("", "deviation = \"growth:std_dev\"\n");
    let mut written = serde_json::to_value(&*growth(true)).unwrap();
    written["variance"] = serde_json::json!({ "noise": 4.0, "rows": 100, "centre": [20.0, 20.0], "root": [0.0, 0.0, 0.0] });
    let read: Box<dyn Predictor> = serde_json::from_value(written).unwrap();
    let mut bench = Bench::new(&text, &[("growth", Arc::from(read))]);
    let own = 4.0_f64 * (1.0 + 1.0 / 100.0);
    let inside = bench.tick(
        0.0,
        &[("temperature.one", 20.25), ("temperature.two", 20.5)],
    );
    assert_eq!(inside[2], own.sqrt());
    let found = bench.tick(1.0, &OUTSIDE);
    let novelty = expected(40.0, 20.0);
    let moved = 10.0 - 10.0 / novelty;
    let expected = (novelty * novelty * own + moved * moved).sqrt();
    assert!(
        (found[2] - expected).abs() < 1e-9,
        "{found:?} instead of {expected}"
    );
}

#[test]
fn a_voter_that_steps_outside_loses_its_vote_at_that_tick() {
    let more = r#"
vote = "vote"
weights = "vote:weights"
of_vote = "vote:novelty"

[nodes.plain]
type = "linear"
inputs = { features = "temperature.two", truth = "length.y" }
ahead = "0s"

[nodes.vote]
type = "auto_weighted"
inputs = { voters = ["growth", "plain"], truth = "length.y" }
memory = "15min"
"#;
    let plain = serde_json::json!({
        "type": "linear",
        "regressors": ["temperature.two"],
        "coefficients": [1.0],
        "intercept": 0.0,
    });
    let plain: Box<dyn Predictor> = serde_json::from_value(plain).unwrap();
    let fitted = [("growth", growth(true)), ("plain", Arc::from(plain))];
    let mut bench = Bench::new(&graph("outside = \"pass\"", more), &fitted);
    let inside = bench.tick(0.0, &[("temperature.one", 20.5), ("temperature.two", 20.0)]);
    assert_eq!(inside[2..5], [20.125, 0.5, 0.5]);
    let found = bench.tick(1.0, &OUTSIDE);
    let novelty = expected(40.0, 20.0);
    let trust = 1.0 / (novelty * novelty);
    let weight = trust / (trust + 1.0);
    let expected = [20.0 + 10.0 * weight, weight, 1.0 - weight, novelty];
    for (found, expected) in found[2..].iter().zip(expected) {
        assert!(
            (found - expected).abs() < 1e-9,
            "{found} instead of {expected}"
        );
    }
    let back = bench.tick(2.0, &[("temperature.one", 20.5), ("temperature.two", 20.0)]);
    assert_eq!(back[2..5], [20.125, 0.5, 0.5]);
}

#[test]
fn outside_is_refused_where_it_would_do_nothing() {
    let told = problems(
        &graph("outside = \"pass\"", "")
            .replace("\"linear\"", "\"persistence\"")
            .replace("features = \"temperature\", ", ""),
    );
    assert!(
        told.contains("`outside` would do nothing: its fit does not say"),
        "{told}"
    );
    let told = problems(&graph("outside = \"ignore\"", ""));
    assert!(told.contains("\"ignore\" is not a choice"), "{told}");
}
