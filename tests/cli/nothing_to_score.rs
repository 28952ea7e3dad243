//! What `athermal evaluate` says where nothing of a prediction is scored: what there was, and what was not.

use crate::workbench::{Scratch, athermal_on};
use serde_json::{Value, json};

const GRAPH: &str = r#"
schema = 1
name = "nothing"
time.column = "t"
signals.place = { unit = "nm", channels = ["z"], column = "{channel}", range = ["-1 um", "1 um"], max_age = "3min" }
nodes.drift = { type = "slope", inputs.signal = "place", windows = ["30s"], unit = "nm/min" }
nodes.late = { type = "persistence", inputs.truth = "drift.z", ahead = "10min" }
nodes.other = { type = "persistence", inputs.truth = "drift.z", ahead = "10min" }
outputs = { late = "late", other = "other" }
"#;

/// Rows 10 s apart of a position.
fn log(rows: u32, z: impl Fn(u32) -> String) -> String {
    let rows = (0..rows).map(|nth| format!("{},{}\n", 10 * nth, z(nth)));
    format!("t,z\n{}", rows.collect::<String>())
}

#[track_caller]
fn says(test: &str, log: &str, more: &[&str], told: &[&str], facts: &Value) {
    let scratch = Scratch::new(&format!("nothing-to-score-{test}"));
    let (graph, log) = (
        scratch.file("graph.toml", GRAPH),
        scratch.file("log.csv", log),
    );
    let mut arguments: Vec<&dyn AsRef<std::ffi::OsStr>> = Vec::new();
    arguments.extend(more.iter().map(|more| more as &dyn AsRef<_>));
    athermal_on("evaluate", &graph, &log, &arguments)
        .ended(0)
        .tells(told);
    arguments.extend([&"--format" as &dyn AsRef<_>, &"json"]);
    let json = athermal_on("evaluate", &graph, &log, &arguments)
        .ended(0)
        .json();
    assert_eq!(json["unscored"], *facts);
}

/// What programs are told of both predictions: truths, those within the limit, and what is silent.
fn facts(ticks: u64, truths: u64, within_limit: u64, predictions: u64, silent: &Value) -> Value {
    let of = |output: &str| {
        json!({
            "output": output, "truth": "drift.z", "ahead_s": 600.0, "ticks": ticks, "truths": truths,
            "within_limit": within_limit, "predictions": predictions, "pairs": 0, "first_silent": silent,
        })
    };
    json!([of("late.z"), of("other.z")])
}

#[test]
fn a_position_that_was_never_measured_is_named() {
    let told = "nothing is scored: 200 rows, 0 truths, 0 predictions, 0 pairs: the first to lack a value is place.z";
    let facts = facts(200, 0, 0, 0, &json!("place.z"));
    says("absent", &log(200, |_| String::new()), &[], &[told], &facts);
    // In another unit, out of range.
    let told = [
        "the first to lack a value is place.z",
        "is its unit that of the log?",
    ];
    says("range", &log(200, |_| "1e9".to_owned()), &[], &told, &facts);
}

#[test]
fn a_log_that_is_shorter_than_the_horizon_is_told() {
    let z = |nth: u32| format!("{}", nth * nth % 31);
    let told = "nothing is scored: 40 rows, 37 truths, 37 predictions, 0 pairs: no truth is there 10min after a prediction";
    let facts = facts(40, 37, 37, 37, &Value::Null);
    says("short", &log(40, z), &[], &[told], &facts);
}

#[test]
fn a_limit_that_leaves_no_truth_is_told() {
    // 24 nm/min, without a leap.
    let z = |nth: u32| format!("{}", 4 * nth);
    let told = "late.z, other.z: nothing is scored: 200 rows, 197 truths, 197 predictions, 0 pairs: no truth is within `--abs-truth-below`";
    let facts = facts(200, 197, 0, 197, &Value::Null);
    says(
        "limit",
        &log(200, z),
        &["--abs-truth-below", "1 nm/min"],
        &[told],
        &facts,
    );
}
