//! What a test looks at: which channel it means, and that it is computed and judged wherever it has a value.

use super::{EVENLY, graph};
use crate::workbench::{Scratch, athermal};

/// A graph with an output that has a node's name, and holds what another node gives.
fn renamed(outputs: &str, tests: &str) -> String {
    let graph = graph("");
    let (head, _) = graph.split_once("[outputs]").unwrap();
    format!(
        "{head}[outputs]\nsame = \"zero\"\n{outputs}\n[[tests]]\nname = \"named twice\"\n{EVENLY}\n{tests}"
    )
}

#[test]
fn an_output_is_what_a_test_means_though_a_node_has_its_name() {
    // `zero` is off by the 60 nm/min at which the position moves, and persistence by nothing.
    let tests = r#"expect = [
  { of = "same.Z", equals = "0 nm/min" },
  { of = "same", rmse_below = "61 nm/min" },
  { of = "same:prediction.Z", from = "5min", equals = "60 nm/min", within = 1e-6, beats = ["same"] },
]
"#;
    let scratch = Scratch::new("trials-columns");
    let file = scratch.file("graph.toml", renamed("slopes = \"slopes\"", tests));
    athermal(&[&"test", &file]).ended(0);
    let off = r#"expect = [{ of = "same.Z", rmse_below = "3 nm/min" }]"#;
    let file = scratch.file("graph.toml", renamed("", off));
    let out = athermal(&[&"test", &file]).ended(1).out;
    assert!(out.contains("zero.Z: rmse_below: found 60 nm/min"), "{out}");
}

#[test]
fn what_an_output_lacks_of_the_node_of_its_name_is_told_with_the_name_of_the_port() {
    let tests = r#"expect = [{ of = "slopes.plate", valid_above = 0.5 }]"#;
    let scratch = Scratch::new("trials-columns-lacking");
    let file = scratch.file("graph.toml", renamed("slopes = \"slopes.room\"", tests));
    athermal(&[&"check", &file]).ended(2).tells(&[
        "`slopes` has no channel that matches `plate`",
        "the output of that name lacks it; write `slopes:slope.plate` for what the node gives",
    ]);
}

#[test]
fn what_is_measured_is_given_to_the_signal_though_an_output_has_its_name() {
    let graph = renamed(
        "position = \"drift\"",
        r#"expect = [{ of = "position", at = "5min", equals = "60 nm/min", within = 1e-6 }]"#,
    );
    let scratch = Scratch::new("trials-signal-columns");
    let file = scratch.file("graph.toml", graph);
    athermal(&[&"test", &file]).ended(0);
}

#[test]
fn an_output_of_the_name_of_an_instance_of_a_module_is_what_a_test_means() {
    let text = r#"
schema = 1
[signals.position]
unit = "nm"
channels = ["Z"]
max_age = "3min"
[modules.model]
inputs = ["position"]
outputs = { drift = "slope", zero = "zero" }
nodes.slope = { type = "slope", inputs.signal = "{position}", windows = ["30s"], unit = "nm/min" }
nodes.zero = { type = "zero", inputs.truth = "slope", ahead = "30s" }
[nodes.model]
module = "model"
inputs.position = "position"
[outputs]
model = "model:zero"
[[tests]]
name = "the column is zero"
inputs = { "position" = { ramp = "1 nm/s", for = "10min", every = "5s" } }
expect = [
  { of = "model.Z", equals = "0 nm/min" },
  { of = "model:drift.Z", at = "5min", equals = "60 nm/min", within = 1e-6 },
]
"#;
    let scratch = Scratch::new("trials-module-columns");
    let file = scratch.file("graph.toml", text);
    athermal(&[&"test", &file]).ended(0);
}

#[test]
fn what_stands_beside_predictions_is_computed_for_a_test_that_looks_at_it() {
    let scratch = Scratch::new("beside-predictions");
    let row = |nth: u32| {
        let x = 20.0 * (f64::from(nth) / 9.0).sin() + f64::from(nth * nth % 7);
        format!("{},20,20,{x}\n", 5 * nth)
    };
    let rows: String = (0..200).map(row).collect();
    scratch.file("past.csv", format!("time_s,room,plate,Z\n{rows}"));
    let text = graph(&format!(
        r#"
[nodes.follow]
type = "kalman"
inputs.truth = "drift.Z"
ahead = "30s"
[nodes.vote]
type = "auto_weighted"
inputs.voters = ["zero.Z", "same.Z"]
inputs.truth = "drift.Z"
memory = "2min"
[nodes.both]
type = "auto_weighted"
inputs.voters = ["follow"]
inputs.truth = "drift.Z"
memory = "2min"
[outputs.watched]
from = "vote"
[[tests]]
name = "there they are"
fit = "past.csv"
{EVENLY}
expect = [
  {{ of = "vote:weights.*", from = "5min", between = ["0 1", "1 1"] }},
  {{ of = "follow:std_dev", from = "5min", between = ["0 nm/min", "1000 nm/min"] }},
  {{ of = "both:std_dev", from = "5min", between = ["0 nm/min", "1000 nm/min"] }},
]
[[tests]]
name = "they are not absent"
fit = "past.csv"
{EVENLY}
expect = [
  {{ of = "vote:weights.*", absent = true }},
  {{ of = "follow:std_dev", absent = true }},
  {{ of = "both:std_dev", absent = true }},
]
"#
    ));
    let path = scratch.file("graph.toml", text);
    let out = athermal(&[&"test", &path]).ended(1).out;
    assert!(out.contains("✓ there they are"), "{out}");
    assert_eq!(out.matches("absent: found").count(), 4, "{out}");
}

#[test]
fn at_a_time_every_segment_is_to_be_as_expected() {
    let scratch = Scratch::new("segments-at");
    // The position of one falls silent after a minute.
    let log = |name: &str, step_nm: f64, every_s: u32, silent: bool| {
        let row = |nth: u32| {
            let z = step_nm * f64::from(nth);
            let z = if silent && nth * every_s > 60 {
                String::new()
            } else {
                z.to_string()
            };
            format!("{},20,20,{z}\n", nth * every_s)
        };
        let rows: String = (0..40).map(row).collect();
        scratch.file(name, format!("time_s,room,plate,Z\n{rows}"))
    };
    log("fast.csv", 50.0, 5, false);
    log("slow.csv", 5.0, 5, false);
    log("silent.csv", 5.0, 7, true);
    let tests = r#"
[[tests]]
name = "NAME"
on = ["FIRST.csv", "SECOND.csv"]
expect = [{ of = "drift.Z", at = "1min18s", KEY }]
"#;
    let of = |first: &str, second: &str, key: &str, status: i32| {
        let tests = tests.replace("FIRST", first).replace("SECOND", second);
        let path = scratch.file("graph.toml", graph(&tests.replace("KEY", key)));
        athermal(&[&"test", &path]).ended(status).out
    };
    let slow = "between = [\"59 nm/min\", \"61 nm/min\"]";
    of("slow", "slow", slow, 0);
    let told = of("fast", "slow", slow, 1);
    assert!(told.contains("found 600 nm/min at 75s"), "{told}");
    of("slow", "fast", slow, 1);
    of("silent", "silent", "absent = true", 0);
    of("silent", "slow", "absent = true", 1);
    of("slow", "silent", "absent = true", 1);
}
