//! Orders that a graph leaves open: compared on the same rows, chosen by a criterion, told and kept.

#![allow(clippy::unwrap_used)]

mod workbench;

use std::path::{Path, PathBuf};

use serde_json::Value;
use workbench::{Scratch, athermal};

fn oracle(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/oracles/orders");
    folder.join(name)
}

fn graph(by: &str, node: &str) -> String {
    format!(
        r#"
schema = 1
[time]
column = "time_s"
[signals.output]
unit = "V"
channels = ["y"]
column = "{{channel}}"
max_age = "10s"
[nodes.model]
inputs.truth = "output.y"
ahead = "0s"
{node}
order = {{ by = "{by}", na = "1..6" }}
[outputs]
model = "model"
"#
    )
}

const AR: &str = r#"
type = "ar"
lags = ["10s", "20s", "30s", "40s", "50s", "1min"]
solver = { type = "ols" }
"#;
const ARMA: &str = "type = \"arma\"\nnc = 0";

fn expected() -> Vec<Value> {
    serde_json::from_str(&std::fs::read_to_string(oracle("expected.json")).unwrap()).unwrap()
}

/// The table of orders that a fit told, and the text for people.
fn fitted(name: &str, graph: &str) -> (Value, String) {
    let scratch = Scratch::new(&format!("orders-{name}"));
    let graph = scratch.file("graph.toml", graph);
    let (data, model) = (oracle("series.csv"), scratch.path("model.json"));
    let told = athermal(&[&"fit", &graph, &"--data", &data, &"--output", &model]).ended(0);
    let text = std::fs::read_to_string(&model).unwrap();
    let model: Value = serde_json::from_str(&text).unwrap();
    let orders = &model["card"]["estimators"][0]["orders"];
    (orders.clone(), told.out)
}

#[test]
fn criteria_of_an_autoregression_equal_the_oracle_of_statsmodels() {
    let expected = expected();
    for (by, name) in [
        ("aic", "AIC"),
        ("aicc", "AICc"),
        ("bic", "BIC"),
        ("fpe", "FPE"),
    ] {
        let (orders, told) = fitted(by, &graph(by, AR));
        let tried = orders["tried"].as_array().unwrap();
        assert_eq!(tried.len(), expected.len());
        for (tried, expected) in tried.iter().zip(&expected) {
            assert_eq!(orders["rows"], expected["rows"]);
            for figure in ["aic", "aicc", "bic", "fpe"] {
                let (found, expected) = (&tried[figure], expected[figure].as_f64().unwrap());
                let off = found.as_f64().unwrap() / expected - 1.0;
                assert!(off.abs() < 1e-6, "{figure}: {found}, not {expected}");
            }
        }
        let best = expected.iter().enumerate().min_by(|a, b| {
            let of = |value: &Value| value[by].as_f64().unwrap();
            of(a.1).total_cmp(&of(b.1))
        });
        assert_eq!(orders["chosen"], best.unwrap().0, "{by}");
        assert_eq!(orders["by"], name);
        assert!(
            told.contains(&format!("smallest {name}, on 294 rows")),
            "{told}"
        );
    }
}

#[test]
fn the_search_for_a_model_without_a_moving_average_compares_as_least_squares_do() {
    let (orders, _) = fitted("search", &graph("bic", ARMA));
    let (tried, expected) = (orders["tried"].as_array().unwrap(), expected());
    assert_eq!(tried.len(), expected.len());
    for (tried, expected) in tried.iter().zip(&expected) {
        assert_eq!(tried["order"], format!("na {}", expected["na"]));
        for figure in ["aic", "bic"] {
            let (found, expected) = (
                tried[figure].as_f64().unwrap(),
                expected[figure].as_f64().unwrap(),
            );
            assert!(
                (found / expected - 1.0).abs() < 1e-6,
                "{figure}: {found}, not {expected}"
            );
        }
    }
}

#[test]
fn orders_that_the_kind_does_not_have_are_refused() {
    let scratch = Scratch::new("orders-wrong");
    let check = |node: &str, order: &str, parts: &[&str]| {
        let text = graph("aic", node).replace("na = \"1..6\"", order);
        let file = scratch.file("graph.toml", text);
        athermal(&[&"check", &file]).ended(2).tells(parts);
    };
    check(AR, "nc = \"0..2\"", &["this kind has no `nc`", "it has na"]);
    check(AR, "na = \"1..9\"", &["`na` is 1..9", "6 at most"]);
    check(ARMA, "na = \"6..1\"", &["`na` is 6..1"]);
    check(ARMA, "na = \"few\"", &["\"1..6\""]);
    check(
        ARMA,
        "na = \"0..99\", nc = \"0..99\"",
        &["10000 orders", "500"],
    );
}
