//! What every estimator does, fitted with its defaults: it names features that say nothing and does not miss them, and its model
//! may not be cut short.

use std::fmt::Write;

use crate::workbench::{Graph, Scratch, athermal};
use athermal::Model;
use athermal::core::node::{Kind, NodeKind, RoleName};
use athermal::core::registry::all;
use athermal::files::{Dataset, Options};
use athermal::run::fit::{FitOptions, FitReport, Outcome, fit};

/// They choose among products of features, and do not say which of them are alike.
const CHOOSING: [&str; 2] = ["narx", "polynomial"];

fn signals() -> Graph {
    Graph::named("every-estimator")
        .time("time_s")
        .signal("x", "K", "wanders stays follows apart", "1s")
        .signal("y", "nm", "y", "1s")
}

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

/// Each estimator of some kinds, fitted.
fn fitted(scratch: &Scratch, wanted: impl Fn(&Kind) -> bool) -> (Model, FitReport) {
    fitted_on(scratch, &rows(), &FitOptions::default(), wanted)
}

fn fitted_on(
    scratch: &Scratch,
    rows: &str,
    options: &FitOptions,
    wanted: impl Fn(&Kind) -> bool,
) -> (Model, FitReport) {
    let estimators = all::<NodeKind>();
    let estimators = estimators.filter(|kind| kind.role == RoleName::Estimator && wanted(kind));
    let (mut graph, mut outputs) = (signals().to_string(), "[outputs]\n".to_owned());
    for kind in estimators {
        let name = kind.name;
        writeln!(
            graph,
            "[nodes.of-{name}]\ntype = \"{name}\"\nahead = \"0s\""
        )
        .unwrap();
        for port in (kind.inputs)() {
            let from = match port.name {
                "features" => r#""x""#,
                "truth" => r#""y.y""#,
                "voters" => r#"["of-linear", "of-huber"]"#,
                _ => continue,
            };
            writeln!(graph, "inputs.{} = {from}", port.name).unwrap();
        }
        if ["ar", "arx", "narx"].contains(&name) {
            writeln!(graph, "lags = [\"1s\"]").unwrap();
        }
        writeln!(outputs, "{name} = \"of-{name}\"").unwrap();
    }
    let graph = scratch.file("graph.toml", graph + &outputs);
    let mut model = Model::load(graph).unwrap_or_else(|error| panic!("{error}"));
    let data = Dataset::new(vec![scratch.file("rows.csv", rows)], Options::default());
    let (fits, report) = fit(&model.plan, &data, options, &mut |_| {}).unwrap();
    model.fitted = fits;
    (model, report)
}

#[test]
fn every_estimator_names_features_that_are_constant_or_the_same() {
    let scratch = Scratch::new("every-estimator-names");
    let (_, report) = fitted(&scratch, reads_features);
    let mut silent = Vec::new();
    for estimator in &report.estimators {
        let Outcome::Fitted(told) = &estimator.outcome else {
            panic!("{estimator:?}");
        };
        let says = |words: &str| told.notes.iter().any(|note| note.contains(words));
        let alike = says("nearly a combination of the others: x.follows")
            && told.condition.is_some_and(f64::is_infinite);
        let alike = alike || CHOOSING.contains(&estimator.kind);
        if !(alike && says("constant, so without effect: x.stays")) {
            silent.push((&estimator.node, told));
        }
    }
    assert!(report.estimators.len() >= 14, "{report:#?}");
    assert!(silent.is_empty(), "{silent:#?}");
}

fn reads_features(kind: &Kind) -> bool {
    (kind.inputs)().iter().any(|port| port.name == "features")
}

/// The same rows without a value of one sensor from half of them on.
fn dying(rows: &str, column: usize) -> String {
    let dying = |(nth, row): (usize, &str)| {
        let mut cells: Vec<&str> = row.split(',').collect();
        if nth > 200 {
            cells[column] = "";
        }
        cells.join(",") + "\n"
    };
    rows.lines().enumerate().map(dying).collect()
}

/// Predictions as `athermal run` prints them, on rows.
fn predicted(scratch: &Scratch, model: &Model, rows: &str) -> String {
    let written = scratch.file("model.json", model.to_text().unwrap());
    let rows = scratch.file("run.csv", rows);
    athermal(&[&"run", &written, &"-i", &rows]).ended(0).out
}

#[test]
fn a_sensor_that_stayed_as_it_was_in_the_fit_is_missed_by_no_estimator() {
    let scratch = Scratch::new("every-estimator-dying");
    // It moved once, in a row that lacks something else: in those that count it stays.
    let moved = rows().replacen(",20.5,", ",20.7,", 1);
    let first = moved.lines().nth(1).unwrap();
    let lacking = first.rsplit_once(',').unwrap().0.rsplit_once(',').unwrap();
    let y = first.rsplit_once(',').unwrap().1;
    let moved = moved.replacen(first, &format!("{},,{y}", lacking.0), 1);
    let kept = FitOptions::default();
    let streamed = FitOptions {
        memory: 1 << 10,
        ..FitOptions::default()
    };
    // Others go over their rows again and again.
    let streams = ["linear", "rls", "arx", "kalman", "narx", "polynomial"];
    for (rows, options) in [(rows(), &kept), (moved.clone(), &kept), (moved, &streamed)] {
        let all = options.memory == kept.memory;
        let wanted = |kind: &Kind| all || streams.contains(&kind.name);
        let (model, report) = fitted_on(&scratch, &rows, options, wanted);
        for fit in &report.estimators {
            let is_fitted = matches!(fit.outcome, Outcome::Fitted(_));
            assert!(is_fitted && fit.streamed != all, "{fit:#?}");
        }
        let dead = predicted(&scratch, &model, &dying(&rows, 2));
        assert_eq!(predicted(&scratch, &model, &rows), dead);
        let last = dead.lines().last().unwrap();
        assert!(last.split(',').all(|cell| !cell.is_empty()), "{last}");
    }
}

/// Lists that may be of any length: the coefficients of polynomials in time, and how sure predictions are some steps ahead.
const FREE: [&str; 6] = ["a", "b", "c", "d", "f", "deviations"];

/// The places of lists that are not empty, as JSON pointers.
fn lists(value: &serde_json::Value, at: &str, found: &mut Vec<String>) {
    match value {
        serde_json::Value::Array(list) => {
            if !list.is_empty() {
                found.push(at.to_owned());
            }
            for (nth, value) in list.iter().enumerate() {
                lists(value, &format!("{at}/{nth}"), found);
            }
        }
        serde_json::Value::Object(table) => {
            for (key, value) in table {
                lists(value, &format!("{at}/{key}"), found);
            }
        }
        _ => {}
    }
}

#[test]
fn a_model_that_lacks_a_value_of_a_list_is_refused_by_the_name_of_the_node() {
    let scratch = Scratch::new("every-estimator-edited");
    let (model, _) = fitted(&scratch, |_| true);
    let text = model.to_text().unwrap();
    let model: serde_json::Value = serde_json::from_str(&text).unwrap();
    let (mut tried, mut taken) = (0, Vec::new());
    for (node, written) in model["fitted"].as_object().unwrap() {
        let mut places = Vec::new();
        lists(written, "", &mut places);
        for place in places {
            let mut edited = model.clone();
            let list = edited["fitted"][node].pointer_mut(&place).unwrap();
            list.as_array_mut().unwrap().pop();
            tried += 1;
            match Model::from_text("model.json", edited.to_string()) {
                Err(error) => {
                    let told = error.to_string();
                    assert!(told.contains(&format!("`{node}`: ")), "{place}: {told}");
                }
                Ok(_) => taken.push(format!("{node}{place}")),
            }
        }
    }
    // A product of fewer variables is a product.
    taken.retain(|place| {
        !place.contains("/terms/") && !FREE.contains(&place.rsplit('/').next().unwrap())
    });
    assert!(tried > 100, "{tried}");
    assert!(taken.is_empty(), "{taken:#?}");
}
