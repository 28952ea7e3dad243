//! Decides what pictures of a diagnosis must show.

use std::fmt::Write as _;

use super::two_sensors;
use crate::workbench::{Graph, Scratch, athermal_on};

#[test]
fn answers_to_sensors_of_different_units_are_drawn_apart() {
    let scratch = Scratch::new("diagnose-units");
    let graph = scratch.file(
        "graph.toml",
        Graph::new()
            .time("time_s")
            .signal("temperature", "Cel", "bed", "1min")
            .signal("load", "%", "spindle", "1min")
            .signal("position", "um", "Z", "1min")
            .model("model", "linear", "temperature load", "position.Z", "0s")
            .outputs("predicted = 'model'"),
    );
    let mut rows = String::from("time_s,bed,spindle,Z\n");
    for row in 0..200 {
        let (bed, spindle) = (f64::from(row % 17), f64::from(row % 5));
        let _ = writeln!(
            rows,
            "{},{bed},{spindle},{}",
            10 * row,
            2.0 * bed + 0.1 * spindle
        );
    }
    let log = scratch.file("log.csv", rows);
    let (model, plots) = (scratch.path("model.json"), scratch.path("plots"));
    athermal_on("fit", &graph, &log, &[&"-o", &model]).ended(0);
    athermal_on("diagnose", &model, &log, &[&"--no-fit", &"--plots", &plots]).ended(0);
    for (name, label, sensor, other) in [
        ("step-model.svg", "um per K", ">bed<", ">spindle<"),
        ("step-model-2.svg", "um per %", ">spindle<", ">bed<"),
    ] {
        let svg = std::fs::read_to_string(plots.join(name)).unwrap();
        assert!(svg.contains(label) && svg.contains(sensor), "{name}: {svg}");
        assert!(!svg.contains(other), "{name}: {svg}");
    }
}

#[test]
fn a_legend_keeps_channels_of_one_name_apart() {
    let scratch = Scratch::new("diagnose-legend");
    let both = "inputs.features = [\"gradients\", \"temperature\"]";
    let text = two_sensors()
        .replace("inputs.features = \"gradients\"", both)
        .replace("\"150s\", \"10min\"", "\"150s\"");
    let (model, log) = fitted(&scratch, &text);
    let plots = scratch.path("plots");
    athermal_on("diagnose", &model, &log, &[&"--no-fit", &"--plots", &plots]).ended(0);
    let svg = std::fs::read_to_string(plots.join("lags-drift_z.svg")).unwrap();
    let legend = |of: &str| svg.contains(&format!(">{of}<"));
    assert!(legend("temperature.a") && !legend("a"), "{svg}");
}

#[test]
fn every_prediction_that_is_asked_for_is_drawn() {
    let scratch = Scratch::new("diagnose-asked");
    let graph = two_sensors();
    let (before, thermal) = graph.split_once("[nodes.thermal]").unwrap();
    let (thermal, outputs) = thermal.split_once("[outputs]").unwrap();
    let text = format!(
        "{before}[nodes.thermal]{thermal}[nodes.other]{thermal}[outputs]{outputs}other = \"other\"\n"
    );
    let (model, log) = fitted(&scratch, &text);
    let plots = scratch.path("plots");
    let more: [&dyn AsRef<std::ffi::OsStr>; 6] = [
        &"--no-fit",
        &"--of",
        &"thermal",
        &"other",
        &"--plots",
        &plots,
    ];
    athermal_on("diagnose", &model, &log, &more).ended(0);
    for name in [
        "autocorrelation-thermal_z.svg",
        "autocorrelation-other_z.svg",
    ] {
        assert!(plots.join(name).exists(), "{name}");
    }
}

#[test]
fn an_answer_is_drawn_from_the_step_on_though_nothing_is_predicted_so_near() {
    let scratch = Scratch::new("diagnose-from-the-step");
    let text = two_sensors().replace("ahead = \"0s\"", "ahead = \"10min\"");
    let (model, log) = fitted(&scratch, &text);
    let plots = scratch.path("plots");
    athermal_on("diagnose", &model, &log, &[&"--no-fit", &"--plots", &plots]).ended(0);
    let svg = std::fs::read_to_string(plots.join("step-thermal.svg")).unwrap();
    let (_, along_x) = svg.split_once("class=\"ticks\"").unwrap();
    let (_, first) = along_x.split_once("<text").unwrap();
    let (_, first) = first.split_once('>').unwrap();
    assert!(first.starts_with("0<"), "{first}");
}

/// A model of two sensors, and the log that it is fitted on.
fn fitted(scratch: &Scratch, text: &str) -> (std::path::PathBuf, std::path::PathBuf) {
    let graph = scratch.file("graph.toml", text);
    let mut rows = String::from("time_s,a,b,z\n");
    for row in 0..800 {
        let t = f64::from(row) * 10.0;
        let (a, b) = ((t / 700.0).sin(), (t / 1100.0).cos());
        let z = 50.0 * a - 30.0 * b;
        let _ = writeln!(rows, "{t},{},{},{z}", 20.0 + a, 20.0 + b);
    }
    let log = scratch.file("log.csv", rows);
    let model = scratch.path("model.json");
    athermal_on("fit", &graph, &log, &[&"-o", &model]).ended(0);
    (model, log)
}
