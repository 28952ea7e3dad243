//! What `check`, `explain` and `diff` print, and the status with which they end.

#![allow(clippy::unwrap_used)]

mod workbench;

use std::process::{Command, Output};

use workbench::Scratch;

fn athermal(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_athermal"))
        .args(arguments)
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

#[test]
fn a_forecast_and_a_virtual_sensor_differ_in_their_horizons() {
    let output = athermal(&[
        "diff",
        "graphs/die-tester.toml",
        "graphs/die-tester-sensor.toml",
    ]);
    assert_eq!(output.status.code(), Some(1));
    insta::assert_snapshot!(text(&output.stdout));
}

#[test]
fn a_graph_does_not_differ_from_itself() {
    let output = athermal(&["diff", "graphs/z-probe.toml", "graphs/z-probe.toml"]);
    assert_eq!(
        (output.status.code(), text(&output.stdout)),
        (Some(0), String::new())
    );
}

#[test]
fn differences_are_told_to_programs_too() {
    let output = athermal(&[
        "diff",
        "--format",
        "json",
        "graphs/die-tester.toml",
        "graphs/die-tester-sensor.toml",
    ]);
    let told: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(told["same"], false);
    let thermal = told["nodes"]
        .as_array()
        .unwrap()
        .iter()
        .find(|node| node["instance"] == "thermal.Z1")
        .unwrap();
    assert_eq!(thermal["change"], "changed");
    assert_eq!(
        thermal["parameters"][0],
        serde_json::json!({ "path": "ahead", "from": "5min", "to": "0s" })
    );
}

#[test]
fn a_code_is_explained_with_a_wrong_and_a_right_graph() {
    let output = athermal(&["explain", "a052"]);
    assert_eq!(output.status.code(), Some(0));
    insta::assert_snapshot!(text(&output.stdout));
    let unknown = athermal(&["explain", "A000"]);
    assert_eq!(unknown.status.code(), Some(2));
}

#[test]
fn a_warning_is_a_no_only_where_that_is_asked_for() {
    let file = std::env::temp_dir().join(format!("athermal-unused-{}.toml", std::process::id()));
    let page = athermal(&["explain", "--format", "json", "A060"]);
    let page: serde_json::Value = serde_json::from_slice(&page.stdout).unwrap();
    std::fs::write(&file, page["wrong"].as_str().unwrap()).unwrap();
    let path = file.to_str().unwrap();
    assert_eq!(athermal(&["check", path]).status.code(), Some(0));
    assert_eq!(
        athermal(&["check", "--strict", path]).status.code(),
        Some(1)
    );
    let json = athermal(&["check", "--format", "json", path]);
    let told: serde_json::Value = serde_json::from_slice(&json.stdout).unwrap();
    let first = &told["diagnostics"][0];
    assert_eq!(
        (
            &first["code"],
            &first["severity"],
            &first["line"],
            &first["column"]
        ),
        (&"A060".into(), &"warning".into(), &4.into(), &10.into())
    );
    std::fs::remove_file(file).unwrap();
}

#[test]
fn a_model_that_could_not_be_fitted_differs_from_one_that_was() {
    let scratch = Scratch::new("unfitted");
    let graph = scratch.file(
        "graph.toml",
        r#"schema = 1
[time]
column = "time_s"
[signals.t]
unit = "Cel"
channels = ["a"]
column = "{channel}"
max_age = "1min"
[signals.z]
unit = "nm"
channels = ["z"]
column = "{channel}"
max_age = "1min"
[nodes.plain]
type = "linear"
inputs.features = "t"
inputs.truth = "z"
ahead = "0s"
[outputs]
out = "plain"
"#,
    );
    let rows: String = (0..60)
        .map(|row| format!("{},{},{}\n", 10 * row, 20 + row % 7, row % 7))
        .collect();
    let header = "time_s,a,z\n";
    let full = scratch.file("full.csv", format!("{header}{rows}"));
    let empty = scratch.file("empty.csv", header);
    let models = [(full, "fitted.json", 0), (empty, "unfitted.json", 1)];
    let [fitted, unfitted] = models.map(|(data, model, status)| {
        let model = scratch.path(model);
        workbench::athermal(&[&"fit", &graph, &"--data", &data, &"-o", &model]).ended(status);
        model
    });
    let told = workbench::athermal(&[&"diff", &fitted, &unfitted]).ended(1);
    assert_eq!(told.out, "fitted parameters\n  ~ plain\n");
}
