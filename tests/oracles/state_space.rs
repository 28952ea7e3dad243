//! State spaces on systems that are known: how far a free run of the model is from what was measured.

use crate::workbench::{Scratch, athermal, data, graph};

/// `R²` about the mean of a free run over the rows of a file after the first ones, on which a shipped graph was fitted, of
/// its nodes `arx` and `states`; and what the fit told of the latter.
fn free_run(name: &str, file: &str, first: usize) -> Option<([f64; 2], String)> {
    let text = std::fs::read_to_string(data()?.join(file)).unwrap();
    let scratch = Scratch::new(&format!("state-space-{name}"));
    let lines: Vec<&str> = text.lines().collect();
    let part = |name: &str, rows: &[&str]| {
        scratch.file(name, format!("{}\n{}\n", lines[0], rows.join("\n")))
    };
    let train = part("train.csv", &lines[1..=first]);
    let test = part("test.csv", &lines[first + 1..]);
    let model = scratch.path("model.json");
    let fit: [&dyn AsRef<std::ffi::OsStr>; 6] =
        [&"fit", &graph(name), &"--data", &train, &"--output", &model];
    let fit = athermal(&fit).ended(0);
    let run: [&dyn AsRef<std::ffi::OsStr>; 8] = [
        &"evaluate",
        &model,
        &"--data",
        &test,
        &"--mode",
        &"free-run",
        &"--format",
        &"json",
    ];
    let told = athermal(&run).ended(0).json();
    let r2 = |node: &str| {
        let scores = told["scores"].as_array().unwrap();
        let score = scores.iter().find(|score| score["node"] == node).unwrap();
        score["r2_mean"].as_f64().unwrap()
    };
    Some((
        [r2("arx"), r2("states")],
        format!("{}{}", fit.told, fit.out),
    ))
}

#[test]
fn a_wall_of_two_layers_runs_free_no_worse_than_its_arx() {
    let Some(([arx, states], told)) = free_run("wall-heatflow", "wall-heatflow/wall.csv", 1176)
    else {
        return;
    };
    assert!(states >= 0.97 && states >= arx, "{states} against {arx}");
    assert!(told.contains("from the singular values 0.99"), "{told}");
}

#[test]
fn a_heating_system_runs_free_no_worse_than_its_arx() {
    let Some(([arx, states], _)) = free_run("heating-system", "heating-system/heating.csv", 560)
    else {
        return;
    };
    assert!(states >= 0.72 && states >= arx, "{states} against {arx}");
}

#[test]
fn a_dryer_runs_free_from_its_first_truth() {
    // What was before the first row is not known, and counts: from the state that it had there it would reach 0.98.
    let Some(([_, states], _)) = free_run("hairdryer", "hairdryer/hairdryer.csv", 500) else {
        return;
    };
    assert!(states >= 0.95, "{states}");
}
