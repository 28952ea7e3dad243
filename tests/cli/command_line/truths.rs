//! What is said of the truths that predictions are scored against.

use super::desk;
use super::mistakes::{SOUND, assert_told};
use crate::workbench::{Scratch, athermal};

#[test]
fn the_error_of_a_truth_is_told_as_what_it_is() {
    let (_scratch, plain, data, _) = desk("truth-error");
    let told = athermal(&[&"evaluate", &plain, &"--data", &data]).ended(0);
    assert!(told.out.contains("standard error of the truth") && !told.out.contains("noise"));
    for (command, part) in [
        ("evaluate", "curvature"),
        ("diagnose", "standard error of its"),
    ] {
        let help = athermal(&[&command, &"--help"]).ended(0).out;
        let help = help.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(help.contains(part), "{help}");
    }
}

#[test]
fn what_tells_of_a_prediction_is_no_truth_whatever_its_horizon() {
    let text = SOUND.to_owned()
        + r#"[nodes.thermal]
type = "rls"
inputs.features = "temperature"
inputs.truth = "drift.X"
ahead = "0s"
[nodes.vote]
type = "auto_weighted"
inputs.voters = "thermal"
inputs.truth = "drift.X"
memory = "15min"
[nodes.of-deviation]
type = "persistence"
inputs.truth = "thermal:std_dev"
ahead = "0s"
[nodes.of-weight]
type = "linear"
inputs.features = "temperature"
inputs.truth = "vote:weights"
ahead = "5min"
[nodes.of-learning]
type = "persistence"
inputs.truth = "thermal:learning"
ahead = "0s"
[nodes.sure]
type = "stack"
inputs.voters = ["thermal", "thermal:std_dev"]
inputs.truth = "drift.X"
ahead = "0s"
[[tests]]
name = "compared"
on = "days.csv"
expect = [{ of = "thermal", beats = ["thermal:std_dev"] }]
"#;
    let expected = [
        (
            30,
            "`thermal:std_dev.X` describes the prediction `thermal.X` and cannot be the truth",
        ),
        (35, "`vote:weights.weight-thermal` describes the prediction"),
        (39, "`thermal:learning.X` describes the prediction"),
        (
            43,
            "`thermal:std_dev.X` describes the prediction `thermal` and is none",
        ),
        (49, "`thermal:std_dev` does not predict `drift.X`"),
    ];
    assert_told("command-line-truth-of-prediction", &text, &expected);
}

#[test]
fn a_fit_with_too_few_complete_rows_says_what_the_others_lack() {
    let sensors: Vec<String> = (0..12).map(|nth| format!("c{nth}")).collect();
    let quoted: Vec<String> = sensors.iter().map(|name| format!("\"{name}\"")).collect();
    let graph = format!(
        r#"schema = 1
[time]
column = "s"
[signals.in]
unit = "V"
channels = [{}]
max_age = "1s"
[signals.out]
unit = "nm"
channels = ["y"]
max_age = "1s"
[nodes.m]
type = "linear"
inputs = {{ features = "in", truth = "out.y" }}
ahead = "0s"
[outputs]
p = "m"
"#,
        quoted.join(", ")
    );
    // Each row lacks another sensor, none of which is dead.
    let mut rows = format!("s,{},y\n", sensors.join(","));
    for row in 0..12 {
        let cell = |nth: usize| match nth == row {
            true => String::new(),
            false => ((row * nth) % 7).to_string(),
        };
        let cells: Vec<String> = (0..12).map(cell).collect();
        rows += &format!("{},{},{row}\n", 10 * row, cells.join(","));
    }
    let scratch = Scratch::new("command-line-too-few");
    let graph = scratch.file("graph.toml", graph);
    let rows = scratch.file("rows.csv", rows);
    let fit = |rows| {
        athermal(&[
            &"fit",
            &graph,
            &"--data",
            rows,
            &"-o",
            &scratch.path("model.json"),
        ])
    };
    let told = fit(&rows).ended(1).told;
    let told = told.split_whitespace().collect::<Vec<_>>().join(" ");
    let said = "0 complete rows, and at least 2 are needed; 12 lack a value from in.c0 (1), in.c1 (1), in.c2 (1), and others";
    assert!(told.contains(said), "{told}");
}
