//! What `check`, `explain` and `diff` print, and the status with which they end.

use crate::workbench::{Graph, Scratch, athermal, graph};

#[test]
fn a_forecast_and_a_virtual_sensor_differ_in_their_horizons() {
    let told = athermal(&[&"diff", &graph("die-tester"), &graph("die-tester-sensor")]).ended(1);
    insta::assert_snapshot!(told.out);
}

#[test]
fn a_graph_does_not_differ_from_itself() {
    let told = athermal(&[&"diff", &graph("z-probe"), &graph("z-probe")]).ended(0);
    assert_eq!(told.out, "");
}

#[test]
fn differences_are_told_to_programs_too() {
    let (one, other) = (graph("die-tester"), graph("die-tester-sensor"));
    let told = athermal(&[&"diff", &"--format", &"json", &one, &other]).json();
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
    let told = athermal(&[&"explain", &"a052"]).ended(0);
    insta::assert_snapshot!(told.out);
    athermal(&[&"explain", &"A000"]).ended(2);
}

#[test]
fn a_warning_is_a_no_only_where_that_is_asked_for() {
    let page = athermal(&[&"explain", &"--format", &"json", &"A060"]).json();
    let scratch = Scratch::new("unused");
    let file = scratch.file("graph.toml", page["wrong"].as_str().unwrap());
    athermal(&[&"check", &file]).ended(0);
    athermal(&[&"check", &"--strict", &file]).ended(1);
    let told = athermal(&[&"check", &"--format", &"json", &file]).json();
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
}

#[test]
fn a_model_that_could_not_be_fitted_differs_from_one_that_was() {
    let scratch = Scratch::new("unfitted");
    let graph = scratch.file(
        "graph.toml",
        Graph::new()
            .time("time_s")
            .signal("t", "Cel", "a", "1min")
            .with("column = '{channel}'")
            .signal("z", "nm", "z", "1min")
            .with("column = '{channel}'")
            .model("plain", "linear", "t", "z", "0s")
            .outputs("out = 'plain'"),
    );
    let rows: String = (0..60)
        .map(|row| format!("{},{},{}\n", 10 * row, 20 + row % 7, row % 7))
        .collect();
    let data = scratch.file("data.csv", format!("time_s,a,z\n{rows}"));
    let fitted = scratch.path("fitted.json");
    athermal(&[&"fit", &graph, &"--data", &data, &"-o", &fitted]).ended(0);
    let mut model: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(&fitted).unwrap()).unwrap();
    model["fitted"] = serde_json::json!({});
    let unfitted = scratch.file("unfitted.json", model.to_string());
    let told = athermal(&[&"diff", &fitted, &unfitted]).ended(1);
    assert_eq!(told.out, "fitted parameters\n  ~ plain\n");
}

#[test]
fn a_number_in_the_place_of_a_table_is_reported() {
    let scratch = Scratch::new("language-commands-table");
    let text = std::fs::read_to_string(graph("die-tester")).unwrap();
    let wrong = text.replace(
        "[outputs]",
        "[nodes.online]\ntype = \"rls\"\neach = \"axis\"\ninputs.features = \"gradients\"\n\
         inputs.truth = \"drift.{axis}\"\nahead = \"5min\"\nselection = 0.99\n[outputs]",
    );
    let wrong = scratch.file("wrong.toml", wrong);
    let expected = "expected a table for \"selection\", found the number 0.99";
    athermal(&[&"check", &wrong]).ended(2).tells(&[expected]);
}
