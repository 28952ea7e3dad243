//! Every estimator names the features that say nothing, or nothing new.

#![allow(clippy::unwrap_used)]

mod workbench;

use std::fmt::Write;

use athermal::Model;
use athermal::core::fit::{FitOptions, Outcome, fit};
use athermal::core::node::{Kind, RoleName, kinds};
use athermal::files::{Dataset, Options};
use workbench::Scratch;

/// They choose among products of features, and a feature that was not chosen has no part in them.
const CHOOSING: [&str; 2] = ["narx", "polynomial"];

const SIGNALS: &str = r#"
schema = 1
name = "conditioning"

[time]
column = "time_s"

[signals.x]
unit = "K"
channels = ["wanders", "stays", "follows", "apart"]
max_age = "1s"

[signals.y]
unit = "nm"
channels = ["y"]
max_age = "1s"
"#;

/// Four features, of which one stays as it is and one is twice another, and what two of them bring about.
fn rows() -> String {
    let mut text = "time_s,wanders,stays,follows,apart,y\n".to_owned();
    for second in 0..400 {
        let t = f64::from(second);
        let (wanders, apart) = ((0.11 * t).sin() + (0.37 * t).cos(), (0.23 * t).sin());
        let y = 3.0 * wanders - apart + 0.1 * (1.7 * t * t).sin();
        let follows = 2.0 * wanders;
        writeln!(text, "{t},{wanders},20.5,{follows},{apart},{y}").unwrap();
    }
    text
}

#[test]
fn every_estimator_names_features_that_are_constant_or_the_same() {
    let scratch = Scratch::new("conditioning");
    let reads_features = |kind: &&Kind| {
        kind.role == RoleName::Estimator
            && !CHOOSING.contains(&kind.name)
            && (kind.inputs)().iter().any(|port| port.name == "features")
    };
    let kinds: Vec<&Kind> = kinds()
        .values()
        .flatten()
        .copied()
        .filter(reads_features)
        .collect();
    assert!(kinds.len() >= 12, "{kinds:?}");
    let (mut graph, mut outputs) = (SIGNALS.to_owned(), "[outputs]\n".to_owned());
    for Kind { name, .. } in &kinds {
        writeln!(
            graph,
            "[nodes.of-{name}]\ntype = \"{name}\"\nahead = \"0s\""
        )
        .unwrap();
        writeln!(graph, "inputs = {{ features = \"x\", truth = \"y.y\" }}").unwrap();
        if *name == "arx" {
            writeln!(graph, "lags = [\"1s\"]").unwrap();
        }
        writeln!(outputs, "{name} = \"of-{name}\"").unwrap();
    }
    let graph = scratch.file("graph.toml", graph + &outputs);
    let model = Model::load(graph).unwrap_or_else(|error| panic!("{error}"));
    let data = Dataset::new(vec![scratch.file("rows.csv", rows())], Options::default());
    let (_, report) = fit(&model.plan, &data, &FitOptions::default(), &mut |_| {}).unwrap();
    let mut silent = Vec::new();
    for estimator in &report.estimators {
        let Outcome::Fitted(told) = &estimator.outcome else {
            panic!("{estimator:?}");
        };
        let says = |words: &str| told.notes.iter().any(|note| note.contains(words));
        let named = says("constant, so without effect: x.stays")
            && says("nearly a combination of the others: x.follows");
        if !(named && told.condition.is_some_and(f64::is_infinite)) {
            silent.push((&estimator.node, told));
        }
    }
    assert_eq!(report.estimators.len(), kinds.len());
    assert!(silent.is_empty(), "{silent:#?}");
}
