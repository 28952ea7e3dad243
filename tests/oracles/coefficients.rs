//! What `show --format coefficients` tells is the model that runs: from the coefficients follow its predictions, and of models that
//! are identified they are those of the oracle, in the units of the data.

use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use crate::workbench::{
    Finished, Graph, Scratch, athermal, fitted, numbers, plan, regression, secs,
};
use athermal::core::node::Of;
use athermal::run::recording::Table;
use serde_json::Value;

fn signals() -> Graph {
    Graph::new()
        .time("row")
        .with("step = '1min'")
        .signal(
            "temperature",
            "Cel",
            "room column_beside_the_measuring_head",
            "1 sample",
        )
        .signal("heater", "V", "voltage", "1 sample")
        .signal("position", "nm", "Z", "1 sample")
}

/// Every kind whose prediction is a sum of terms, with its parameters, and one that has polynomials.
const NODES: [(&str, &str); 15] = [
    ("ols", "type = \"linear\"\nsolver = { type = \"ols\" }"),
    ("ridge", "type = \"linear\""),
    ("descent", "type = \"linear\"\nsolver = { type = \"sgd\" }"),
    ("huber", "type = \"huber\""),
    ("lasso", "type = \"lasso\"\nalpha = 0.05"),
    ("elastic", "type = \"elastic_net\"\nalpha = 0.05"),
    ("rls", "type = \"rls\"\nlearn = false\nlags = [\"1min\"]"),
    ("kalman", "type = \"kalman\"\nlearn = false"),
    (
        "arx",
        "type = \"arx\"\nlags = [\"1min\", \"2min\"]\nfeature_lags = [\"0s\", \"2min\"]",
    ),
    ("ar", "type = \"ar\"\nlags = [\"1min\", \"2min\"]"),
    ("polynomial", "type = \"polynomial\""),
    (
        "narx",
        "type = \"narx\"\nlags = [\"1min\"]\ntolerance = 1e-7",
    ),
    ("last", "type = \"persistence\""),
    // Its votes on these rows are not those out of fold that it was fitted on.
    ("stack", "type = \"stack\"\noutside = \"pass\""),
    ("armax", "type = \"armax\"\nna = 2"),
];

fn graph() -> Graph {
    let graph = NODES.iter().fold(signals(), |graph, (name, node)| {
        let graph = graph.section(&format!("nodes.{name}"), node);
        let graph = match *name {
            "ar" | "last" => graph,
            "stack" => graph.with("inputs.voters = ['ols', 'ar']"),
            _ => graph.with("inputs.features = ['temperature', 'heater']"),
        };
        graph.with("inputs.truth = 'position.Z'; ahead = '0s'")
    });
    let outputs = NODES.map(|(name, _)| format!("{name} = '{name}'"));
    graph.outputs(&outputs.join("; "))
}

/// Temperatures, a voltage, and a position that follows from them and from its own past, with products and noise.
fn rows() -> Vec<[f64; 4]> {
    let mut random = 7_u64;
    let mut noise = move || {
        random = random
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (random >> 33) as f64 / f64::from(1_u32 << 31) - 0.5
    };
    let mut z = 300.0;
    let row = |nth: u32| {
        let t = f64::from(nth);
        let room = 20.0 + 3.0 * (0.05 * t).sin() + noise();
        let column = 25.0 + 2.0 * (0.031 * t).cos() + 0.5 * noise();
        let volts = 5.0 + 4.0 * noise();
        let bent = 0.8 * (room - 20.0) * (volts - 5.0);
        z = 0.6 * z + 12.0 * (room - 20.0) - 7.0 * (column - 25.0)
            + 3.0 * volts
            + bent
            + 20.0 * noise()
            + 100.0;
        [room, column, volts, z]
    };
    (0..400).map(row).collect()
}

/// A model of all kinds, fitted by the program, and the data.
fn model(scratch: &Scratch) -> (PathBuf, PathBuf) {
    let lines = rows().into_iter().enumerate();
    let lines: Vec<String> = lines
        .map(|(nth, [a, b, c, z])| format!("{nth},{a},{b},{c},{z}"))
        .collect();
    let header = "row,room,column_beside_the_measuring_head,voltage,Z";
    let data = scratch.file("data.csv", format!("{header}\n{}\n", lines.join("\n")));
    let (graph, model) = (
        scratch.file("graph.toml", graph()),
        scratch.path("model.json"),
    );
    athermal(&[&"fit", &graph, &"--data", &data, &"-o", &model, &"-q"]).ended(0);
    (model, data)
}

fn show(model: &Path, format: &str) -> Finished {
    athermal(&[&"show", &model, &"--format", &format])
}

/// The sum that the coefficients stand for at a row; `value` tells that of a regressor.
fn sum(estimator: &Value, value: impl Fn(&str) -> f64) -> f64 {
    let terms = estimator["coefficients"].as_array().unwrap().iter();
    let term = |term: &Value| {
        let factors = term["factors"].as_array().into_iter().flatten();
        let factors = factors.map(|factor| {
            let held = |nth: usize, open: f64| factor["held"][nth].as_f64().unwrap_or(open);
            let x = value(factor["regressor"].as_str().unwrap());
            let x = x
                .max(held(0, f64::NEG_INFINITY))
                .min(held(1, f64::INFINITY));
            x - factor["about"].as_f64().unwrap_or(0.0)
        });
        term["value"].as_f64().unwrap() * factors.product::<f64>()
    };
    terms.map(term).sum()
}

#[test]
fn predictions_follow_from_the_coefficients_that_are_shown() {
    let scratch = Scratch::new("coefficients-round-trip");
    let (model, data) = model(&scratch);
    let shown = show(&model, "json").ended(0).json();
    let run = athermal(&[&"run", &model, &"-i", &data]).ended(0);
    let mut lines = run.out.lines();
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    let told: Vec<BTreeMap<&str, f64>> = lines
        .map(|line| {
            let cells = line.split(',').map(|cell| cell.parse().unwrap_or(f64::NAN));
            names.iter().copied().zip(cells).collect()
        })
        .collect();
    let measured = [
        "temperature.room",
        "temperature.column_beside_the_measuring_head",
        "heater.voltage",
        "position.Z",
    ];
    let rows = rows();
    let mut checked = 0;
    for estimator in shown["estimators"].as_array().unwrap() {
        let node = estimator["node"].as_str().unwrap();
        if estimator["step_s"].is_number() {
            continue;
        }
        for (nth, told) in told.iter().enumerate().skip(10) {
            let expected = told[&*format!("{node}.Z")];
            let value = |name: &str| {
                let (channel, lag) = name.split_once(" lag ").unwrap_or((name, "0min"));
                let back: usize = lag
                    .trim_end_matches("min")
                    .trim_end_matches("0s")
                    .parse()
                    .unwrap_or(0);
                let column = measured.iter().position(|known| *known == channel);
                column.map_or_else(|| told[channel], |column| rows[nth - back][column])
            };
            let found = sum(estimator, value);
            assert!(
                (found - expected).abs() < 1e-9 * expected.abs(),
                "{node}, row {nth}: {found}, not {expected}"
            );
        }
        checked += 1;
    }
    // Neither `persistence`, which is not fitted, nor the one with polynomials.
    assert_eq!(checked, NODES.len() - 2, "{shown:#}");
}

#[test]
fn the_table_fits_the_terminal_and_says_what_each_number_is() {
    let scratch = Scratch::new("coefficients-table");
    let (model, _) = model(&scratch);
    let text = show(&model, "coefficients").ended(0).out;
    assert!(
        text.lines().all(|line| line.chars().count() <= 80),
        "{text}"
    );
    insta::assert_snapshot!(text);
}

#[test]
fn coefficients_of_some_nodes_are_told_alone_and_a_name_that_none_has_is_told() {
    let scratch = Scratch::new("coefficients-of-some");
    let (model, _) = model(&scratch);
    let of = |nodes: &[&str], format: &str| {
        let mut words: Vec<&dyn AsRef<OsStr>> = vec![&"show", &model, &"--format"];
        words.push(&format);
        words.extend(
            nodes
                .iter()
                .flat_map(|node| [&"--node" as &dyn AsRef<OsStr>, node]),
        );
        athermal(&words)
    };
    let two = of(&["ridge", "lasso"], "coefficients").ended(0).out;
    let heads = two.lines().filter(|line| line.contains(" of position.Z)"));
    let heads: Vec<&str> = heads.map(|line| line.split(' ').next().unwrap()).collect();
    assert_eq!(heads, ["ridge", "lasso"], "{two}");
    let one = of(&["ar"], "json").ended(0).json();
    assert_eq!(one["estimators"].as_array().unwrap().len(), 1);
    let unknown = of(&["rigde"], "coefficients");
    unknown
        .ended(2)
        .tells(&["`rigde`, did you mean `ridge`?", "polynomial"]);
    of(&["ridge"], "svg")
        .ended(2)
        .tells(&["--format coefficients"]);
}

#[test]
fn a_polynomial_without_standard_errors_is_said_to_be_held_by_its_bound() {
    let scratch = Scratch::new("coefficients-bounded");
    let (model, _) = model(&scratch);
    let why = "polynomials without one are held by the bound of stability, or the rows hardly\ndetermine them";
    let told = show(&model, "coefficients").ended(0).out;
    assert!(!told.contains(why), "{told}");
    let mut written: Value =
        serde_json::from_str(&std::fs::read_to_string(&model).unwrap()).unwrap();
    let errors = written.pointer_mut("/fitted/armax/errors").unwrap();
    assert_eq!(errors["c"].as_array().unwrap().len(), 1);
    errors["c"] = serde_json::json!([]);
    let bounded = scratch.file("bounded.json", written.to_string());
    let told = show(&bounded, "coefficients").ended(0).out;
    assert!(told.contains(why), "{told}");
}

#[test]
fn a_graph_that_is_not_fitted_has_no_coefficients() {
    let scratch = Scratch::new("coefficients-unfitted");
    let graph = scratch.file("graph.toml", graph());
    show(&graph, "coefficients")
        .ended(2)
        .tells(&["graph.toml", "need a fit", "athermal fit"]);
    assert!(
        show(&graph, "json")
            .ended(0)
            .json()
            .get("estimators")
            .is_none()
    );
}

#[test]
fn polynomials_and_their_standard_errors_are_those_of_the_oracle_in_the_units_of_the_data() {
    let text = include_str!("prediction_error/samples.csv");
    let expected = include_str!("prediction_error/expected.json");
    let expected: Value = serde_json::from_str(expected).unwrap();
    let header: Vec<&str> = text.lines().next().unwrap().split(',').collect();
    for (name, orders, letters) in [
        ("armax", "na = 2\nnb = 2\nnc = 1", "AABBC"),
        ("oe", "nb = 2\nnf = 2", "BBFF"),
        ("bj", "nb = 2\nnf = 1\nnc = 1\nnd = 1", "BBFCD"),
        ("arimax", "na = 1\nnb = 2\nnc = 1\ndifferences = 1", "ABBC"),
    ] {
        let column = header.iter().position(|known| *known == name).unwrap();
        let mut table = Table::default();
        for (second, row) in numbers(text).iter().enumerate() {
            table.push(secs(second as f64), &[row[0], row[column]]);
        }
        let node =
            format!("type = \"{name}\"\n{orders}\nnk = 1\npenalty = 0.0\ninputs.features = \"x\"");
        let (predictor, _) = fitted(&plan(&regression(&["u"], &node)), &table);
        let found = predictor.coefficients().unwrap();
        let has_level = usize::from(name != "arimax");
        let told: String = found.terms[has_level..]
            .iter()
            .map(|term| match term.of {
                Of::Power { polynomial, .. } => polynomial,
                _ => '?',
            })
            .collect();
        assert_eq!(told, letters);
        let list = |what: &str| -> Vec<f64> {
            let list = expected[name]["scipy"][what].as_array().unwrap();
            list.iter().map(|value| value.as_f64().unwrap()).collect()
        };
        let wanted = list("coefficients").into_iter().zip(list("errors"));
        for (nth, (term, (value, error))) in found.terms.iter().zip(wanted).enumerate() {
            // What is known of starts, of which the oracle knows nothing, moves a coefficient by next to nothing of its error.
            assert!(
                (term.value - value).abs() < 5e-5_f64.max(1e-3 * error),
                "{name}: {term:?}, not {value}"
            );
            // The constant of a model with inputs has none.
            let near = |found: f64| (found / error - 1.0).abs() < 5e-3;
            assert!(
                nth < has_level || term.error.is_some_and(near),
                "{name}: {term:?}, not {error}"
            );
        }
        assert_eq!(found.terms.len(), list("errors").len());
    }
}

#[test]
fn a_penalty_next_to_nothing_gives_a_kalman_filter_the_coefficients_of_none() {
    let mut table = Table::default();
    for (second, [room, column, volts, _]) in rows().into_iter().enumerate() {
        let alike = room + 0.01 * (column - 25.0);
        let z = 2.0 * room - alike + 0.1 * volts;
        table.push(secs(second as f64), &[room, alike, z]);
    }
    let of = |penalty: &str| -> Vec<f64> {
        let node = format!(
            "type = \"kalman\"\nlearn = false\npenalty = {penalty}\ninputs.features = \"x\""
        );
        let (predictor, _) = fitted(&plan(&regression(&["room", "alike"], &node)), &table);
        let terms = predictor.coefficients().unwrap().terms;
        terms.iter().map(|term| term.value).collect()
    };
    let none = of("0.0");
    for penalty in ["1e-12", "1e-14", "1e-16", "1e-30"] {
        assert_eq!(of(penalty), none, "{penalty}");
    }
}
