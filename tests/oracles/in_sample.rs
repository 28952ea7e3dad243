//! That the error which a fit tells of its rows is the one with which they are predicted, as far ahead and from the same truths.

use crate::workbench::{Graph, Scratch, athermal};
use serde_json::Value;

fn graph(node: &str) -> Graph {
    Graph::new()
        .time("time_s")
        .signal("input", "V", "a", "10s")
        .signal("output", "V", "y", "10s")
        .section("nodes.model", "inputs.truth = 'output.y'")
        .with(node)
        .outputs("model = 'model'")
}

/// A series that follows an input, every 10 s: so many rows from one on. One in so many is a spike, none where that is 0.
fn csv(from: usize, rows: usize, spikes: usize) -> String {
    let mut state = 12_345_u64;
    let mut random = move || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (state >> 33) as f64 / f64::from(1 << 30) - 1.0
    };
    let (mut lines, mut y) = (String::from("time_s,a,y\n"), 0.0);
    for nth in 0..from + rows {
        let a = random();
        y = 0.9 * y + 0.3 * a + random();
        if nth >= from {
            let spike = spikes > 0 && nth % spikes == spikes - 1;
            let told = if spike { y + 80.0 } else { y };
            lines.push_str(&format!("{},{a},{told}\n", 10 * (nth - from)));
        }
    }
    lines
}

fn of_model(all: &Value) -> Value {
    let mut all = all.as_array().unwrap().iter();
    all.find(|of| of["node"] == "model").unwrap().clone()
}

/// What a fit on two segments tells of a model, and its score on the same rows.
fn fitted_and_scored(scratch: &Scratch, node: &str, spikes: usize) -> (Value, Value) {
    let first = scratch.file("first.csv", csv(0, 250, spikes));
    let second = scratch.file("second.csv", csv(250, 150, spikes));
    let graph = scratch.file("graph.toml", self::graph(node));
    let model = scratch.path("model.json");
    let fit = athermal(&[
        &"fit",
        &graph,
        &"--data",
        &first,
        &second,
        &"-o",
        &model,
        &"--format",
        &"json",
    ]);
    let fit = of_model(&fit.ended(0).json()["estimators"]);
    let score = athermal(&[
        &"evaluate",
        &model,
        &"--data",
        &first,
        &second,
        &"--each-on-its-own",
        &"--format",
        &"json",
    ]);
    (fit, of_model(&score.ended(0).json()["scores"]))
}

#[test]
fn the_error_of_a_fit_of_what_follows_truths_is_that_of_evaluating_it_on_the_same_rows() {
    let scratch = Scratch::new("in-sample");
    let features = "inputs.features = \"input.a\"";
    for (kind, more) in [
        ("arma", ""),
        ("armax", features),
        ("arimax", features),
        ("bj", features),
        ("oe", features),
        ("state_space", features),
        // Nothing fades in it between the truths of an evaluation.
        ("kalman", "memory = \"100000d\""),
        (
            "kalman",
            "memory = \"100000d\"\ninputs.features = \"input.a\"",
        ),
        ("kalman", "memory = \"100000d\"\ntrend = true"),
    ] {
        for (ahead, learn, spikes) in [
            ("30s", "", 0),
            ("30s", "learn = false", 0),
            ("10s", "", 0),
            ("30s", "", 90),
            ("10s", "", 90),
            ("10s", "learn = { outliers = inf }", 90),
        ] {
            let node = format!("type = \"{kind}\"\nahead = \"{ahead}\"\n{more}\n{learn}");
            let (fit, score) = fitted_and_scored(&scratch, &node, spikes);
            let told = fit["in_sample_rmse"].as_f64().unwrap();
            let scored = score["rmse"].as_f64().unwrap();
            assert!(
                (told / scored - 1.0).abs() < 1e-9,
                "{node}, {spikes}: {told}, and {scored} as it is scored"
            );
        }
    }
}

#[test]
fn the_error_one_step_ahead_is_told_beside_that_of_a_longer_horizon_and_not_where_it_is_the_same() {
    let scratch = Scratch::new("in-sample-one-step");
    let fit = |ahead: &str| {
        let node = format!("type = \"arma\"\nahead = \"{ahead}\"");
        fitted_and_scored(&scratch, &node, 0).0
    };
    let (near, far) = (fit("10s"), fit("30s"));
    let figure = |of: &Value| of["figures"]["rmse_one_step_ahead"].as_f64();
    assert_eq!(figure(&near), None);
    let one_step = figure(&far).unwrap();
    let error = |of: &Value| of["in_sample_rmse"].as_f64().unwrap();
    // The same model, found on two rows less in each segment.
    assert!((one_step / error(&near) - 1.0).abs() < 0.02);
    assert!(error(&far) > 1.4 * one_step, "{far}");
    let notes: Vec<&str> = far["notes"]
        .as_array()
        .unwrap()
        .iter()
        .map(|of| of.as_str().unwrap())
        .collect();
    let told =
        "V; it predicts 3 steps after the newest truth, and the in-sample RMSE is that of this";
    assert!(notes.iter().any(|note| note.ends_with(told)), "{notes:?}");
}
