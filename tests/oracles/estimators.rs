//! Fitted through a graph, the estimators find what scikit-learn and statsmodels found on the same rows, as `generate.py` of
//! each folder under `tests/oracles` wrote it. The numerics have their own tests; these see that parameters arrive.

use std::sync::Arc;

use crate::workbench::{
    Graph, coefficients, fitted, numbers, own_oracle, plan, problems, regression, secs,
};
use athermal::core::compile::Plan;
use athermal::core::node::{Figure, Predictor, TrainingError, TrainingReport};
use athermal::run::fit::{FitOptions, Outcome, fit};
use athermal::run::recording::Table;
use serde_json::Value;

const COLUMNS: usize = 12;

fn file(name: &str) -> String {
    std::fs::read_to_string(own_oracle(name)).unwrap()
}

fn expected(name: &str) -> Value {
    serde_json::from_str(&file(&format!("{name}/expected.json"))).unwrap()
}

/// The table of selections, its target replaced where another is given.
fn rows(target: Option<&str>) -> Vec<Vec<f64>> {
    let mut rows = numbers(&file("selection/input.csv"));
    if let Some(target) = target {
        for (row, y) in rows.iter_mut().zip(numbers(&file(target))) {
            row[COLUMNS] = y[0];
        }
    }
    rows
}

fn recording(rows: &[Vec<f64>]) -> Table {
    let mut table = Table::default();
    for (second, row) in rows.iter().enumerate() {
        table.push(secs(second as f64), row);
    }
    table
}

fn graph_text(node: &str, features: &str) -> String {
    let channels: Vec<String> = (0..COLUMNS).map(|column| format!("x{column}")).collect();
    regression(
        &channels,
        &format!("inputs.features = \"{features}\"\n{node}"),
    )
}

/// The predictor of a graph's one estimator, and what was told of its fit.
fn told(plan: &Arc<Plan>, table: &Table) -> (Arc<dyn Predictor>, TrainingReport) {
    let (predictor, fit) = fitted(plan, table);
    let Outcome::Fitted(report) = fit.outcome else {
        unreachable!()
    };
    (predictor, report)
}

fn on_rows(node: &str, features: &str, rows: &[Vec<f64>]) -> (Arc<dyn Predictor>, TrainingReport) {
    told(&plan(&graph_text(node, features)), &recording(rows))
}

/// The intercept, and a coefficient for each of the twelve columns.
fn columns(predictor: &dyn Predictor) -> (f64, Vec<f64>) {
    let (intercept, named) = coefficients(predictor);
    let mut all = vec![0.0; COLUMNS];
    for (name, b) in named {
        all[name.strip_prefix("x.x").unwrap().parse::<usize>().unwrap()] = b;
    }
    (intercept, all)
}

fn assert_model(predictor: &dyn Predictor, wanted: &Value) {
    let (intercept, found) = columns(predictor);
    assert!((intercept - wanted["intercept"].as_f64().unwrap()).abs() < 1e-8);
    for (found, wanted) in found.iter().zip(wanted["coef"].as_array().unwrap()) {
        let wanted = wanted.as_f64().unwrap();
        assert!((found - wanted).abs() < 1e-8, "{found} {wanted}");
    }
}

#[test]
fn the_penalty_chosen_is_that_of_the_oracle() {
    let chosen = &expected("penalties")["ridge_cv"];
    let rows = rows(None);
    for (by, wanted) in [
        ("by = \"cross_validation\", folds = 5", &chosen["by_folds"]),
        ("by = \"generalised_cross_validation\"", &chosen["by_gcv"]),
    ] {
        let range = "smallest = 1e-2, largest = 1e4, per_decade = 2";
        let node = format!(
            "type = \"linear\"\nsolver = {{ type = \"ridge\", alpha = {{ {by}, {range} }} }}"
        );
        let (predictor, report) = on_rows(&node, "x", &rows);
        let fixed = format!("type = \"linear\"\nsolver = {{ type = \"ridge\", alpha = {wanted} }}");
        let (same, _) = on_rows(&fixed, "x", &rows);
        let (found, wanted) = (columns(&*predictor), columns(&*same));
        for (found, wanted) in found.1.iter().zip(&wanted.1) {
            assert!((found - wanted).abs() < 1e-12);
        }
        assert!(
            report.notes[0].starts_with("penalty "),
            "{:?}",
            report.notes
        );
    }
}

#[test]
fn lasso_and_elastic_net_are_those_of_the_oracle() {
    let rows = rows(None);
    for wanted in expected("penalties")["elastic_net"].as_array().unwrap() {
        let (alpha, ratio) = (&wanted["alpha"], wanted["l1_ratio"].as_f64().unwrap());
        let node = if ratio == 1.0 {
            format!("type = \"lasso\"\nalpha = {alpha}")
        } else {
            format!("type = \"elastic_net\"\nalpha = {alpha}\nl1_ratio = {ratio}")
        };
        let (predictor, _) = on_rows(&node, "x", &rows);
        let used = predictor.uses().len();
        assert_eq!(COLUMNS - used, wanted["zeros"].as_u64().unwrap() as usize);
        assert_model(&*predictor, wanted);
    }
}

#[test]
fn the_penalty_of_a_lasso_is_the_best_over_the_folds_of_the_oracle() {
    let expected = expected("penalties");
    let (_, report) = on_rows("type = \"lasso\"\nalpha = { folds = 5 }", "x", &rows(None));
    let note = &report.notes[0];
    let word = |after: &str| {
        let rest = note.split(after).nth(1).unwrap();
        let word = rest.trim_start().split([' ', ',', ';']).next().unwrap();
        word.parse::<f64>().unwrap()
    };
    let best = expected["lasso_folds"]
        .as_array()
        .unwrap()
        .iter()
        .map(|row| {
            let folds = row["folds"].as_array().unwrap();
            folds.iter().map(|r2| r2.as_f64().unwrap()).sum::<f64>() / folds.len() as f64
        });
    // A finer grid finds one at least as good.
    assert!(
        word("R²") >= best.fold(f64::NEG_INFINITY, f64::max) - 1e-4,
        "{note}"
    );
    let largest = expected["largest_alpha"].as_f64().unwrap();
    assert!((word("up to") / largest - 1.0).abs() < 1e-3, "{note}");
    // Twenty to each factor of ten, over the four that glmnet goes down where there are more rows than features.
    assert_eq!(word("from"), 81.0, "{note}");
}

#[test]
fn a_robust_fit_is_that_of_the_oracle() {
    let rows = rows(Some("huber/target.csv"));
    let n = rows.len() as f64;
    let mean = rows.iter().map(|row| row[COLUMNS]).sum::<f64>() / n;
    let squares: f64 = rows.iter().map(|row| (row[COLUMNS] - mean).powi(2)).sum();
    let deviation = (squares / n).sqrt();
    for wanted in expected("huber").as_array().unwrap() {
        // The penalty of the oracle is against coefficients in the unit of the target.
        let alpha = wanted["alpha"].as_f64().unwrap() * deviation;
        let epsilon = &wanted["epsilon"];
        let node = format!("type = \"huber\"\nepsilon = {epsilon}\nalpha = {alpha:?}");
        let (predictor, report) = on_rows(&node, "x", &rows);
        assert_model(&*predictor, wanted);
        let beyond = wanted["outliers"].as_u64().unwrap();
        assert_eq!(report.figures["beyond_epsilon"], Figure::from(beyond));
    }
}

#[test]
fn a_polynomial_has_the_terms_and_predictions_of_the_oracle() {
    let expected = expected("polynomial");
    let rows = rows(Some("polynomial/target.csv"));
    let node = "type = \"polynomial\"\nsolver = { type = \"ols\" }";
    let (predictor, report) = on_rows(node, "x.{x2,x4,x8,x9}", &rows);
    let mut chosen: Vec<&str> = Vec::new();
    for step in &report.selection {
        if step.removed {
            chosen.retain(|term| *term != step.regressor);
        } else {
            chosen.push(&step.regressor);
        }
    }
    let terms = expected["terms"].as_array().unwrap().iter();
    let terms = terms.map(|term| {
        let named = term
            .as_str()
            .unwrap()
            .replace("^2", "²")
            .replace(' ', " × ");
        named.replace('x', "x.x")
    });
    assert_eq!(chosen, terms.collect::<Vec<_>>());
    for (row, wanted) in rows.iter().zip(expected["predictions"].as_array().unwrap()) {
        let value =
            |name: &String| row[name.strip_prefix("x.x").unwrap().parse::<usize>().unwrap()];
        let features: Vec<f64> = predictor.uses().iter().map(value).collect();
        let found = predictor.predict(&features);
        assert!((found - wanted.as_f64().unwrap()).abs() < 1e-9);
    }
}

#[test]
fn a_selection_is_told_with_its_folds_and_what_else_was_tried() {
    let expected = expected("selection");
    let node = "type = \"linear\"\nsolver = { type = \"ols\" }\nselection = { method = \"backward\", folds = 5, tolerance = 0.01 }";
    let (predictor, report) = on_rows(node, "x", &rows(None));
    let steps = expected["backward_ols"].as_array().unwrap();
    for (found, wanted) in report.selection.iter().zip(steps) {
        assert!(found.removed);
        assert_eq!(found.regressor, format!("x.x{}", wanted["candidate"]));
        assert!((found.score - wanted["mean"].as_f64().unwrap()).abs() < 1e-10);
        assert_eq!(found.folds.len(), 5);
        assert_eq!(
            found.candidates.len(),
            wanted["candidates"].as_object().unwrap().len()
        );
        assert_eq!(found.candidates[0].name, found.regressor);
    }
    let removed = report.selection.len();
    assert_eq!(predictor.uses().len(), COLUMNS - removed);
    let refused = report.refused.unwrap();
    assert!(report.selection.last().unwrap().score - refused.score > 0.01);
    assert_eq!(
        refused.regressor,
        format!("x.x{}", steps[removed]["candidate"])
    );
}

#[test]
fn folds_with_gaps_arrive_at_the_search() {
    let expected = expected("selection");
    for (folds, name) in [
        (
            "{ type = \"blocked\", count = 4, gap_rows = 6, embargo_rows = 10 }",
            "forward_ols_blocked_4_gap_6_embargo_10",
        ),
        (
            "{ type = \"expanding\", count = 4, gap_rows = 7 }",
            "forward_ols_expanding_4_gap_7",
        ),
    ] {
        let node = format!(
            "type = \"linear\"\nsolver = {{ type = \"ols\" }}\nselection = {{ method = \"forward\", folds = {folds} }}"
        );
        let (_, report) = on_rows(&node, "x", &rows(None));
        assert!(report.selection.len() >= 3);
        for (found, wanted) in report
            .selection
            .iter()
            .zip(expected[name].as_array().unwrap())
        {
            assert_eq!(found.regressor, format!("x.x{}", wanted["candidate"]));
            assert!((found.score - wanted["mean"].as_f64().unwrap()).abs() < 1e-10);
        }
    }
}

#[test]
fn the_smallest_set_within_one_standard_error_is_kept() {
    let expected = expected("selection");
    let node = "type = \"linear\"\nsolver = { type = \"ols\" }\nselection = { method = \"forward\", folds = 5, tolerance = -1.0, one_standard_error = true }";
    let (predictor, report) = on_rows(node, "x", &rows(None));
    assert_eq!(report.selection.len(), COLUMNS);
    let mut used: Vec<usize> = predictor
        .uses()
        .iter()
        .map(|name| name.strip_prefix("x.x").unwrap().parse().unwrap())
        .collect();
    used.sort_unstable();
    let wanted = expected["parsimonious"]["columns"].as_array().unwrap();
    let wanted: Vec<usize> = wanted
        .iter()
        .map(|c| c.as_u64().unwrap() as usize)
        .collect();
    assert_eq!(used, wanted);
    assert!(
        report
            .notes
            .iter()
            .any(|note| note.contains("one standard error"))
    );
}

/// Three sensors, each with three slopes; the truth follows two of them.
fn by_sensor(most: usize) -> (Arc<dyn Predictor>, TrainingReport) {
    let text = Graph::new()
        .time("t")
        .signal("temperature", "Cel", "near far idle", "1s")
        .signal("drift", "nm", "Z", "1s")
        .slope("gradients", "temperature", "20s 40s 80s", "mK/s")
        .model("model", "linear", "gradients", "drift.Z", "0s")
        .with(&format!(
            "selection = {{ method = 'forward', by = 'sensor', most = {most} }}"
        ))
        .outputs("predicted = 'model'");
    let plan = plan(&text);
    let mut table = Table::default();
    let wave = |t: f64, period: f64| (std::f64::consts::TAU * t / period).sin();
    for second in 0..3000 {
        let t = f64::from(second);
        let (near, far, idle) = (wave(t, 300.0), wave(t, 170.0), wave(t, 230.0));
        let row = [
            20.0 + near,
            21.0 + far,
            22.0 + idle,
            5.0 * wave(t + 60.0, 300.0) + 2.0 * far,
        ];
        table.push(secs(t), &row);
    }
    told(&plan, &table)
}

#[test]
fn at_most_two_sensors_are_used_and_told_with_what_each_is_worth() {
    let (predictor, report) = by_sensor(2);
    let steps: Vec<&str> = report
        .selection
        .iter()
        .map(|step| step.regressor.as_str())
        .collect();
    assert_eq!(steps, ["temperature.near", "temperature.far"]);
    assert!(report.selection[1].score > report.selection[0].score + 0.05);
    assert_eq!(report.selection[0].candidates.len(), 3);
    assert_eq!(predictor.uses().len(), 6);
    assert!(predictor.uses().iter().all(|name| !name.contains("idle")));
    assert_eq!(by_sensor(1).0.uses().len(), 3);
}

#[test]
fn rows_beyond_the_memory_are_said_where_they_are_needed() {
    let rows = rows(None);
    let options = FitOptions {
        memory: 4096,
        ..FitOptions::default()
    };
    let outcome = |node: &str| {
        let plan = plan(&graph_text(node, "x"));
        let (_, mut report) = fit(&plan, &recording(&rows), &options, &mut |_| {}).unwrap();
        report.estimators.remove(0).outcome
    };
    let Outcome::Failed(TrainingError::Unsolvable { reason }) = outcome("type = \"huber\"") else {
        panic!("it has no rows to go over")
    };
    assert!(reason.contains("2 MB of the `--memory`"), "{reason}");
    assert!(matches!(
        outcome("type = \"lasso\"\nalpha = 0.1"),
        Outcome::Fitted(_)
    ));
    assert!(matches!(
        outcome("type = \"polynomial\""),
        Outcome::Fitted(_)
    ));
}

#[test]
fn every_mistake_in_a_parameter_is_told_with_its_place() {
    for (node, told) in [
        (
            "type = \"huber\"\nepsilon = 0.5\nalpha = -1",
            ["`epsilon` is 0.5", "`alpha` is -1"],
        ),
        (
            "type = \"lasso\"\nalpha = { folds = 1, smallest_share = 2 }",
            ["`folds` is 1", "`smallest_share` is 2"],
        ),
        (
            "type = \"elastic_net\"\nalpha = nan\nl1_ratio = 0",
            ["`alpha` is NaN", "`l1_ratio` is 0"],
        ),
        (
            "type = \"linear\"\nsolver = { type = \"ridge\", alpha = { by = \"cross_validation\", largest = -1, per_decade = 0 } }",
            ["`largest` is -1", "`per_decade` is 0"],
        ),
        (
            "type = \"linear\"\nselection = { method = \"floating\", folds = { type = \"blocked\", count = 1 }, most = 0 }",
            ["`count` is 1", "`most` is 0"],
        ),
        (
            "type = \"polynomial\"\nselection = { method = \"stepwise\", f_enter = 2.0, leave_share = 3.0 }",
            ["`leave_share` is 3", "greater than 0 and at most 1"],
        ),
        (
            "type = \"linear\"\nselection = { method = \"sideways\" }",
            ["sideways", "backward"],
        ),
        (
            "type = \"linear\"\nselection = { method = \"forward\", folds = \"many\" }",
            ["many", "a whole number or a table"],
        ),
        (
            "type = \"linear\"\nselection = { method = \"forward\", tolerence = 1e-3 }",
            ["tolerence", "tolerance"],
        ),
    ] {
        let text = problems(&graph_text(node, "x"));
        for part in told {
            assert!(text.contains(part), "{node}\n{text}");
        }
    }
}
