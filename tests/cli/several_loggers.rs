//! Temperatures of one logger and positions of another, as one recording.

use std::collections::BTreeMap;
use std::path::Path;

use serde_json::Value;

use crate::workbench::{Graph, Scratch, athermal, case};

fn thermal() -> Graph {
    Graph::new()
        .time("time")
        .with("unit = 'rfc3339'")
        .signal("temperature", "Cel", "spindle bed room", "3min")
        .with("column = '{channel}_degC'")
        .signal("position", "um", "Z", "6min")
        .with("column = '{channel}_um'")
        .slope("drift", "position", "8min", "nm/min")
        .slope("gradients", "temperature", "4min 8min 12min", "")
        .model("thermal", "linear", "gradients", "drift.Z", "0s")
        .outputs("predicted = 'thermal'")
}

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
    let graph = scratch.file("g.toml", thermal());
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
    let graph = scratch.file("g.toml", thermal());
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

#[test]
fn the_starter_of_two_logs_is_that_of_the_same_data_in_one_file() {
    let Some(case) = case("two-loggers") else {
        return;
    };
    let scratch = Scratch::new("two-loggers-init");
    let (one, other) = (case.join("temperatures.csv"), case.join("positions.csv"));
    let table = scratch.file("temperatures.csv", joined([&one, &other]));
    let graph = scratch.path("g.toml");
    let text = |data: &[&Path]| {
        let mut words: Vec<&dyn AsRef<std::ffi::OsStr>> =
            vec![&"init", &"--force", &"-o", &graph, &"--"];
        words.extend(data.iter().map(|of| of as &dyn AsRef<std::ffi::OsStr>));
        athermal(&words).ended(0);
        let text = std::fs::read_to_string(&graph).unwrap();
        let (first, rest) = text.split_once('\n').unwrap();
        (first.to_owned(), rest.to_owned())
    };
    let (_, of_one) = text(&[&table]);
    let (first, of_two) = text(&[&one, &other]);
    assert_eq!(of_two, of_one);
    assert!(
        first.contains("temperatures.csv, positions.csv: 1,080 rows over 12 h"),
        "{first}"
    );
    let model = scratch.path("m.json");
    athermal(&[&"fit", &graph, &"-o", &model, &"--data", &one, &other]).ended(0);
}

/// Rows of two loggers: temperatures each minute, and a position that follows them every two.
fn rows(time: impl Fn(u32) -> String) -> [Vec<(String, String)>; 2] {
    let level = |second: u32, period: f64| (f64::from(second) / period).sin();
    let plate = |second: u32| 24.0 + 3.0 * level(second, 7000.0);
    let temperatures = (0..720).map(|nth| {
        let bed = 24.0 + 2.0 * level(60 * nth + 9000, 9000.0);
        (time(60 * nth), format!("{:.3},{bed:.3}", plate(60 * nth)))
    });
    let positions = (0..360).map(|nth| {
        let second = 120 * nth + 17;
        let z = 3.0 * plate(second) + 5.0 * level(second + 8000, 9000.0);
        (time(second), format!("{z:.3}"))
    });
    [temperatures.collect(), positions.collect()]
}

/// A log with these names and rows, and cells behind each.
fn log(names: &str, rows: &[(String, String)], behind: &str) -> String {
    let rows = rows.iter();
    let rows = rows.map(|(time, cells)| format!("{time},{cells}{behind}\n"));
    format!("{names}\n{}", rows.collect::<String>())
}

fn dated(second: u32) -> String {
    let (hour, minute) = (second / 3600, second / 60 % 60);
    format!("2026-03-02T{hour:02}:{minute:02}:{:02}Z", second % 60)
}

/// What `init` prints of these files, on one line however long their paths are, after which `fit` takes its graph with the same words.
fn started(scratch: &Scratch, more: &[&str], files: &[&Path]) -> (String, String) {
    let graph = scratch.path("g.toml");
    let mut words: Vec<&dyn AsRef<std::ffi::OsStr>> = vec![&"init", &"--force", &"-o", &graph];
    words.extend(more.iter().map(|of| of as &dyn AsRef<std::ffi::OsStr>));
    words.extend(files.iter().map(|of| of as &dyn AsRef<std::ffi::OsStr>));
    let told = athermal(&words).ended(0).told;
    let told = told.split_whitespace().filter(|word| *word != "\\");
    let told = told.collect::<Vec<_>>().join(" ");
    let model = scratch.path("m.json");
    let mut words: Vec<&dyn AsRef<std::ffi::OsStr>> = vec![&"fit", &graph, &"-o", &model];
    words.extend(more.iter().map(|of| of as &dyn AsRef<std::ffi::OsStr>));
    words.push(&"--data");
    words.extend(files.iter().map(|of| of as &dyn AsRef<std::ffi::OsStr>));
    athermal(&words).ended(0);
    (told, std::fs::read_to_string(&graph).unwrap())
}

#[test]
fn logs_that_count_from_one_instant_are_started_with_merge_and_the_next_command_names_it() {
    let scratch = Scratch::new("init-merge");
    let [temperatures, positions] = rows(|second| second.to_string());
    let names = "time_s,plate_degC,bed_degC";
    let one = scratch.file("one.csv", log(names, &temperatures, ""));
    let other = scratch.file("other.csv", log("time_s,Z_um", &positions, ""));
    let graph = scratch.path("none.toml");
    athermal(&[&"init", &one, &other, &"-o", &graph])
        .ended(2)
        .tells(&["give `--merge` if both count from the same instant"]);
    let (told, _) = started(&scratch, &["--merge"], &[&one, &other]);
    assert!(told.contains("g.toml --merge --to "), "{told}");
    let unknown = [&"init" as &dyn AsRef<std::ffi::OsStr>, &one, &other];
    let offset = ["--merge", "--offset", "third.csv=1s", "-o"];
    let mut words = unknown.to_vec();
    words.extend(offset.iter().map(|of| of as &dyn AsRef<std::ffi::OsStr>));
    words.push(&graph);
    athermal(&words).ended(2).tells(&["--offset third.csv"]);
}

#[test]
fn parts_of_one_log_are_joined_and_a_column_of_two_logs_is_left_out() {
    let scratch = Scratch::new("init-parts");
    let [temperatures, positions] = rows(dated);
    let names = "time,plate_degC,bed_degC,battery_V";
    let (early, late) = temperatures.split_at(400);
    let early = scratch.file("early.csv", log(names, early, ",3.6"));
    let late = scratch.file(
        "late.csv",
        log(&format!("{names},room_degC"), late, ",3.5,21"),
    );
    let other = log("time,Z_um,battery_V", &positions, ",3.7");
    let other = scratch.file("other.csv", other);
    let (told, graph) = started(&scratch, &[], &[&late, &other, &early]);
    assert!(
        told.contains("battery_V: left out, it stands in") && told.contains("rename it in one"),
        "{told}"
    );
    assert!(told.contains("room_degC: left out, it is not in"), "{told}");
    assert!(graph.contains(": 1,080 rows over 12 h"), "{graph}");
    assert!(
        !graph.contains("battery") && !graph.contains("room"),
        "{graph}"
    );
}

#[test]
fn a_log_whose_time_has_another_name_and_form_is_merged_by_its_dates() {
    let scratch = Scratch::new("init-times");
    let [temperatures, positions] = rows(dated);
    let names = "time,plate_degC,bed_degC";
    let one = scratch.file("one.csv", log(names, &temperatures, ""));
    let other = scratch.file("other.csv", log("time,Z_um", &positions, ""));
    let (_, alike) = started(&scratch, &[], &[&one, &other]);
    let german = |second: u32| {
        let (hour, minute) = (second / 3600, second / 60 % 60);
        format!("02.03.2026 {hour:02}:{minute:02}:{:02}", second % 60)
    };
    let second = |second: u32| (1_772_409_600 + second).to_string();
    let otherwise: [(&str, &dyn Fn(u32) -> String); 4] = [
        ("Timestamp", &dated),
        ("Zeit", &german),
        ("time", &german),
        ("time_s", &second),
    ];
    for (name, write) in otherwise {
        let [_, positions] = rows(write);
        let other = log(&format!("{name},Z_um"), &positions, "");
        let other = scratch.file("other.csv", other);
        let (told, graph) = started(&scratch, &[], &[&one, &other]);
        assert!(told.contains("its time: "), "{told}");
        let of = |graph: &str| graph.split_once("[signals").unwrap().1.to_owned();
        assert_eq!(of(&graph), of(&alike), "{name}");
    }
    let [_, from_zero] = rows(|second| second.to_string());
    let other = scratch.file("other.csv", log("time_s,Z_um", &from_zero, ""));
    athermal(&[&"init", &one, &other, &"-o", &scratch.path("none.toml")])
        .ended(2)
        .tells(&["other.csv counts its times and", "one.csv has dates; add"]);
    let offset = ["--offset", "other.csv=1772409600s"];
    let (_, graph) = started(&scratch, &offset, &[&one, &other]);
    assert!(graph.contains(": 1,080 rows over 12 h"), "{graph}");
    let [_, american] = rows(|second| format!("03/02/2026 {}", &dated(second)[11..19]));
    let american = scratch.file("us.csv", log("Time,Z_um", &american, ""));
    let [temperatures, _] = rows(german);
    let one = scratch.file(
        "one.csv",
        log("Zeit,plate_degC,bed_degC", &temperatures, ""),
    );
    athermal(&[&"init", &one, &american, &"-o", &scratch.path("none.toml")])
        .ended(2)
        .tells(&[
            "one.csv has time: `Zeit`",
            "us.csv has time: `Time`",
            "write them alike",
        ]);
}

#[test]
fn each_log_has_a_layout_of_its_own_in_the_starter() {
    let scratch = Scratch::new("init-layouts");
    let [temperatures, positions] = rows(dated);
    let names = "time,plate_degC,bed_degC";
    let one = log(names, &temperatures, "")
        .replace(',', ";")
        .replace('.', ",");
    let one = scratch.file("one.csv", one);
    let other = scratch.file("other.csv", log("time,Z_um", &positions, ""));
    let (_, graph) = started(&scratch, &[], &[&one, &other]);
    assert!(
        graph.contains("[[table.files]]\nmatch = \"one.csv\"\nseparator = \";\""),
        "{graph}"
    );
    assert!(!graph.contains("other.csv\"\n"), "{graph}");
}
