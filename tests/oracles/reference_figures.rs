//! The scores of the shipped graphs hold against a plain implementation of the same models: the tables on the page of the
//! shared data, read from there. Decides how far off a figure may be, and in which direction.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use crate::workbench::{data, graph};
use athermal::Model;
use athermal::core::compile::{Outside, Plan, PlannedRole, Wanted};
use athermal::files::{Dataset, Options};
use athermal::run::fit::{FitOptions, fit};
use athermal::run::score::{Score, ScoreOptions, score};

/// A figure may be worse than the reference by this share, and better by any.
const WORSE: f64 = 1.02;

/// A plan whose predictions pass as they are: the reference knows nothing of what lies outside of a fit.
fn passing(plan: &Plan) -> Arc<Plan> {
    let mut plan = plan.clone();
    for node in &mut plan.nodes {
        match &mut node.role {
            PlannedRole::Estimator { outside, .. } => *outside = Outside::Pass,
            PlannedRole::Combiner { beside, .. } => beside.novelties = None,
            PlannedRole::Feature { .. } => {}
        }
    }
    Arc::new(plan)
}

/// Fits a graph of this project on one recording and scores it on another.
fn scored(name: &str, train: &Path, test: &Path, below: Option<&str>) -> Vec<Score> {
    let wanted = Wanted {
        standard_errors: true,
        intervals: false,
    };
    let model = Model::load_for(graph(name), wanted).unwrap();
    let recording = |path: &Path| Dataset::new(vec![path.to_owned()], Options::default());
    let options = FitOptions::default();
    let plan = passing(&model.plan);
    let (fitted, _) = fit(&plan, &recording(train), &options, &mut |_| {}).unwrap();
    let options = ScoreOptions {
        abs_truth_below: below.map(|limit| limit.parse().unwrap()),
        ..ScoreOptions::default()
    };
    score(&plan, &fitted, &recording(test), &options, &mut |_| {})
        .unwrap()
        .scores
}

/// A table of the page: figures by row and column.
type Table = BTreeMap<(String, String), f64>;

/// The table under the heading of a machine and the line that begins with the name of a horizon.
fn table(page: &str, machine: &str, horizon: &str) -> Table {
    let section = page
        .split("\n### ")
        .find(|section| section.starts_with(&format!("{machine}\n")))
        .unwrap();
    let after = section.split(&format!("\n{horizon}")).nth(1).unwrap();
    let rows: Vec<Vec<&str>> = after
        .lines()
        .skip_while(|line| !line.starts_with('|'))
        .take_while(|line| line.starts_with('|'))
        .map(|line| line.trim_matches('|').split('|').map(str::trim).collect())
        .collect();
    let mut table = Table::new();
    for row in &rows[2..] {
        for (axis, figure) in rows[0].iter().zip(row).skip(1) {
            table.insert(
                (row[0].to_owned(), (*axis).to_owned()),
                figure.parse().unwrap(),
            );
        }
    }
    table
}

/// What the rows of the page are called in the graphs.
const ROWS: [(&str, &str); 4] = [
    ("linear", "thermal"),
    ("AR", "motion"),
    ("ARX", "both"),
    ("vote", "vote"),
];

fn compare(machine: &str, name: &str, horizon: &str, axes: usize) {
    let Some(data) = data() else { return };
    let page = std::fs::read_to_string(data.join("README.md")).unwrap();
    let table = table(&page, machine, horizon);
    let folder = data.join(machine);
    let scores = scored(
        name,
        &folder.join("train.csv"),
        &folder.join("test.csv"),
        Some("250 nm/min"),
    );
    let mut compared = 0;
    let mut worse = Vec::new();
    for ((row, axis), &reference) in &table {
        let Some((_, node)) = ROWS.iter().find(|(name, _)| name == row) else {
            continue;
        };
        let output = format!("{node}.{axis}");
        let score = scores.iter().find(|score| score.output == output).unwrap();
        compared += 1;
        if score.rmse.unwrap() > WORSE * reference {
            worse.push(format!("{output}: {:?} instead of {reference}", score.rmse));
        }
    }
    for score in &scores {
        let axis = score.truth.split('.').nth(1).unwrap().to_owned();
        for (row, found) in [
            ("no model", score.baseline_zero),
            ("persistence", score.baseline_persistence),
        ] {
            let reference = table[&(row.to_owned(), axis.clone())];
            let found = found.unwrap();
            assert!(
                (found / reference - 1.0).abs() < 0.02,
                "{row} {axis}: {found} instead of {reference}"
            );
        }
    }
    assert_eq!(
        compared,
        ROWS.len() * axes,
        "every row and axis of the page is compared"
    );
    assert!(worse.is_empty(), "{}", worse.join("\n"));
}

#[test]
fn reference_of_the_die_tester_forecast() {
    compare("die-tester", "die-tester", "Forecast", 6);
}

#[test]
fn reference_of_the_die_tester_at_half_the_window() {
    compare("die-tester", "die-tester-compensate", "Half window", 6);
}

#[test]
fn reference_of_the_die_tester_as_virtual_sensor() {
    compare("die-tester", "die-tester-sensor", "Virtual sensor", 6);
}

#[test]
fn reference_of_the_linear_axis_forecast() {
    compare("linear-axis", "linear-axis", "Forecast", 3);
}

#[test]
fn reference_of_the_linear_axis_at_half_the_window() {
    compare("linear-axis", "linear-axis-compensate", "Half window", 3);
}

#[test]
fn reference_of_the_linear_axis_as_virtual_sensor() {
    compare("linear-axis", "linear-axis-sensor", "Virtual sensor", 3);
}

/// What 12 nm of noise at mostly four positions in a window leave in the drift, in nm/min, as the page says.
const NOISE: f64 = 3.85;

/// What a model adds to the noise of the truth.
fn excess(rmse: f64) -> f64 {
    (rmse * rmse - NOISE * NOISE).sqrt()
}

/// The excess of the virtual sensor of a machine over that of the best single model of the page for each axis, as a geometric
/// mean over the axes; none where there are no shared data.
fn sensor_to_best(machine: &str, axes: &[&str]) -> Option<f64> {
    let data = data()?;
    let page = std::fs::read_to_string(data.join("README.md")).unwrap();
    let table = table(&page, machine, "Virtual sensor");
    let folder = data.join(machine);
    let scores = scored(
        &format!("{machine}-virtual-sensor"),
        &folder.join("train.csv"),
        &folder.join("test.csv"),
        Some("250 nm/min"),
    );
    let logs = axes.iter().map(|axis| {
        let models = ["linear", "AR", "ARX"].map(|model| (model.to_owned(), (*axis).to_owned()));
        let best = models.iter().map(|model| table[model]).reduce(f64::min);
        let output = format!("sensor.{axis}");
        let score = scores.iter().find(|score| score.output == output).unwrap();
        assert!(score.valid.unwrap() >= 0.98, "{score:?}");
        (excess(score.rmse.unwrap()) / excess(best.unwrap())).ln()
    });
    Some((logs.sum::<f64>() / axes.len() as f64).exp())
}

#[test]
fn the_virtual_sensor_of_the_linear_axis_leaves_four_fifths_of_the_best_reference() {
    let Some(ratio) = sensor_to_best("linear-axis", &["X", "Y", "Z"]) else {
        return;
    };
    assert!(ratio <= 0.8, "{ratio}");
}

/// What is left here is creep that starts anew about once an hour, and nothing tells which way. Simulated with the amplitudes of
/// the training file, the best filter of such creep leaves 5 % less than regression on past residuals does.
#[test]
fn the_virtual_sensor_of_the_die_tester_leaves_less_than_the_best_reference() {
    let Some(ratio) = sensor_to_best("die-tester", &["X1", "Y1", "Z1", "X2", "Y2", "Z2"]) else {
        return;
    };
    assert!(ratio <= 0.9, "{ratio}");
}

#[test]
fn reference_of_the_measured_probe_holds_on_its_covered_run() {
    let Some(data) = data() else { return };
    let folder = data.join("z-probe");
    let scores = scored(
        "z-probe",
        &folder.join("GX-H12A.csv"),
        &folder.join("GX-H12A-covered.csv"),
        None,
    );
    let [score] = &scores[..] else {
        panic!("one prediction is scored: {scores:?}")
    };
    // "1 − SSE/SSE₀ = 0.87–0.91" on the page.
    assert!(score.r2_zero.unwrap() >= 0.87, "{score:?}");
}
