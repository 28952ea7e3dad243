//! What `athermal run --format json` tells programs on standard error: an object a line, beside rows that are as they were.

use std::ffi::OsStr;
use std::io::Write;
use std::process::{Command, Stdio};
use std::time::Duration;

use crate::workbench::{Finished, Scratch, athermal, athermal_fed};
use serde_json::{Value, json};

const GRAPH: &str = r#"
schema = 1
name = "plain"
time.column = "t"
signals.room = { unit = "Cel", channels = ["a", "b"], column = "{channel}", range = ["-20 Cel", "200 Cel"], max_age = "1min" }
outputs.room = "room"
"#;

/// An hour and a half of two temperatures, a row every 10 s, with other rows in the place of some.
fn log(other: &[(u32, &str)]) -> String {
    let row = |nth: u32| {
        let other = other.iter().find(|(of, _)| *of == nth);
        let a = 21.0 + f64::from(nth % 7);
        other.map_or_else(
            || format!("{},{a},{}", 10 * nth, a + 0.5),
            |(_, row)| (*row).to_owned(),
        )
    };
    let rows: Vec<String> = (0..540).map(row).collect();
    format!("t,a,b\n{}\n", rows.join("\n"))
}

/// What was told of the events of a name.
#[track_caller]
fn told(finished: &Finished, event: &str) -> Vec<Value> {
    let lines = finished.told.lines().map(|line| {
        let told: Value =
            serde_json::from_str(line).unwrap_or_else(|error| panic!("{error}: {line}"));
        assert!(
            told["message"].is_string() && told["level"].is_string(),
            "{told}"
        );
        told
    });
    lines.filter(|told| told["event"] == event).collect()
}

/// The same but for the words.
#[track_caller]
fn facts(finished: &Finished, event: &str) -> Vec<Value> {
    let mut all = told(finished, event);
    for told in &mut all {
        let told = told.as_object_mut().unwrap();
        told.remove("event");
        told.remove("message");
    }
    all
}

#[test]
fn rows_and_samples_that_are_not_taken_are_told_to_programs_where_they_stand() {
    let scratch = Scratch::new("told-to-programs-rows");
    let graph = scratch.file("graph.toml", GRAPH);
    let text = log(&[
        (50, "500,?,21"),
        (60, "100,21,21"),
        (70, "700,900,21"),
        (80, "x,1,1"),
    ]);
    let file = scratch.file("log.csv", &text);
    let ended = json!([{
        "level": "note", "ticks": 538, "refused": 1, "unreadable_rows": 1, "unreadable_cells": 1,
        "rejected": [["room.a", 1]],
    }]);
    let piped = athermal_fed(
        &[
            &"run",
            &graph,
            &"-i",
            &"-",
            &"--lenient",
            &"--format",
            &"json",
        ],
        text.as_bytes(),
    )
    .ended(0);
    let (input, warning) = ("standard input", "warning");
    let at_once = json!([
        { "level": warning, "reason": "time_before", "time": "100", "file": input, "line": 62 },
        { "level": warning, "reason": "time_unreadable", "column": "t", "found": "x", "file": input, "line": 82 },
    ]);
    assert_eq!(json!(facts(&piped, "refused_rows")[..2]), at_once);
    let cell = json!({ "level": warning, "column": "a", "found": "?", "file": input, "line": 52 });
    assert_eq!(facts(&piped, "unreadable_cells")[0], cell);
    let sample = json!({ "level": warning, "channel": "room.a", "time": "700", "value": 900.0 });
    assert_eq!(facts(&piped, "rejected_samples")[0], sample);
    assert_eq!(json!(facts(&piped, "ended")), ended);

    let whole = athermal(&[
        &"run",
        &graph,
        &"-i",
        &file,
        &"--lenient",
        &"--format",
        &"json",
    ])
    .ended(0);
    let at_end = json!([{ "level": warning, "channel": "room.a", "samples": 1 }]);
    assert_eq!(json!(facts(&whole, "rejected_samples")), at_end);
    let counts = facts(&whole, "refused_rows");
    let counts: Vec<_> = counts
        .iter()
        .map(|told| (&told["line"], &told["count"]))
        .collect();
    assert_eq!(json!(counts), json!([[82, 1], [62, 1]]));
    assert_eq!(json!(facts(&whole, "ended")), ended);
    assert_eq!(whole.out, piped.out, "what is put out is as it was");
}

#[test]
fn each_sensor_that_falls_silent_is_told_to_programs_by_itself() {
    let scratch = Scratch::new("told-to-programs-sensors");
    let graph = scratch.file("graph.toml", GRAPH);
    let empty: Vec<String> = (100..300).map(|nth| format!("{},,", 10 * nth)).collect();
    let other: Vec<(u32, &str)> = (100..300).zip(empty.iter().map(String::as_str)).collect();
    let text = log(&other);
    let run = |more: &[&dyn AsRef<std::ffi::OsStr>]| {
        let mut all: Vec<&dyn AsRef<std::ffi::OsStr>> = vec![&"run", &graph, &"-i", &"-"];
        all.extend(more);
        athermal_fed(&all, text.as_bytes()).ended(0)
    };
    let programs = run(&[&"--format", &"json"]);
    let since = |channel: &str, level: &str, to_s: f64| json!({ "level": level, "channel": channel, "of_truth": false, "from_s": 1000.0, "to_s": to_s });
    let silent = ["room.a", "room.b"].map(|channel| since(channel, "warning", 1600.0));
    assert_eq!(facts(&programs, "silent"), silent);
    let back = ["room.a", "room.b"].map(|channel| since(channel, "note", 3000.0));
    assert_eq!(facts(&programs, "has_samples_again"), back);
    run(&[]).tells(&["room.a, room.b have no sample since 1000 s: did the sensors fail?"]);
    let brief = run(&[&"--format", &"json", &"-q"]);
    let levels: Vec<_> = told(&brief, "silent")
        .iter()
        .map(|told| told["level"].clone())
        .collect();
    assert_eq!(levels, ["warning", "warning"]);
    assert_eq!(brief.told.lines().count(), 2, "no notes: {}", brief.told);
}

#[test]
fn what_ends_a_run_is_told_to_programs_beside_the_rows() {
    let scratch = Scratch::new("told-to-programs-errors");
    let graph = scratch.file("graph.toml", GRAPH);
    let text = log(&[(80, "x,1,1")]);
    let run = athermal_fed(
        &[&"run", &graph, &"-i", &"-", &"--format", &"json"],
        text.as_bytes(),
    );
    let run = run.ended(2);
    let message = told(&run, "error")[0]["message"].to_string();
    assert!(message.contains("standard input:82"), "{message}");
    assert_eq!(run.out.lines().count(), 80);
}

#[test]
fn mistakes_of_a_graph_that_is_watched_are_told_to_programs_beside_the_rows() {
    let scratch = Scratch::new("told-to-programs-watched");
    let graph = scratch.file("graph.toml", GRAPH);
    let mut child = Command::new(env!("CARGO_BIN_EXE_athermal"))
        .args([OsStr::new("run"), graph.as_os_str()])
        .args(["-i", "-", "--watch", "--format", "json"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut feed = child.stdin.take().unwrap();
    feed.write_all(b"t,a,b\n").unwrap();
    // Longer than the file is looked at twice.
    for nth in 0..60 {
        if nth == 10 {
            scratch.file("graph.toml", GRAPH.replace("outputs", "outputs ="));
        }
        writeln!(feed, "{},21,21", 10 * nth).unwrap();
        std::thread::sleep(Duration::from_millis(20));
    }
    drop(feed);
    let output = child.wait_with_output().unwrap();
    let run = Finished {
        status: output.status.code().unwrap(),
        out: String::from_utf8(output.stdout).unwrap(),
        told: String::from_utf8(output.stderr).unwrap(),
    }
    .ended(0);
    let rows = run.out.lines().map(serde_json::from_str::<Value>);
    assert_eq!(rows.filter(Result::is_ok).count(), 60, "{}", run.out);
    assert_eq!(run.out.lines().count(), 60);
    assert_eq!(told(&run, "diagnostic")[0]["code"], "A001");
    assert_eq!(told(&run, "not_taken_over")[0]["reason"], "refused");
}
