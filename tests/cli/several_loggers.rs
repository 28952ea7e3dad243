//! Temperatures of one logger and positions of another, as one recording.

use std::collections::BTreeMap;
use std::path::Path;

use serde_json::Value;

use crate::workbench::{Scratch, athermal, case};

const GRAPH: &str = r#"
schema = 1

[time]
column = "time"
unit = "rfc3339"

[signals.temperature]
unit = "Cel"
channels = ["spindle", "bed", "room"]
column = "{channel}_degC"
max_age = "3min"

[signals.position]
unit = "um"
channels = ["Z"]
column = "{channel}_um"
max_age = "6min"

[nodes.drift]
type = "slope"
inputs.signal = "position"
windows = ["8min"]
unit = "nm/min"

[nodes.gradients]
type = "slope"
inputs.signal = "temperature"
windows = ["4min", "8min", "12min"]

[nodes.thermal]
type = "linear"
inputs.features = "gradients"
inputs.truth = "drift.Z"
ahead = "0s"

[outputs]
predicted = "thermal"
"#;

/// One table of two: a row for each time, with empty cells.
fn joined(files: [&Path; 2]) -> String {
    let mut rows: BTreeMap<String, BTreeMap<String, String>> = BTreeMap::new();
    let mut names = Vec::new();
    for file in files {
        let text = std::fs::read_to_string(file).unwrap();
        let mut lines = text.lines();
        let of_file: Vec<&str> = lines.next().unwrap().split(',').collect();
        for line in lines {
            let cells: Vec<&str> = line.split(',').collect();
            let row = rows.entry(cells[0].to_owned()).or_default();
            for (name, cell) in of_file[1..].iter().zip(&cells[1..]) {
                row.insert((*name).to_owned(), (*cell).to_owned());
            }
        }
        names.extend(of_file[1..].iter().map(|name| (*name).to_owned()));
    }
    let mut text = format!("time,{}\n", names.join(","));
    for (time, row) in rows {
        let cell = |name| row.get(name).cloned().unwrap_or_default();
        let cells: Vec<String> = names.iter().map(cell).collect();
        text += &format!("{time},{}\n", cells.join(","));
    }
    text
}

#[test]
fn two_logs_give_the_model_and_the_scores_of_the_same_data_in_one_file() {
    let Some(case) = case("two-loggers") else {
        return;
    };
    let scratch = Scratch::new("two-loggers");
    let graph = scratch.file("g.toml", GRAPH);
    let (one, other) = (case.join("temperatures.csv"), case.join("positions.csv"));
    let table = scratch.file("table.csv", joined([&one, &other]));
    let model = scratch.path("m.json");
    let of = |data: &[&Path]| {
        let mut words: Vec<&dyn AsRef<std::ffi::OsStr>> =
            vec![&"fit", &graph, &"-o", &model, &"--data"];
        words.extend(data.iter().map(|of| of as &dyn AsRef<std::ffi::OsStr>));
        athermal(&words).ended(0);
        let mut fitted: Value =
            serde_json::from_str(&std::fs::read_to_string(&model).unwrap()).unwrap();
        fitted["card"]["data"].take();
        let mut words: Vec<&dyn AsRef<std::ffi::OsStr>> =
            vec![&"evaluate", &model, &"--format", &"json", &"--data"];
        words.extend(data.iter().map(|of| of as &dyn AsRef<std::ffi::OsStr>));
        let mut scores = athermal(&words).ended(0).json();
        scores["data"].take();
        assert!(scores["scores"][0]["r2_zero"].as_f64().unwrap() > 0.8);
        (fitted, scores)
    };
    let together = of(&[&table]);
    assert_eq!(of(&[&one, &other]), together);
    assert_eq!(of(&[&other, &one]), together);
}

#[test]
fn an_offset_moves_the_times_of_one_log_and_needs_to_name_one() {
    let scratch = Scratch::new("offset");
    let graph = scratch.file("g.toml", GRAPH);
    let time = |at: i64| format!("2026-03-02T{:02}:{:02}:00Z", at / 60, at % 60);
    // Temperatures that go up and down without a period.
    let mut state = 7_u64;
    let mut walk = || {
        let (mut level, mut speed) = (0.0, 0.0);
        let mut step = |_| {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            speed = 0.7 * speed + 0.02 * ((state >> 40) as f64 / f64::from(1 << 24) - 0.5);
            level += speed;
            level
        };
        (0..300).map(&mut step).collect::<Vec<f64>>()
    };
    let (spindle, bed) = (walk(), walk());
    let row = |at: usize| {
        let (spindle, bed) = (25.0 + spindle[at], 25.0 + bed[at]);
        format!("{},{spindle},{bed},21\n", time(at as i64))
    };
    let rows: String = (0..300).map(row).collect();
    let heads = "time,spindle_degC,bed_degC,room_degC\n";
    let one = scratch.file("one.csv", format!("{heads}{rows}"));
    // The position follows the first temperature, and its clock is 7 minutes ahead.
    let row = |at: usize| format!("{},{}\n", time(at as i64 + 7), 3.0 * spindle[at]);
    let rows: String = (0..290).map(row).collect();
    let other = scratch.file("other.csv", format!("time,Z_um\n{rows}"));
    let fit = |offset: &str| {
        let output = scratch.path("m.json");
        let words: [&dyn AsRef<std::ffi::OsStr>; 10] = [
            &"fit",
            &graph,
            &"-o",
            &output,
            &"--format",
            &"json",
            &"--offset",
            &offset,
            &"--data",
            &one,
        ];
        let mut words = words.to_vec();
        words.push(&other);
        athermal(&words)
    };
    let error = |offset: &str| {
        let fitted = fit(offset).ended(0).json();
        fitted["estimators"][0]["in_sample_rmse"].as_f64().unwrap()
    };
    let (moved, as_is) = (error("other.csv=-7min"), error("other.csv=0s"));
    assert!(10.0 * moved < as_is, "{moved} {as_is}");
    let model = scratch.path("m.json");
    let diagnosed = |offset: &str| {
        fit(offset).ended(0);
        let words: [&dyn AsRef<std::ffi::OsStr>; 8] = [
            &"diagnose",
            &model,
            &"--format",
            &"json",
            &"--offset",
            &offset,
            &"--data",
            &one,
        ];
        let mut words = words.to_vec();
        words.push(&other);
        athermal(&words).ended(0).json()["offsets"][0].clone()
    };
    let offset = diagnosed("other.csv=0s");
    assert!(offset["is_significant"].as_bool().unwrap(), "{offset}");
    let (found, error) = (
        offset["offset_s"].as_f64().unwrap(),
        offset["error_s"].as_f64().unwrap(),
    );
    assert!(
        (found + 420.0).abs() <= 2.0 * error && error < 60.0,
        "{offset}"
    );
    let offset = diagnosed("other.csv=-7min");
    let left = offset["offset_s"].as_f64().unwrap() + 420.0;
    assert!(left.abs() <= 60.0, "{offset}");
    fit("third.csv=1s")
        .ended(2)
        .tells(&["--offset third.csv", "one.csv"]);
    fit("one.csv")
        .ended(2)
        .tells(&["such as `positions.csv=1.5s`"]);
}
