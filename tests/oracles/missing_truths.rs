//! Identified models of a log in which truths are missing here and there.

use std::sync::Arc;

use crate::workbench::{own_oracle, plan, regression, secs};
use athermal::core::node::TrainingReport;
use athermal::run::fit::{FitOptions, Outcome, fit};
use athermal::run::recording::Table;
use serde_json::Value;

/// The rows of the oracle: two inputs, and what each of its models leads to, NaN where it is missing.
fn rows() -> Vec<Vec<f64>> {
    let text = std::fs::read_to_string(own_oracle("missing_fit/samples.csv")).unwrap();
    let rows = text.lines().skip(1);
    rows.map(|line| {
        let cells = line.split(',');
        cells.map(|cell| cell.parse().unwrap_or(f64::NAN)).collect()
    })
    .collect()
}

/// The models of the oracle with the columns of their truths, and the nodes that find them.
const MODELS: [(&str, usize, &str); 5] = [
    ("oe", 2, "type = \"oe\"\ninputs.features = \"x\""),
    ("bj", 3, "type = \"bj\"\ninputs.features = \"x.u1\"\nnk = 1"),
    ("arma", 4, "type = \"arma\"\nna = 2"),
    (
        "armax",
        5,
        "type = \"armax\"\ninputs.features = \"x.u1\"\nna = 2\nnk = 1",
    ),
    (
        "arimax",
        6,
        "type = \"arimax\"\ninputs.features = \"x.u1\"\ndifferences = 1",
    ),
];

/// The model as it is written, and what was told of its fit to such truths.
fn fitted(
    node: &str,
    truth: impl Fn(&[f64]) -> f64,
    options: &FitOptions,
) -> (Value, TrainingReport) {
    let penalty = if node.contains("features") {
        "penalty = 0.0\n"
    } else {
        ""
    };
    let plan = plan(&regression(&["u1", "u2"], &format!("{penalty}{node}")));
    let mut table = Table::default();
    for (second, row) in rows().iter().enumerate() {
        table.push(secs(second as f64), &[row[0], row[1], truth(row)]);
    }
    let (fitted, mut report) = fit(&Arc::clone(&plan), &table, options, &mut |_| {}).unwrap();
    let Outcome::Fitted(report) = report.estimators.remove(0).outcome else {
        panic!("{report:?}");
    };
    let predictor = fitted.values().next().unwrap();
    (serde_json::to_value(&**predictor).unwrap(), report)
}

fn numbers(of: &Value) -> Vec<f64> {
    let all = of.as_array().unwrap().iter();
    all.map(|number| number.as_f64().unwrap()).collect()
}

#[test]
fn a_log_with_empty_cells_gives_the_models_of_the_exact_likelihood() {
    let expected = std::fs::read_to_string(own_oracle("missing_fit/expected.json")).unwrap();
    let expected: Value = serde_json::from_str(&expected).unwrap();
    for (name, column, node) in MODELS {
        let (written, report) = fitted(node, |row| row[column], &FitOptions::default());
        let model = &written["model"];
        let scales = numbers(&written["scaling"]["scales"]);
        let mut found = numbers(&model["a"]);
        for (input, scale) in model["inputs"].as_array().unwrap().iter().zip(&scales) {
            found.extend(numbers(&input["b"]).iter().map(|b| b / scale));
            found.extend(numbers(&input["f"]));
        }
        found.extend(numbers(&model["c"]));
        found.extend(numbers(&model["d"]));
        let errors = numbers(&expected[name]["errors"]);
        let coefficients = numbers(&expected[name]["coefficients"]);
        assert_eq!(found.len(), coefficients.len(), "{name}");
        for ((found, expected), error) in found.iter().zip(&coefficients).zip(&errors) {
            let near = (found - expected).abs() < 0.25 * error;
            assert!(near, "{name}: {found}, not {expected} ± {error}");
        }
        let missing = rows().iter().filter(|row| row[column].is_nan()).count();
        let told = format!("at {missing} of its samples the truth is missing");
        let notes = &report.notes;
        assert!(
            notes.iter().any(|note| note.starts_with(&told)),
            "{notes:?}"
        );
        assert!(
            !notes.iter().any(|note| note.contains("pieces")),
            "{notes:?}"
        );
        // One step ahead, where there is noise that is followed, a prediction after a gap errs more than by an innovation.
        let deviation = expected[name]["deviation"].as_f64().unwrap();
        let ratio = report.in_sample_rmse.unwrap() / deviation;
        let more = if name == "oe" { 0.99..1.01 } else { 1.05..2.0 };
        assert!(more.contains(&ratio), "{name}: {ratio}");
    }
}

#[test]
fn a_truth_outside_of_the_limits_of_a_fit_is_as_one_that_is_missing() {
    for (name, column, node) in MODELS {
        let options = FitOptions::default();
        let (missing, _) = fitted(node, |row| row[column], &options);
        let node = format!("train.abs_truth = {{ below = \"1000 1\" }}\n{node}");
        let outside = |row: &[f64]| {
            if row[column].is_nan() {
                1e6
            } else {
                row[column]
            }
        };
        let (limited, report) = fitted(&node, outside, &options);
        assert_eq!(missing, limited, "{name}: {:?}", report.notes);
    }
}

#[test]
fn where_rows_alone_fill_the_memory_a_truth_that_is_missing_ends_a_piece() {
    let (_, column, node) = MODELS[0];
    let memory = 42_000;
    let options = FitOptions {
        memory,
        ..FitOptions::default()
    };
    let (_, report) = fitted(node, |row| row[column], &options);
    let pieces = report.figures.get("pieces");
    assert!(pieces.is_some(), "{:?}", report.notes);
}

#[test]
fn orders_are_compared_by_the_likelihood_on_the_same_rows() {
    let (_, column, _) = MODELS[2];
    let node = "type = \"arma\"\norder = { by = \"bic\", na = \"0..4\", nc = \"0..2\" }";
    let (_, report) = fitted(node, |row| row[column], &FitOptions::default());
    let orders = report.orders.unwrap();
    assert_eq!(orders.tried[orders.chosen].order, "na 2, nc 1");
    // Nothing is counted before four truths in a row, which the longest needs.
    let known = |row: &[Vec<f64>]| row.iter().all(|row| !row[column].is_nan());
    let rows = rows();
    let begin = 4 + rows.windows(4).position(known).unwrap();
    let counted = rows[begin..].iter().filter(|row| !row[column].is_nan());
    assert_eq!(orders.rows, counted.count());
}
