use serde::Deserialize;

use super::*;
use crate::diagnostic::Sources;
use crate::document::tests::check_cases;
use crate::document::{Memory, load_text};
use crate::quantity::Quantity;
use crate::time::Duration;
use crate::unit::Unit;

#[derive(Debug, Clone, PartialEq, Deserialize)]
struct Parameters {
    ahead: Duration,
    unit: Unit,
    lags: Vec<Duration>,
    alpha: f64,
    below: Option<Quantity>,
    method: Option<Method>,
    folds: Option<u32>,
    solver: Option<Solver>,
    windows: Option<Windows>,
    shape: Option<Shape>,
    selection: Option<Selection>,
    stages: Option<Vec<Selection>>,
    pair: Option<(f64, f64)>,
    #[serde(default)]
    quiet: bool,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Method {
    Forward,
    Backward,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
enum Solver {
    Ridge { alpha: f64 },
    Sgd { rate: f64, every: Option<Duration> },
    Searched { alpha: Searched },
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(tag = "by", rename_all = "snake_case", deny_unknown_fields)]
enum Searched {
    Error { folds: u32 },
    Score,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(untagged)]
enum Windows {
    List(Vec<Duration>),
    Range { shortest: Duration, steps: u32 },
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Shape {
    Flat,
    Round { radius: f64 },
    Power(f64),
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
struct Selection {
    folds: u32,
    tolerance: f64,
    method: Method,
}

fn read(text: &str) -> (Option<Parameters>, String) {
    let (mut sources, mut diagnostics) = (Sources::new(), Diagnostics::new());
    let text = format!("schema = 1\n[node]\n{text}");
    let document = load_text(
        "a.toml",
        text,
        &Memory::new(),
        &mut sources,
        &mut diagnostics,
    )
    .expect("the text is TOML");
    let node = document
        .tree
        .as_table()
        .and_then(|tree| tree.get("node"))
        .expect("the text has a node");
    let parameters = decode(node, "node \"n\"", &mut diagnostics);
    assert_eq!(parameters.is_none(), diagnostics.has_errors());
    (parameters, diagnostics.render(&sources, false, 120))
}

#[test]
fn each_mistake_of_a_table_is_shown_where_it_stands() {
    check_cases(include_str!("mistakes.txt"), |files| {
        let (parameters, report) = read(&files[0].1);
        assert_eq!(parameters, None);
        report
    });
}

#[test]
fn a_table_without_mistakes_is_read() {
    let (parameters, report) = read(
        "ahead = \"5min\"\nunit = \"nm/min\"\nlags = [\"0s\", \"5min\"]\nalpha = 1\nbelow = \"150 nm/min\"\nmethod = \"forward\"\nfolds = 3\n\
         solver = { type = \"ridge\", alpha = 2 }\nwindows = { shortest = \"150s\", steps = 4 }\nshape = { round = { radius = 2.5 } }\n\
         pair = [1, 2.5]\nquiet = true",
    );
    assert_eq!(report, "");
    let five_minutes = Duration::from_ns(300_000_000_000);
    assert_eq!(
        parameters,
        Some(Parameters {
            ahead: five_minutes,
            unit: Unit::parse("nm/min").expect("it is a unit"),
            lags: vec![Duration::ZERO, five_minutes],
            alpha: 1.0,
            below: "150 nm/min".parse().ok(),
            method: Some(Method::Forward),
            folds: Some(3),
            solver: Some(Solver::Ridge { alpha: 2.0 }),
            windows: Some(Windows::Range {
                shortest: Duration::from_ns(150_000_000_000),
                steps: 4
            }),
            shape: Some(Shape::Round { radius: 2.5 }),
            selection: None,
            stages: None,
            pair: Some((1.0, 2.5)),
            quiet: true,
        })
    );
}

#[test]
fn a_model_stores_what_json_cannot_as_texts() {
    let (parameters, _) = read("ahead = \"0s\"\nunit = \"1\"\nlags = []\nalpha = \"inf\"");
    assert_eq!(
        parameters.map(|parameters| parameters.alpha),
        Some(f64::INFINITY)
    );
}
