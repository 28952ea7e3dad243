//! Orders that a graph leaves open: compared on the same rows, chosen by a criterion, told and kept.

use std::ffi::OsStr;

use crate::workbench::{Graph, Scratch, athermal, athermal_on, numbers, own_oracle, plan};
use athermal::Instant;
use athermal::run::fit::{FitOptions, FitProgress, fit};
use athermal::run::recording::Table;
use serde_json::Value;

/// A graph that leaves open of how many steps back it reads, up to `most`.
fn graph_up_to(most: usize, by: &str, node: &str) -> String {
    graph(by, node).replace("1..6", &format!("1..{most}"))
}

fn graph(by: &str, node: &str) -> Graph {
    Graph::new()
        .time("time_s")
        .signal("output", "V", "y", "10s")
        .with("column = '{channel}'")
        .section("nodes.model", "inputs.truth = 'output.y'; ahead = '0s'")
        .with(node)
        .with(&format!("order = {{ by = '{by}', na = '1..6' }}"))
        .outputs("model = 'model'")
}

const AR: &str = r#"
type = "ar"
lags = ["10s", "20s", "30s", "40s", "50s", "1min"]
solver = { type = "ols" }
"#;
const ARMA: &str = "type = \"arma\"\nnc = 0";

fn expected() -> Vec<Value> {
    serde_json::from_str(&std::fs::read_to_string(own_oracle("orders/expected.json")).unwrap())
        .unwrap()
}

/// The table of orders that a fit told, and the text for people.
fn fitted(name: &str, graph: &str) -> (Value, String) {
    let (card, told) = fitted_card(name, graph);
    (card["orders"].clone(), told)
}

/// All that the model keeps of a fit, and the text for people.
fn fitted_card(name: &str, graph: &str) -> (Value, String) {
    let scratch = Scratch::new(&format!("orders-{name}"));
    let graph = scratch.file("graph.toml", graph);
    let (data, model) = (own_oracle("orders/series.csv"), scratch.path("model.json"));
    let told = athermal(&[&"fit", &graph, &"--data", &data, &"--output", &model]).ended(0);
    let text = std::fs::read_to_string(&model).unwrap();
    let model: Value = serde_json::from_str(&text).unwrap();
    (model["card"]["estimators"][0].clone(), told.out)
}

#[test]
fn each_order_is_told_as_it_is_gone_to() {
    let plan = plan(&graph("aic", "type = \"arma\"\nnc = 1"));
    let mut table = Table::default();
    let text = std::fs::read_to_string(own_oracle("orders/series.csv")).unwrap();
    for row in numbers(&text) {
        table.push(Instant::from_ns((row[0] * 1e9) as i64), &row[1..]);
    }
    let mut orders = Vec::new();
    fit(&plan, &table, &FitOptions::default(), &mut |progress| {
        if let FitProgress::Order { node, nth, of } = progress {
            orders.push((node.to_owned(), nth, of));
        }
    })
    .unwrap();
    let expected: Vec<_> = (1..=6).map(|nth| ("model".to_owned(), nth, 6)).collect();
    assert_eq!(orders, expected);
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
fn orders_are_compared_by_least_squares_whatever_the_solver() {
    let expected = expected();
    let least_squares = "solver = { type = \"ols\" }";
    for (solver, name) in [
        ("", "ridge"),
        ("solver = { type = \"ridge\", alpha = 100 }", "ridge"),
        ("solver = { type = \"sgd\" }", "sgd"),
    ] {
        let node = AR.replace(least_squares, solver);
        let (orders, told) = fitted("solvers", &graph("bic", &node));
        let told = told.split_whitespace().collect::<Vec<_>>().join(" ");
        for (tried, expected) in orders["tried"].as_array().unwrap().iter().zip(&expected) {
            let of = |value: &Value| value["aic"].as_f64().unwrap();
            let off = of(tried) / of(expected) - 1.0;
            assert!(off.abs() < 1e-6, "{solver}: {tried}, not {expected}");
        }
        assert!(
            told.contains("compared by ordinary least squares"),
            "{told}"
        );
        assert!(told.contains(&format!("fitted by `{name}`")), "{told}");
    }
    let (_, told) = fitted("solvers", &graph("bic", AR));
    assert!(!told.contains("compared by"), "{told}");
}

/// A model that is searched, of two features, with a penalty.
fn searched(penalty: &str) -> (Value, String) {
    let features = r#"
[nodes.before]
type = "lag"
inputs.signal = "output"
lags = ["100s"]
[nodes.model]
inputs.features = "before"
type = "armax"
nb = 1
nc = 0
"#;
    let graph = graph("bic", &format!("penalty = {penalty}")).replace("[nodes.model]", features);
    fitted_card(&format!("penalty-{penalty}"), &graph)
}

#[test]
fn orders_of_models_that_are_searched_are_compared_without_the_penalty() {
    let told = "orders are compared without the penalty, with which the chosen one is fitted";
    let line = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ");
    let (free, text) = searched("0.0");
    assert!(!line(&text).contains(told), "{text}");
    for penalty in ["1.0", "1000.0"] {
        let (found, text) = searched(penalty);
        assert_eq!(
            found["orders"], free["orders"],
            "with the penalty {penalty}"
        );
        assert!(line(&text).contains(told), "{text}");
        let error = |of: &Value| of["in_sample_rmse"].as_f64().unwrap();
        assert!(
            error(&found) > error(&free),
            "the chosen one is fitted with it"
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
        assert_eq!(tried["letters"]["na"], expected["na"]);
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
fn the_best_orders_are_told_first_and_all_of_many_where_they_are_asked_for() {
    let scratch = Scratch::new("orders-many");
    let graph = scratch.file("graph.toml", graph_up_to(12, "bic", ARMA));
    let (data, model) = (own_oracle("orders/series.csv"), scratch.path("model.json"));
    let orders = |more: &[&dyn AsRef<OsStr>]| -> Vec<usize> {
        let to: [&dyn AsRef<OsStr>; 2] = [&"-o", &model];
        let told = athermal_on("fit", &graph, &data, &[&to, more].concat()).ended(0);
        assert_eq!(
            told.out.contains("and 4 more"),
            more.is_empty(),
            "{}",
            told.out
        );
        let lines = told.out.lines();
        let orders = lines.filter_map(|line| line.trim().strip_prefix("na "));
        orders
            .map(|line| line.split(' ').next().unwrap().parse().unwrap())
            .collect()
    };
    let (best, all) = (orders(&[]), orders(&[&"--candidates"]));
    assert_eq!((best.len(), all.len()), (8, 12));
    assert_eq!(best, all[..8]);
    let kept: Value = serde_json::from_str(&std::fs::read_to_string(&model).unwrap()).unwrap();
    let tried = kept["card"]["estimators"][0]["orders"]["tried"].clone();
    let bic = |na: usize| tried[na - 1]["bic"].as_f64().unwrap();
    assert!(
        all.windows(2).all(|pair| bic(pair[0]) <= bic(pair[1])),
        "{all:?}"
    );
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
