//! What `fit --format json` gives to programs: every figure that people are told in a sentence stands there by its name.

use std::fmt::Write as _;
use std::path::PathBuf;

use crate::workbench::{Graph, Scratch, athermal};
use serde_json::Value;

fn signals() -> Graph {
    Graph::new()
        .time("s")
        .signal("x", "K", "wanders stays follows apart", "1s")
        .signal("y", "nm", "y", "1s")
        .outputs("mix = 'mix'")
}

const FEATURES: &str = "inputs.features = \"x\"\n";

/// Nodes that choose, search or leave out, so that there is much to tell, by name; with features or without.
const NODES: [(&str, bool, &str); 14] = [
    (
        "by_folds",
        true,
        "type = \"linear\"\nsolver = { type = \"ridge\", alpha = { by = \"cross_validation\", folds = 4 } }",
    ),
    (
        "by_rows",
        true,
        "type = \"linear\"\nsolver = { type = \"ridge\", alpha = { by = \"generalised_cross_validation\" } }",
    ),
    (
        "ordinary",
        true,
        "type = \"linear\"\nsolver = { type = \"ols\" }",
    ),
    (
        "backward",
        true,
        "type = \"linear\"\nselection = { method = \"backward\", folds = 5, one_standard_error = true }",
    ),
    (
        "bad",
        true,
        "type = \"linear\"\nsolver = { type = \"sgd\", eta0 = 1.0, power = 0.0, epochs = 1 }",
    ),
    ("sparse", true, "type = \"lasso\""),
    ("robust", true, "type = \"huber\""),
    ("noises", true, "type = \"kalman\""),
    (
        "trend",
        false,
        "type = \"kalman\"\ntrend = true\nevery = \"1s\"",
    ),
    (
        "own",
        false,
        "type = \"ar\"\nlags = [\"1s\", \"2s\", \"3s\"]\norder = { na = \"1..3\" }",
    ),
    (
        "noise",
        true,
        "type = \"armax\"\nnc = 1\norder = { na = \"1..2\" }",
    ),
    ("states", true, "type = \"state_space\""),
    ("products", true, "type = \"narx\"\nlags = [\"1s\"]"),
    (
        "mix",
        false,
        "type = \"stack\"\ninputs.voters = [\"by_folds\", \"robust\"]",
    ),
];

fn graph() -> String {
    let mut graph = signals().to_string();
    for (name, has_features, node) in NODES {
        let features = if has_features { FEATURES } else { "" };
        writeln!(
            graph,
            "[nodes.{name}]\n{node}\n{features}inputs.truth = \"y.y\"\nahead = \"0s\""
        )
        .unwrap();
    }
    graph
}

/// Four features, of which one stays as it is and one is twice another, and what two of them bring about; a truth far off now
/// and then.
fn rows() -> String {
    let mut text = "s,wanders,stays,follows,apart,y\n".to_owned();
    for second in 0..400 {
        let t = f64::from(second);
        let (wanders, apart) = ((0.11 * t).sin() + (0.37 * t).cos(), (0.23 * t).sin());
        let far = if second % 40 == 7 { 5.0 } else { 0.0 };
        let y = 3.0 * wanders - apart + 0.1 * (1.7 * t * t).sin() + far;
        let follows = 2.0 * wanders;
        writeln!(text, "{t},{wanders},20.5,{follows},{apart},{y}").unwrap();
    }
    text
}

/// What the program tells of each node, and the model.
fn fitted(scratch: &Scratch) -> (Value, PathBuf) {
    let graph = scratch.file("graph.toml", graph());
    let (data, model) = (scratch.file("rows.csv", rows()), scratch.path("model.json"));
    let fit = athermal(&[
        &"fit",
        &graph,
        &"--data",
        &data,
        &"-o",
        &model,
        &"--format",
        &"json",
    ])
    .ended(0);
    let told = fit.json()["estimators"].clone();
    let kept: Value = serde_json::from_slice(&std::fs::read(&model).unwrap()).unwrap();
    let kept = kept["card"]["estimators"].as_array().unwrap();
    for (told, kept) in told.as_array().unwrap().iter().zip(kept) {
        assert_eq!(
            told["figures"], kept["figures"],
            "the card of a model has them too"
        );
    }
    (told, model)
}

fn told(name: &str) -> Vec<Value> {
    let (told, _) = fitted(&Scratch::new(name));
    told.as_array().unwrap().clone()
}

/// The numbers that stand in a sentence, each as it is written; lengths of time, and what belongs to a name, are none.
fn numbers(sentence: &str) -> Vec<&str> {
    let edges = |c: char| ",;:()\"{}".contains(c);
    let words = sentence
        .split_whitespace()
        .map(|word| word.trim_matches(edges));
    words.filter(|word| word.parse::<f64>().is_ok()).collect()
}

/// All numbers of a value.
fn values(of: &Value, found: &mut Vec<f64>) {
    match of {
        Value::Number(number) => found.push(number.as_f64().unwrap()),
        Value::Array(list) => list.iter().for_each(|of| values(of, found)),
        Value::Object(table) => table.values().for_each(|of| values(of, found)),
        Value::String(text) => found.extend(text.parse::<f64>().ok()),
        Value::Bool(_) | Value::Null => {}
    }
}

/// Whether a number is what another looks like when it is rounded to as many digits.
fn is_rounded(written: &str, value: f64) -> bool {
    let (mantissa, _) = written.split_once('e').unwrap_or((written, ""));
    let after = mantissa
        .split_once('.')
        .map_or(0, |(_, digits)| digits.len());
    [
        format!("{value:.after$}"),
        format!("{value:.after$e}"),
        format!("{value:e}"),
        format!("{value}"),
        format!("{:.3e}", value).parse::<f64>().unwrap().to_string(),
    ]
    .contains(&written.to_owned())
}

#[test]
fn every_number_in_a_sentence_of_a_fit_is_a_figure_by_name() {
    let (mut seen, mut missing) = (0, Vec::new());
    for estimator in told("fit-json-numbers") {
        let mut figures = Vec::new();
        values(&estimator["figures"], &mut figures);
        values(&estimator["rows"], &mut figures);
        let steps = estimator["selection"].as_array().map_or(0, Vec::len);
        figures.push(steps as f64);
        let notes = estimator["notes"].as_array().cloned().unwrap_or_default();
        for note in notes.iter().map(|note| note.as_str().unwrap()) {
            for number in numbers(note) {
                seen += 1;
                if !figures.iter().any(|&figure| is_rounded(number, figure)) {
                    missing.push(format!("{}: {number} of `{note}`", estimator["node"]));
                }
            }
        }
    }
    assert!(seen > 30, "{seen}");
    assert!(missing.is_empty(), "{missing:#?}");
}

#[test]
fn the_guide_says_what_every_figure_is() {
    let guide = include_str!("../../docs/src/fitting.md");
    let table = guide.lines().filter(|line| line.starts_with("| `"));
    let mut named: Vec<&str> = table
        .flat_map(|line| {
            line.split('|')
                .nth(1)
                .unwrap()
                .split('`')
                .skip(1)
                .step_by(2)
        })
        .collect();
    named.sort_unstable();
    let estimators = told("fit-json-names");
    let figures = estimators.iter().filter_map(|of| of["figures"].as_object());
    let mut unnamed: Vec<&String> = figures
        .flat_map(|of| of.keys())
        .filter(|name| named.binary_search(&name.as_str()).is_err())
        .collect();
    unnamed.dedup();
    assert!(unnamed.is_empty(), "not in the guide: {unnamed:?}");
}

#[test]
fn figures_are_what_the_model_computes_with() {
    let scratch = Scratch::new("fit-json-values");
    let (all, model) = fitted(&scratch);
    let show = athermal(&[&"show", &model, &"--format", &"json"]).ended(0);
    let shown = show.json();
    let of = |all: &Value, node: &str| -> Value {
        let mut all = all.as_array().unwrap().iter();
        all.find(|of| of["node"] == node).unwrap().clone()
    };
    let figures = |node: &str| of(&all, node)["figures"].clone();
    let shown = |node: &str| of(&shown["estimators"], node);

    let weights = figures("mix")["weights"].clone();
    let voters = shown("mix")["coefficients"].as_array().unwrap().clone();
    assert_eq!(voters.len(), 2);
    for voter in voters {
        assert_eq!(weights[voter["name"].as_str().unwrap()], voter["value"]);
    }
    let noises = figures("trend")["noises"].clone();
    let walks = shown("trend")["noises"].as_array().unwrap().clone();
    assert_eq!(walks.len(), 3);
    for walk in walks {
        assert_eq!(noises[walk["name"].as_str().unwrap()], walk["deviation"]);
    }
    assert_eq!(noises["per_s"], 3600.0);
    // One is 20.5 throughout, and one is twice another.
    assert_eq!(figures("ordinary")["constant"][0], "x.stays");
    assert_eq!(figures("ordinary")["collinear"][0], "x.follows");
    assert_eq!(figures("ordinary")["rank"], 2);
    assert_eq!(figures("sparse")["features"], 3);
    let values = figures("states")["singular_values"].clone();
    let values: Vec<f64> = values
        .as_array()
        .unwrap()
        .iter()
        .filter_map(Value::as_f64)
        .collect();
    assert!(
        values.len() == 10 && values.is_sorted_by(|a, b| a >= b),
        "{values:?}"
    );
}

#[test]
fn a_filter_that_follows_some_of_the_rows_says_what_it_found_on_how_many() {
    let scratch = Scratch::new("fit-some-rows");
    let node = "[nodes.noises]\ntype = \"kalman\"\n";
    let signals = signals().replace("\"mix\"", "\"noises\"");
    let graph = format!("{signals}{node}{FEATURES}inputs.truth = \"y.y\"\nahead = \"0s\"\n");
    let (graph, data) = (
        scratch.file("graph.toml", graph),
        scratch.file("rows.csv", rows()),
    );
    let model = scratch.path("model.json");
    let fit = |more: &[&dyn AsRef<std::ffi::OsStr>]| {
        let all: [&dyn AsRef<std::ffi::OsStr>; 6] =
            [&"fit", &graph, &"--data", &data, &"-o", &model];
        let fit = athermal(&[&all, more].concat()).ended(0);
        fit.out.split_whitespace().collect::<Vec<_>>().join(" ")
    };
    let some = fit(&[&"--memory", &"0"]);
    // 400 rows are halved until at most 16 are left.
    for part in [
        "400 rows",
        "variances and coefficients were found on 13 rows, one in 32 of all",
        "condition number and what is said of regressors are of these alone",
        "a larger `--memory`",
    ] {
        assert!(some.contains(part), "`{part}` is not in: {some}");
    }
    assert!(!fit(&[]).contains("were found on"));
}
