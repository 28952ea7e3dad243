//! Fitted through a graph, estimators find what statsmodels and scikit-learn found on the same rows, as kept in the folder
//! of oracles. Decides the tolerances, which are those stated there.

use std::sync::Arc;

use crate::workbench::{coefficients, fitted, oracle, plan, regression, slot};
use athermal::core::compile::Plan;
use athermal::run::fit::{FitOptions, Outcome, fit};
use athermal::run::recording::Table;
use athermal::{Engine, Instant};

/// A CSV file without quotes: the names of its columns, and its cells.
struct Cells {
    names: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl Cells {
    fn read(file: &str) -> Option<Self> {
        let text = oracle(file)?;
        let mut lines = text
            .lines()
            .map(|line| line.split(',').map(str::to_owned).collect());
        Some(Self {
            names: lines.next().unwrap(),
            rows: lines.collect(),
        })
    }

    fn column(&self, name: &str) -> usize {
        self.names.iter().position(|column| column == name).unwrap()
    }

    fn number(&self, row: usize, name: &str) -> f64 {
        self.rows[row][self.column(name)]
            .parse()
            .unwrap_or(f64::NAN)
    }

    /// The first rows, one second apart, with these columns.
    fn recording(&self, rows: usize, columns: &[&str]) -> Table {
        let mut table = Table::default();
        for row in 0..rows {
            let values: Vec<f64> = columns
                .iter()
                .map(|column| self.number(row, column))
                .collect();
            table.push(Instant::from_ns(row as i64 * 1_000_000_000), &values);
        }
        table
    }
}

fn graph(inputs: &[&str], node: &str) -> Arc<Plan> {
    plan(&regression(inputs, node))
}

fn coefficient(named: &[(String, f64)], name: &str) -> f64 {
    named
        .iter()
        .find(|(known, _)| known == name)
        .unwrap_or_else(|| panic!("{name} in {named:?}"))
        .1
}

/// What a graph fitted on the first 400 rows gives for every row.
fn predictions(plan: &Arc<Plan>, fitted_on: &Table, whole: &Table) -> Vec<f64> {
    let (fitted, _) = fit(plan, fitted_on, &FitOptions::default(), &mut |_| {}).unwrap();
    let mut engine = Engine::new(Arc::clone(plan), &fitted).unwrap();
    let out = slot(plan, "model.y");
    let step = |(nth, (_, values)): (usize, &(_, Vec<f64>))| {
        engine
            .step(Instant::from_ns(nth as i64 * 1_000_000_000), values)
            .unwrap();
        engine.value(out)
    };
    whole.events().iter().enumerate().map(step).collect()
}

#[test]
fn oracle_of_autoregression() {
    let Some(input) = Cells::read("ar_arx/input.csv") else {
        return;
    };
    let params: serde_json::Value =
        serde_json::from_str(&oracle("ar_arx/ar3.json").unwrap()).unwrap();
    let expected = Cells::read("ar_arx/ar3_predictions.csv").unwrap();
    let columns = ["u1", "y"];
    let plan = graph(
        &["u1"],
        "type = \"ar\"\nlags = [\"1 sample\", \"2 samples\", \"3 samples\"]\nsolver = { type = \"ols\" }",
    );
    let train = input.recording(400, &columns);
    let (predictor, report) = fitted(&plan, &train);
    assert_eq!(report.rows, 397, "the first three rows have no past");
    let (intercept, named) = coefficients(&*predictor);
    assert!((intercept - params["params"]["const"].as_f64().unwrap()).abs() < 1e-8);
    for lag in 1..=3 {
        let found = coefficient(&named, &format!("y.y lag {lag}s"));
        assert!(
            (found - params["params"][format!("y{lag}")].as_f64().unwrap()).abs() < 1e-8,
            "lag {lag}: {found}"
        );
    }
    let found = predictions(&plan, &train, &input.recording(input.rows.len(), &columns));
    for (row, found) in found.into_iter().enumerate() {
        let expected = expected.number(row, "pred1");
        assert_eq!(found.is_nan(), expected.is_nan(), "row {row}");
        assert!(
            found.is_nan() || (found - expected).abs() < 1e-9,
            "row {row}: {found} for {expected}"
        );
    }
}

#[test]
fn oracle_of_autoregression_with_exogenous_inputs() {
    let Some(input) = Cells::read("ar_arx/input.csv") else {
        return;
    };
    let params = Cells::read("ar_arx/arx_params.csv").unwrap();
    let expected = Cells::read("ar_arx/arx_predictions.csv").unwrap();
    let columns = ["u1", "u2", "y"];
    let plan = graph(
        &["u1", "u2"],
        "type = \"arx\"\ninputs.features = \"x\"\nlags = [\"1 sample\", \"2 samples\", \"3 samples\"]\n\
         feature_lags = [\"1 sample\", \"2 samples\"]\nsolver = { type = \"ols\" }",
    );
    let train = input.recording(400, &columns);
    let (predictor, report) = fitted(&plan, &train);
    assert_eq!(report.rows, 397);
    let (intercept, named) = coefficients(&*predictor);
    assert_eq!(params.rows.len(), 8);
    for row in 0..params.rows.len() {
        let (name, expected) = (params.rows[row][0].as_str(), params.number(row, "value"));
        let found = match name.split_once("_lag") {
            None => intercept,
            Some(("y", lag)) => coefficient(&named, &format!("y.y lag {lag}s")),
            Some((input, lag)) => coefficient(&named, &format!("x.{input} lag {lag}s")),
        };
        assert!(
            (found - expected).abs() < 1e-8,
            "{name}: {found} for {expected}"
        );
    }
    let found = predictions(&plan, &train, &input.recording(input.rows.len(), &columns));
    for (row, found) in found.into_iter().enumerate() {
        let expected = expected.number(row, "pred1");
        assert_eq!(found.is_nan(), expected.is_nan(), "row {row}");
        assert!(
            found.is_nan() || (found - expected).abs() < 1e-9,
            "row {row}: {found} for {expected}"
        );
    }
}

const EIGHT: [&str; 8] = ["x0", "x1", "x2", "x3", "x4", "x5", "x6", "x7"];

#[test]
fn oracle_of_ordinary_least_squares_on_collinear_features() {
    let Some(input) = Cells::read("linear_ridge/input.csv") else {
        return;
    };
    let expected = Cells::read("linear_ridge/coefs.csv").unwrap();
    let table = input.recording(input.rows.len(), &[&EIGHT[..], &["y"]].concat());
    let plan = graph(
        &EIGHT,
        "type = \"linear\"\ninputs.features = \"x\"\nsolver = { type = \"ols\" }",
    );
    let (intercept, named) = coefficients(&*fitted(&plan, &table).0);
    let row = expected
        .rows
        .iter()
        .position(|row| row[0] == "ols")
        .unwrap();
    assert!((intercept - expected.number(row, "intercept")).abs() < 1e-8);
    for nth in 0..8 {
        let found = coefficient(&named, &format!("x.x{nth}"));
        assert!(
            (found - expected.number(row, &format!("b{nth}"))).abs() < 1e-8,
            "{nth}: {found}"
        );
    }
}

#[test]
fn oracle_of_stochastic_gradients_in_the_order_and_schedule_of_scikit_learn() {
    let Some(input) = Cells::read("linear_ridge/input.csv") else {
        return;
    };
    let expected = Cells::read("linear_ridge/sgd.csv").unwrap();
    let n = input.rows.len();
    let table = input.recording(n, &[&EIGHT[..], &["y"]].concat());
    let column = |name: &str| -> Vec<f64> { (0..n).map(|row| input.number(row, name)).collect() };
    let mean = |values: &[f64]| values.iter().sum::<f64>() / n as f64;
    let y = mean(&column("y"));
    let mut compared = 0;
    for row in 0..expected.rows.len() {
        // A configuration is named like `invscaling_eta0.01_alpha0.001`.
        let parts: Vec<&str> = expected.rows[row][0].split('_').collect();
        let power = if parts[0] == "constant" { 0.0 } else { 0.25 };
        let number = |name: &str| {
            parts
                .iter()
                .find_map(|part| part.strip_prefix(name))
                .unwrap()
                .to_owned()
        };
        let solver = format!(
            "solver = {{ type = \"sgd\", alpha = {}, eta0 = {}, power = {power}, epochs = {} }}",
            number("alpha"),
            number("eta"),
            expected.rows[row][1]
        );
        let plan = graph(
            &EIGHT,
            &format!("type = \"linear\"\ninputs.features = \"x\"\n{solver}"),
        );
        let (intercept, named) = coefficients(&*fitted(&plan, &table).0);
        // The reference is told on standardised features and centred truths.
        let mut own_intercept = intercept - y;
        for (nth, name) in EIGHT.iter().enumerate() {
            let values = column(name);
            let centre = mean(&values);
            let scale = mean(
                &values
                    .iter()
                    .map(|x| (x - centre).powi(2))
                    .collect::<Vec<_>>(),
            )
            .sqrt();
            let found = coefficient(&named, &format!("x.{name}"));
            own_intercept += found * centre;
            let expected = expected.number(row, &format!("b{nth}"));
            assert!(
                (found * scale - expected).abs() < 1e-9,
                "row {row}, {name}: {} for {expected}",
                found * scale
            );
            compared += 1;
        }
        assert!(
            (own_intercept - expected.number(row, "intercept")).abs() < 1e-9,
            "row {row}: {own_intercept}"
        );
    }
    assert!(compared >= 16, "{compared}");
}

#[test]
fn oracle_of_forward_selection_order_scores_and_where_it_stops() {
    let Some(input) = Cells::read("sfs/input.csv") else {
        return;
    };
    let steps = Cells::read("sfs/steps.csv").unwrap();
    let selected: serde_json::Value =
        serde_json::from_str(&oracle("sfs/selected.json").unwrap()).unwrap();
    let names: Vec<String> = (0..12).map(|nth| format!("x{nth}")).collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let table = input.recording(input.rows.len(), &[&names[..], &["y"]].concat());
    let order: Vec<u64> = selected["ols_r2"]["full_order"]
        .as_array()
        .unwrap()
        .iter()
        .map(|index| index.as_u64().unwrap())
        .collect();
    for tolerance in ["0.01", "0.001", "0.0001"] {
        let plan = graph(
            &names,
            &format!(
                "type = \"linear\"\ninputs.features = \"x\"\nsolver = {{ type = \"ols\" }}\n\
                 selection = {{ method = \"forward\", folds = 3, tolerance = {tolerance} }}"
            ),
        );
        let (predictor, report) = fitted(&plan, &table);
        let Outcome::Fitted(report) = report.outcome else {
            unreachable!()
        };
        let chosen: Vec<u64> = report
            .selection
            .iter()
            .map(|step| step.regressor.strip_prefix("x.x").unwrap().parse().unwrap())
            .collect();
        let auto = selected["ols_r2"]["auto"][tolerance].as_array().unwrap();
        assert_eq!(chosen.len(), auto.len(), "with {tolerance}");
        assert_eq!(chosen, order[..chosen.len()], "with {tolerance}");
        assert_eq!(predictor.uses().len(), chosen.len());
        for (nth, step) in report.selection.iter().enumerate() {
            let is = |row: &&Vec<String>| {
                row[0] == "ols_r2" && row[1] == nth.to_string() && row[2] == chosen[nth].to_string()
            };
            let row = steps.rows.iter().position(|row| is(&row)).unwrap();
            assert!(
                (step.score - steps.number(row, "mean")).abs() < 1e-10,
                "step {nth}: {}",
                step.score
            );
            for (fold, score) in step.folds.iter().enumerate() {
                assert!(
                    (score - steps.number(row, &format!("fold{fold}"))).abs() < 1e-10,
                    "step {nth}, fold {fold}"
                );
            }
        }
    }
}
