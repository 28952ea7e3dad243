//! Every source and sink of this crate against the rules that all keep.

use std::fs::OpenOptions;
use std::io::Write;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::AtomicBool;

use athermal_serve::testkit::{Given, SourceTrial, assert_sink, assert_source};
use athermal_simulation as _;
use serde::de::DeserializeOwned;

use super::*;
use crate::file_sink::{CsvSink, JsonLinesSink};
use crate::file_source::{CsvSource, JsonLinesSource};
use crate::replay::Replay;
use crate::simulation::{SimulationSink, SimulationSource};
use crate::stream::{StandardInput, StandardOutput};

const CHANNELS: [(&str, &str); 2] = [("t.plate", "plate"), ("t.room", "room")];
/// What a test that runs itself with a pipe is to do there.
const PART: &str = "ATHERMAL_PIPED_PART";

fn with<T: DeserializeOwned>(parameters: &str) -> T {
    serde_json::from_str(parameters).unwrap()
}

/// Row of a table that grows.
fn row(nth: usize, is_json: bool) -> String {
    let (plate, room) = (20.0 + nth as f64, 21.0);
    match is_json {
        true => format!("{{\"time_s\": {nth}, \"plate\": {plate}, \"room\": {room}}}\n"),
        false => format!("{nth},{plate},{room}\n"),
    }
}

/// Writes rows until it is to stop.
fn growing(mut out: impl Write, is_json: bool, stop: &AtomicBool) {
    if !is_json {
        out.write_all(HEADER.as_bytes()).unwrap();
    }
    for nth in 0.. {
        // Whoever reads a pipe may be gone.
        if stop.load(Ordering::Relaxed) || out.write_all(row(nth, is_json).as_bytes()).is_err() {
            return;
        }
        std::thread::sleep(Wait::from_millis(2));
    }
}

#[test]
fn a_file_that_is_followed_keeps_the_rules() {
    for is_json in [false, true] {
        let folder = Folder::new();
        let path = folder.file("log");
        let file = OpenOptions::new().create(true).append(true).open(&path);
        let (file, stop) = (file.unwrap(), AtomicBool::new(false));
        std::thread::scope(|scope| {
            scope.spawn(|| growing(file, is_json, &stop));
            let checked = std::panic::catch_unwind(|| match is_json {
                true => {
                    let source: JsonLinesSource = with("{\"path\": \"log\"}");
                    assert_source(&source, &folder.0, &CHANNELS, 100);
                }
                false => {
                    let source: CsvSource = with("{\"path\": \"log\"}");
                    assert_source(&source, &folder.0, &CHANNELS, 100);
                }
            });
            stop.store(true, Ordering::Relaxed);
            checked.unwrap();
        });
    }
}

#[test]
fn a_recording_that_is_replayed_keeps_the_rules() {
    let folder = Folder::new();
    let text = HEADER.to_owned() + &csv(&rows(4, 400));
    fs::write(folder.file("log.csv"), text).unwrap();
    for speed in ["\"fastest\"", "1000"] {
        let parameters = format!("{{\"path\": \"log.csv\", \"speed\": {speed}}}");
        let source: Replay = with(&parameters);
        assert_source(&source, &folder.0, &CHANNELS, 500);
    }
}

#[test]
fn a_simulated_machine_and_its_corrections_keep_the_rules() {
    let folder = Folder::new();
    let source: SimulationSource =
        with("{\"machine\": \"die-tester\", \"speed\": 20000, \"days\": 0.05}");
    let channels = [("temperature.plate1", ""), ("temperature.room", "")];
    let trial = SourceTrial::new(&source, &folder.0, &channels).unit("Cel");
    trial.check(200).unwrap();
    // The machine that stands there now has the name that the kit gives it.
    let sink: SimulationSink = with("{\"source\": \"tried\"}");
    assert_sink(&sink, &folder.0, &["correction.Z1", "correction.X2"]);
}

#[test]
fn a_file_with_a_row_for_each_tick_keeps_the_rules() {
    let folder = Folder::new();
    let csv: CsvSink = with("{\"path\": \"rows.csv\"}");
    assert_sink(&csv, &folder.0, &["a", "b"]);
    let jsonl: JsonLinesSink = with("{\"path\": \"rows.jsonl\"}");
    assert_sink(&jsonl, &folder.0, &["a", "b"]);
}

/// This program again, with pipes, to do a part of a test there.
fn piped(test: &str, part: &str) -> Child {
    Command::new(std::env::current_exe().unwrap())
        .args([
            "--exact",
            &format!("tests::conformance::{test}"),
            "--nocapture",
        ])
        .env(PART, part)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap()
}

/// The rules for a source, of which each is tried on a pipe of its own: `part` says which.
fn on_a_pipe(part: &str) {
    let source: StandardInput = with("{}");
    let trial = SourceTrial::new(&source, Path::new("."), &CHANNELS);
    match part {
        "repeat and stop" => {
            let given = trial.run(40, &[]).unwrap();
            let stamps: std::collections::BTreeSet<_> =
                given.iter().map(|of| (of.channel, of.stamp)).collect();
            assert_eq!(stamps.len(), given.len());
        }
        "restart" => {
            let known = |channel| Given {
                channel,
                stamp: Instant::from_ns(30_000_000_000),
                value: 0.0,
            };
            let before = [known(0), known(1)];
            let given = trial.run(40, &before).unwrap();
            assert!(given.iter().all(|of| of.stamp > before[0].stamp));
        }
        "flood and cut" => trial.flood().unwrap(),
        other => panic!("{other}"),
    }
}

#[test]
fn a_pipe_keeps_the_rules_also_while_nothing_comes_through_it() {
    if let Ok(part) = std::env::var(PART) {
        return on_a_pipe(&part);
    }
    for (part, rows) in [
        ("repeat and stop", 40),
        ("restart", 60),
        ("flood and cut", 400),
    ] {
        let mut child = piped(
            "a_pipe_keeps_the_rules_also_while_nothing_comes_through_it",
            part,
        );
        let mut pipe = child.stdin.take().unwrap();
        let text: String = (0..rows).map(|nth| row(nth, false)).collect();
        pipe.write_all((HEADER.to_owned() + &text).as_bytes())
            .unwrap();
        // It stays open, and nothing comes through it any more.
        let output = child.wait_with_output().unwrap();
        drop(pipe);
        let text = String::from_utf8_lossy(&output.stdout);
        assert!(output.status.success(), "{part}: {text}");
    }
}

#[test]
fn rows_to_standard_output_keep_the_rules() {
    if std::env::var_os(PART).is_some() {
        let sink: StandardOutput = with("{}");
        return assert_sink(&sink, Path::new("."), &["a", "b"]);
    }
    let child = piped("rows_to_standard_output_keep_the_rules", "all");
    let output = child.wait_with_output().unwrap();
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{text}");
    let rows: Vec<_> = text.lines().filter(|line| line.contains(',')).collect();
    let row = |nth: i64| format!("{nth},{nth}.0,{}.0,0000000000000001", nth + 1);
    let mut expected = vec!["time_s,a,b,revision".to_owned()];
    expected.extend([0, 1, 2, 3, 4, 4].map(row));
    assert_eq!(rows, expected);
}
