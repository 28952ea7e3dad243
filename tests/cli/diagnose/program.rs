//! What `athermal diagnose` prints, draws and warns of.

use std::ffi::OsStr;
use std::fmt::Write as _;
use std::path::Path;

use super::{noise, two_sensors, wandering};
use crate::workbench::{Graph, Scratch, athermal, athermal_on, graph, one_axis, simulated};

#[test]
fn the_program_tells_everything_in_eighty_columns_and_as_json_and_draws_it() {
    let scratch = Scratch::new("diagnose");
    let week = simulated(&scratch, "log.csv", "die-tester", 3.0, 1);
    let (model, plots) = (scratch.path("model.json"), scratch.path("plots"));
    athermal_on("fit", &one_axis(&scratch), &week, &[&"-o", &model]).ended(0);
    let diagnosed =
        |more: &[&dyn AsRef<OsStr>]| athermal_on("diagnose", &model, &week, more).ended(0);
    let told = diagnosed(&[&"--window", &"--plots", &plots]);
    for line in told.out.lines() {
        assert!(line.chars().count() <= 80, "{line}");
    }
    for section in [
        "residuals: ",
        "correlation of features",
        "thermal: how far a step of 1 K",
        "how well the data determine",
        "what each sensor moves",
        "RMSE in nm/min of each day",
        "how many days are needed",
        "signal to noise",
    ] {
        assert!(
            told.out.contains(section),
            "no `{section}` in:\n{}",
            told.out
        );
    }
    // The simulated room tells something of what the vote leaves.
    assert!(
        told.told.contains("diagnose") && told.told.contains("--of "),
        "{}",
        told.told
    );
    for line in told.told.lines() {
        assert!(line.chars().count() <= 80 || line.contains('/'), "{line}");
    }
    let pictures = [
        "autocorrelation-vote.Z1",
        "lags-drift.Z1",
        "impulse-thermal.Z1",
        "days",
        "windows",
    ];
    for name in pictures {
        let name = format!("{}.svg", name.replace('.', "_"));
        let svg = std::fs::read_to_string(plots.join(&name)).unwrap();
        assert!(svg.starts_with("<svg") && !svg.contains("NaN"), "{name}");
    }
    let facts = diagnosed(&[&"--no-fit", &"--format", &"json"]).json();
    assert_eq!(facts["diagnosis"]["main"].as_array().unwrap().len(), 1);
    assert!(facts["diagnosis"]["days"].is_null());
    let few = scratch.path("few");
    let of_one = diagnosed(&[&"--no-fit", &"--of", &"thermal.Z1", &"--plots", &few]);
    assert!(
        of_one.out.contains("per σ") && !of_one.out.contains("vote."),
        "{}",
        of_one.out
    );
    assert!(of_one.out.contains("left of it by thermal.Z1"));
    let drawn = std::fs::read_dir(few).unwrap();
    let mut drawn: Vec<_> = drawn
        .map(|file| file.unwrap().file_name().into_string().unwrap())
        .filter(|name| name.ends_with(".svg"))
        .collect();
    drawn.sort();
    let expected = [
        "autocorrelation-thermal_Z1.svg",
        "impulse-thermal_Z1.svg",
        "lags-drift_Z1.svg",
        "lags-residual-drift_Z1.svg",
        "step-thermal_Z1.svg",
    ];
    assert_eq!(drawn, expected);
}

#[test]
fn predictions_that_are_put_out_and_not_shown_are_named() {
    let scratch = Scratch::new("diagnose-others");
    let log = simulated(&scratch, "log.csv", "die-tester", 0.2, 1);
    let text = format!(
        "schema = 1\nextends = {:?}\ntests = []\n[nodes.same]\ntype = \"persistence\"\neach = \"axis\"\n\
         inputs.truth = \"drift.{{axis}}\"\nahead = \"5min\"\n[outputs]\nlast = \"same\"\n",
        graph("die-tester")
    );
    let graph = scratch.file("graph.toml", text);
    let model = scratch.path("model.json");
    athermal_on("fit", &graph, &log, &[&"-o", &model]).ended(0);
    let diagnosed = |more: &[&dyn AsRef<OsStr>]| {
        let no_fit: [&dyn AsRef<OsStr>; 1] = [&"--no-fit"];
        athermal_on("diagnose", &model, &log, &[&no_fit[..], more].concat()).ended(0)
    };
    diagnosed(&[]).tells(&["the first prediction of each truth", "--of same"]);
    for more in [
        [&"--of" as &dyn AsRef<OsStr>, &"same"],
        [&"--format", &"json"],
    ] {
        let told = diagnosed(&more).told;
        assert!(!told.contains("the first prediction"), "{told}");
    }
}

#[test]
fn what_cannot_be_diagnosed_is_told_with_a_way_out() {
    let scratch = Scratch::new("undiagnosed");
    let log = simulated(&scratch, "log.csv", "die-tester", 0.2, 1);
    let model = scratch.path("model.json");
    let graph = one_axis(&scratch);
    athermal_on("fit", &graph, &log, &[&"-o", &model]).ended(0);
    let of = |graph: &Path, more: &[&dyn AsRef<OsStr>]| athermal_on("diagnose", graph, &log, more);
    let unknown = of(&model, &[&"--no-fit", &"--of", &"Z9"]);
    unknown.ended(2).tells(&["nothing called `Z9`", "vote.Z1"]);
    let never = of(&model, &[&"--day", &"0s"]);
    never.ended(2).tells(&["--day is 0s"]);
    let short = of(&model, &[]);
    short.ended(0).tells(&["a shorter --day"]);
    let countless = of(&model, &[&"--day", &"1ns"]);
    countless.ended(0).tells(&["a longer --day"]);
    let unfitted = of(&graph, &[]);
    unfitted.ended(2).tells(&["fit"]);
}

#[test]
fn why_there_is_nothing_is_said_and_nothing_is_told_as_no_number() {
    let scratch = Scratch::new("nothing");
    let log = |name: &str, white: fn(usize) -> String| {
        let rows = (0..200).map(|row| format!("{row},{},\n", white(row)));
        let rows: String = rows.collect();
        scratch.file(name, format!("time_s,white,smooth\n{rows}"))
    };
    let graph = scratch.file("noise.toml", noise());
    let empty = log("empty.csv", |_| String::new());
    let told = athermal_on("diagnose", &graph, &empty, &[&"--no-fit", &"--window"]);
    let told = told.ended(0);
    told.tells(&["no value of the truth y.white", "no truth is a slope"]);
    assert!(!told.out.contains("NaN"), "{}", told.out);
    // A multiplicative hash stands in for noise.
    let noise = log("noise.csv", |row| {
        let bits = (row as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 40;
        (bits % 1009).to_string()
    });
    let told = athermal_on(
        "diagnose",
        &graph,
        &noise,
        &[&"--no-fit", &"--of", &"white"],
    );
    let told = told.ended(0);
    assert!(
        told.out.contains("where p is not below 0.01"),
        "{}",
        told.out
    );
    assert!(!told.told.contains("--window"), "{}", told.told);
    let of_one: [&dyn AsRef<OsStr>; 5] = [&"--no-fit", &"--of", &"white", &"--format", &"json"];
    let facts = athermal_on("diagnose", &graph, &noise, &of_one);
    let facts = facts.ended(0).json();
    let residuals = facts["diagnosis"]["residuals"].as_array().unwrap();
    assert_eq!(residuals.len(), 1);
    assert_eq!(residuals[0]["level"], 0.01);
    assert!(residuals[0]["white"].is_boolean());
}

#[test]
fn a_truth_that_never_changes_is_called_so_and_no_number_of_days_enough_for_it() {
    let scratch = Scratch::new("diagnose-constant");
    let rows: String = (0..400)
        .map(|row| format!("{row},{},7\n", row % 5))
        .collect();
    let data = scratch.file("still.csv", format!("s,u,y\n{rows}"));
    let text = Graph::new()
        .time("s")
        .signal("in", "V", "u", "1s")
        .with("column = '{channel}'")
        .signal("out", "nm", "y", "1s")
        .with("column = '{channel}'")
        .model("m", "linear", "in", "out.y", "0s")
        .outputs("p = 'm'");
    let (graph, model) = (scratch.file("graph.toml", text), scratch.path("model.json"));
    athermal_on("fit", &graph, &data, &[&"-o", &model]).ended(0);
    let told = athermal_on("diagnose", &model, &data, &[&"--day", &"100s"]).ended(0);
    assert!(told.out.contains("constant"), "{}", told.out);
    assert!(told.out.contains("nothing to compare"), "{}", told.out);
    assert!(!told.out.contains("enough to come within"), "{}", told.out);
}

#[test]
fn what_is_infinite_is_told_as_such_in_the_table_and_as_json() {
    let scratch = Scratch::new("diagnose-collinear");
    let text = r#"schema = 1
name = "twice"
time.column = "time_s"
signals.room = { unit = "Cel", channels = ["a", "b"], max_age = "1min" }
signals.position = { unit = "nm", channels = ["x"], max_age = "1min" }
nodes.drift = { type = "slope", inputs.signal = "position", windows = ["1min"], unit = "nm/min" }
nodes.room_slopes = { type = "slope", inputs.signal = "room", windows = ["1min"], unit = "mK/min" }
nodes.model = { type = "linear", inputs.features = "room_slopes", inputs.truth = "drift.x", ahead = "0s" }
outputs.predicted = "model"
"#;
    let graph = scratch.file("twice.toml", text);
    let rows = (0..300).map(|row| {
        let room = 20.0 + f64::from(row % 37) / 10.0;
        format!("{},{room},{room},{}\n", 10 * row, row % 11)
    });
    let rows: String = rows.collect();
    let log = scratch.file("log.csv", format!("time_s,a,b,x\n{rows}"));
    let model = scratch.path("model.json");
    athermal_on("fit", &graph, &log, &[&"-o", &model]).ended(0);
    let table = athermal_on("diagnose", &model, &log, &[&"--no-fit"]).ended(0);
    assert!(table.out.contains("inf  inf"), "{}", table.out);
    let of = athermal_on(
        "diagnose",
        &model,
        &log,
        &[&"--no-fit", &"--format", &"json"],
    );
    let design = &of.ended(0).json()["diagnosis"]["designs"][0];
    assert_eq!(design["condition"], "inf", "{design}");
    assert_eq!(design["regressors"][0]["inflation"], "inf", "{design}");
}

#[test]
fn the_coefficients_it_points_to_are_there_for_a_node_without_each_too() {
    let scratch = Scratch::new("diagnose-without-each");
    let graph = scratch.file("graph.toml", two_sensors());
    // The position answers a temperature ten minutes late, so that what is left goes with a feature that is used.
    let table = wandering(6000, |course, row| {
        1000.0 * course[row.saturating_sub(60)][0]
    });
    let rows = table.events().iter().enumerate().map(|(row, (_, values))| {
        let [a, b, z] = values[..] else {
            panic!("{values:?}")
        };
        format!("{},{a},{b},{z}\n", 10 * row)
    });
    let rows: String = rows.collect();
    let log = scratch.file("log.csv", format!("time_s,a,b,z\n{rows}"));
    let model = scratch.path("model.json");
    athermal_on("fit", &graph, &log, &[&"-o", &model]).ended(0);
    let told = athermal_on("diagnose", &model, &log, &[&"--no-fit"]).ended(0);
    told.tells(&["What thermal.z leaves goes with", "coefficients:"]);
    let asked = told.told.lines().find(|line| line.contains("--node"));
    let asked = asked.unwrap().rsplit(' ').next().unwrap();
    let show = [
        &"show" as &dyn AsRef<OsStr>,
        &model,
        &"--format",
        &"coefficients",
        &"--node",
        &asked,
    ];
    athermal(&show).ended(0);
}

/// Three hours and a half of two sensors, of which the second lacks every eighth sample but for the second hour, and what both
/// bring about.
fn with_gaps() -> String {
    let mut text = "time_s,a,b,y\n".to_owned();
    for nth in 0..1260 {
        let (a, b) = ((0.11 * f64::from(nth)).sin(), (0.37 * f64::from(nth)).cos());
        let hour = nth / 360;
        let there = hour == 1 || nth % 8 != 0;
        let shown = if there { b.to_string() } else { String::new() };
        let y = a + b + 0.1 * (2.9 * f64::from(nth)).sin();
        writeln!(text, "{},{a},{shown},{y}", 10 * nth).unwrap();
    }
    text
}

const DIRECT: &str = "schema = 1\n[time]\ncolumn = \"time_s\"\n[signals.in]\nunit = \"V\"\nchannels = [\"a\", \"b\"]\ncolumn = \"{channel}\"\nmax_age = \"5s\"\n\
    [signals.out]\nunit = \"V\"\nchannels = [\"y\"]\ncolumn = \"{channel}\"\nmax_age = \"5s\"\n\
    [nodes.model]\ntype = \"linear\"\ninputs = { features = \"in\", truth = \"out.y\" }\nahead = \"20s\"\n[outputs]\nmodel = \"model\"\n";

#[test]
fn a_sensor_that_stands_still_stands_before_no_other_among_the_correlations() {
    let scratch = Scratch::new("diagnose-still");
    let graph = scratch.file("graph.toml", DIRECT);
    let log = scratch.file("log.csv", with_gaps());
    let model = scratch.path("model.json");
    athermal_on("fit", &graph, &log, &[&"-o", &model]).ended(0);
    let rows = (0..1260).map(|nth| {
        let a = (0.11 * f64::from(nth)).sin();
        format!("{},{a},0.5,{}\n", 10 * nth, a + 0.5)
    });
    let rows: String = rows.collect();
    let log = scratch.file("still.csv", format!("time_s,a,b,y\n{rows}"));
    let told = athermal_on("diagnose", &model, &log, &[&"--no-fit"]).ended(0);
    let (_, correlations) = told.out.split_once("largest correlation").unwrap();
    let told_why = "the one or the other never changes";
    assert!(correlations.contains(told_why), "{correlations}");
    let lines = correlations.lines().map(str::trim);
    let listed: Vec<&str> = lines.skip_while(|line| *line != "out.y").take(3).collect();
    assert!(listed[1].starts_with("in.a "), "{correlations}");
    assert_eq!(listed[2], "without a correlation: 1");
}

#[test]
fn a_fit_on_other_days_that_does_without_a_sensor_is_told() {
    let scratch = Scratch::new("diagnose-dropped");
    let graph = scratch.file("graph.toml", DIRECT);
    let log = scratch.file("log.csv", with_gaps());
    let model = scratch.path("model.json");
    athermal(&[&"fit", &graph, &"--data", &log, &"-o", &model]).ended(0);
    let told = athermal(&[&"diagnose", &model, &"--data", &log, &"--day", &"1h"]).ended(0);
    told.tells(&["model: in.b has a value in too few rows for fits without day 2"]);
}

#[test]
fn the_rows_that_tell_how_well_data_determine_a_model_are_those_of_its_fit() {
    let scratch = Scratch::new("diagnose-rows");
    let graph = scratch.file("graph.toml", DIRECT.replace("20s", "200s"));
    let log = scratch.file("log.csv", with_gaps());
    let model = scratch.path("model.json");
    let fitted = athermal(&[
        &"fit",
        &graph,
        &"--data",
        &log,
        &"-o",
        &model,
        &"--format",
        &"json",
    ]);
    let fitted = fitted.ended(0).json();
    let diagnosed = athermal(&[
        &"diagnose",
        &model,
        &"--data",
        &log,
        &"--no-fit",
        &"--format",
        &"json",
    ]);
    let diagnosed = diagnosed.ended(0).json();
    let (fit, design) = (
        &fitted["estimators"][0],
        &diagnosed["diagnosis"]["designs"][0],
    );
    assert_eq!(fit["rows"], design["rows"], "{fit} {design}");
    let number = |of: &serde_json::Value| of.as_f64().unwrap();
    let conditions = [&fit["condition"], &design["condition"]].map(number);
    assert!(
        (conditions[0] / conditions[1] - 1.0).abs() < 1e-9,
        "{conditions:?}"
    );
}

#[test]
fn answers_of_instances_that_predict_the_same_are_told_by_the_instances() {
    let scratch = Scratch::new("diagnose-same-truth");
    let sensors = two_sensors();
    let (head, rest) = sensors.split_once("[nodes.thermal]").unwrap();
    let rest = rest.replace("\"gradients\"", "\"gradients.{sensor}@*\"");
    let text =
        format!("{head}[sets]\nsensor = [\"a\", \"b\"]\n[nodes.thermal]\neach = \"sensor\"{rest}");
    let graph = scratch.file("graph.toml", text);
    let mut rows = String::from("time_s,a,b,z\n");
    for row in 0..800 {
        let t = f64::from(row) * 10.0;
        let (a, b) = ((t / 700.0).sin(), (t / 1100.0).cos());
        let _ = writeln!(
            rows,
            "{t},{},{},{}",
            20.0 + a,
            20.0 + b,
            50.0 * a - 30.0 * b
        );
    }
    let log = scratch.file("log.csv", rows);
    let model = scratch.path("model.json");
    athermal_on("fit", &graph, &log, &[&"-o", &model]).ended(0);
    let told = athermal_on(
        "diagnose",
        &model,
        &log,
        &[&"--no-fit", &"--of", &"thermal"],
    )
    .ended(0);
    let (_, answers) = told.out.split_once("thermal: how far a step").unwrap();
    let heading = answers.lines().nth(1).unwrap();
    let columns: Vec<&str> = heading.split_whitespace().collect();
    assert_eq!(columns, ["sensor", "a", "b"]);
}

#[test]
fn a_condition_is_told_of_models_that_their_regressors_determine_and_of_no_others() {
    let scratch = Scratch::new("diagnose-filters");
    let (signals, nodes) = DIRECT.split_once("[nodes.model]\n").unwrap();
    let (node, _) = nodes.split_once("[outputs]").unwrap();
    let past = node.replace("\"linear\"", "\"arx\"\nlags = [\"0s\"]");
    let filter = node.replace("\"linear\"", "\"oe\"");
    let text = format!(
        "{signals}[nodes.past]\n{past}[nodes.filter]\n{filter}[outputs]\npast = \"past\"\nfilter = \"filter\"\n"
    );
    let graph = scratch.file("graph.toml", text);
    let log = scratch.file("log.csv", with_gaps());
    let model = scratch.path("model.json");
    athermal_on("fit", &graph, &log, &[&"-o", &model]).ended(0);
    let more: [&dyn AsRef<std::ffi::OsStr>; 3] = [&"--no-fit", &"--format", &"json"];
    let facts = athermal_on("diagnose", &model, &log, &more).json();
    let designs = facts["diagnosis"]["designs"].as_array().unwrap();
    let of = |node: &str| {
        designs
            .iter()
            .find(|of| of["node"] == node)
            .unwrap_or_else(|| panic!("{designs:?}"))
    };
    assert!(of("past")["condition"].as_f64().unwrap() >= 1.0);
    assert!(of("filter")["condition"].is_null());
    let inflation = |of: &serde_json::Value| of["regressors"][0]["inflation"].clone();
    assert!(inflation(of("past")).is_f64() && inflation(of("filter")).is_null());
}
