//! Same input, same bytes:
//!
//! 1. the same run twice gives the same bytes;
//! 2. in one piece and row by row through a pipe gives the same bytes, each row answered before the next one is sent;
//! 3. a changed sample changes them, or all of this proves nothing;
//! 4. any number of threads that fit gives the same model;
//! 5. a model read back runs with the same bits as the one that was fitted.

use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::{Arc, OnceLock};

use crate::workbench::{Scratch, athermal, athermal_fed, graph, simulated};
use athermal::files::{Dataset, Options};
use athermal::run::fit::{FitOptions, fit};
use athermal::run::recording::{Event, Recording, Samples, Table};
use athermal::{Engine, Model};

/// Two days of a machine, half a day of another, and a model fitted on the former.
struct Fitted {
    scratch: Scratch,
    train: PathBuf,
    test: PathBuf,
    model: PathBuf,
}

fn fitted() -> &'static Fitted {
    static FITTED: OnceLock<Fitted> = OnceLock::new();
    FITTED.get_or_init(|| {
        // A runner that gives each test a process of its own runs this in several at once.
        let thread = std::thread::current();
        let scratch = Scratch::new(thread.name().unwrap_or("determinism"));
        let train = simulated(&scratch, "train.csv", "die-tester", 1.5, 1);
        let test = simulated(&scratch, "test.csv", "die-tester", 0.4, 2);
        let model = scratch.path("model.json");
        athermal(&[
            &"fit",
            &graph("die-tester"),
            &"--data",
            &train,
            &"-o",
            &model,
            &"-q",
        ])
        .ended(0);
        Fitted {
            scratch,
            train,
            test,
            model,
        }
    })
}

fn predictions(test: &Path) -> String {
    let run = athermal(&[
        &"run",
        &fitted().model,
        &"--input",
        &test,
        &"--output",
        &"-",
    ])
    .ended(0);
    assert!(
        run.out.lines().count() > 3000
            && run
                .out
                .lines()
                .last()
                .unwrap()
                .split(',')
                .all(|cell| !cell.is_empty())
    );
    run.out
}

#[test]
fn the_same_run_twice_gives_the_same_bytes() {
    assert_eq!(predictions(&fitted().test), predictions(&fitted().test));
}

#[test]
fn to_a_file_and_to_standard_output_the_bytes_are_the_same() {
    let file = fitted().scratch.path("predicted.csv");
    athermal(&[
        &"run",
        &fitted().model,
        &"--input",
        &fitted().test,
        &"--output",
        &file,
    ])
    .ended(0);
    assert_eq!(
        std::fs::read_to_string(file).unwrap(),
        predictions(&fitted().test)
    );
}

#[test]
fn a_changed_sample_changes_the_bytes_from_there_on() {
    let text = std::fs::read_to_string(&fitted().test).unwrap();
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    // The last digit of one temperature, in a row that has one.
    let at = (2000..)
        .find(|&at| !lines[at].split(',').nth(1).unwrap().is_empty())
        .unwrap();
    let mut cells: Vec<String> = lines[at].split(',').map(str::to_owned).collect();
    cells[1] = format!("{}", cells[1].parse::<f64>().unwrap() + 1e-4);
    lines[at] = cells.join(",");
    let changed = fitted()
        .scratch
        .file("changed.csv", lines.join("\n") + "\n");
    let (before, after) = (predictions(&fitted().test), predictions(&changed));
    let first = before
        .lines()
        .zip(after.lines())
        .position(|(one, other)| one != other);
    assert_eq!(
        first,
        Some(at),
        "from the row of the sample on, and not before"
    );
}

/// The model, run on what comes through a pipe.
fn from_a_pipe() -> Command {
    let mut run = Command::new(env!("CARGO_BIN_EXE_athermal"));
    run.arg("run").arg(&fitted().model);
    run.args(["--input", "-", "--output", "-"])
        .stdin(Stdio::piped());
    run
}

#[test]
fn row_by_row_through_a_pipe_gives_the_same_bytes() {
    let whole = predictions(&fitted().test);
    let text = std::fs::read_to_string(&fitted().test).unwrap();
    let mut child = from_a_pipe().stdout(Stdio::piped()).spawn().unwrap();
    let mut input = child.stdin.take().unwrap();
    let mut output = BufReader::new(child.stdout.take().unwrap());
    let mut lines = text.lines();
    writeln!(input, "{}", lines.next().unwrap()).unwrap();
    let mut answers = String::new();
    for (nth, line) in lines.enumerate() {
        writeln!(input, "{line}").unwrap();
        input.flush().unwrap();
        // The header of the output comes with the first row, or before it.
        for _ in 0..=usize::from(nth == 0) {
            assert!(
                output.read_line(&mut answers).unwrap() > 0,
                "row {nth} is answered before the next one is sent"
            );
        }
    }
    drop(input);
    assert_eq!(output.read_line(&mut answers).unwrap(), 0);
    assert!(child.wait().unwrap().success());
    assert!(
        answers == whole,
        "the answers differ from those in one piece"
    );
}

/// What a run tells of these rows while the pipe that they come through is still open: so many lines.
fn told_at_once(rows: &[String], lines: usize) -> String {
    let mut run = from_a_pipe();
    run.stdout(Stdio::null()).stderr(Stdio::piped());
    let mut child = run.spawn().unwrap();
    let mut input = child.stdin.take().unwrap();
    let mut told = BufReader::new(child.stderr.take().unwrap());
    for row in rows {
        writeln!(input, "{row}").unwrap();
    }
    input.flush().unwrap();
    let mut first = String::new();
    for _ in 0..lines {
        told.read_line(&mut first).unwrap();
    }
    drop(input);
    child.wait().unwrap();
    first
}

/// The header and the first rows of the test data.
fn first_rows(count: usize) -> Vec<String> {
    let text = std::fs::read_to_string(&fitted().test).unwrap();
    text.lines().take(1 + count).map(str::to_owned).collect()
}

#[test]
fn a_row_that_is_left_out_of_a_pipe_is_told_before_the_pipe_ends() {
    let mut rows = first_rows(2);
    rows.push(rows[1].clone());
    assert_eq!(
        told_at_once(&rows, 1),
        "warning: standard input:4: the time `0.0` is not after `10.0`; the row was left out; others like it are counted\n"
    );
}

#[test]
fn rows_that_were_left_out_of_a_pipe_are_counted_under_the_name_by_which_the_first_was_told() {
    let mut rows = first_rows(2);
    rows.extend(rows[1..].to_vec());
    let input = rows.join("\n") + "\n";
    let run = athermal_fed(&[&"run", &fitted().model, &"-i", &"-"], input.as_bytes());
    let told = run.ended(0).told;
    assert!(!told.contains("-:"), "{told}");
    let of_input = told.lines().filter(|line| line.contains("standard input:"));
    // One time is before the last, the other is the last: both sorts are told at once and counted in the end.
    assert_eq!(of_input.count(), 4, "{told}");
}

#[test]
fn the_first_sample_out_of_range_of_each_channel_of_a_pipe_is_told_before_the_pipe_ends() {
    let mut rows = first_rows(4);
    let at = |name: &str| {
        rows[0]
            .split(',')
            .position(|column| column == name)
            .unwrap()
    };
    let (room, chuck, z) = (at("room_degC"), at("chuck_degC"), at("Z1_nm"));
    for (row, column, value) in [
        (1, room, "200.5"),
        (2, room, "-300"),
        (3, chuck, "-21"),
        (4, z, "inf"),
    ] {
        let mut cells: Vec<&str> = rows[row].split(',').collect();
        cells[column] = value;
        rows[row] = cells.join(",");
    }
    assert_eq!(
        told_at_once(&rows, 3),
        "warning: temperature.room at 0.0: 200.5 is above the highest of its range, 200.0, taken as missing; others like it are counted\n\
         warning: temperature.chuck at 20.0: -21.00 is below the lowest of its range, -20.00, taken as missing; others like it are counted\n\
         warning: position.Z1 at 30.0: an infinite sample, taken as missing; others like it are counted\n"
    );
}

#[test]
fn a_misspelt_key_of_a_pipe_is_told_before_the_pipe_ends() {
    let names = first_rows(0).remove(0).replace("room_degC", "rom_degC");
    let rows = [0, 10].map(|time| {
        let cells = names
            .split(',')
            .skip(1)
            .map(|name| format!(", \"{name}\": 20.0"));
        format!("{{\"time_s\": {time}{}}}", cells.collect::<String>())
    });
    let told = told_at_once(&rows, 1);
    assert!(
        told.starts_with(
            "warning: standard input:1: there is no column `room_degC`; found `time_s`, "
        ) && told.ends_with("did you mean `rom_degC`? (missing until a line has it)\n"),
        "{told}"
    );
}

#[test]
fn any_number_of_threads_gives_the_same_model() {
    let one = std::fs::read_to_string(&fitted().model).unwrap();
    for threads in ["1", "2", "5", "64"] {
        let model = fitted().scratch.path(&format!("model-{threads}.json"));
        let (graph, train) = (graph("die-tester"), &fitted().train);
        athermal(&[
            &"fit",
            &graph,
            &"--data",
            train,
            &"-o",
            &model,
            &"--threads",
            &threads,
            &"-q",
        ])
        .ended(0);
        assert!(
            std::fs::read_to_string(model).unwrap() == one,
            "with {threads} threads the model is another"
        );
    }
}

#[test]
fn a_model_read_back_runs_with_the_same_bits() {
    let mut model = Model::load(graph("linear-axis")).unwrap();
    let scratch = Scratch::new("determinism-read-back");
    let file = simulated(&scratch, "axis.csv", "linear-axis", 1.0, 3);
    let table = Table::read(&Dataset::new(vec![file], Options::default()), &model.plan).unwrap();
    let (fits, _) = fit(&model.plan, &table, &FitOptions::default(), &mut |_| {}).unwrap();
    model.fitted = fits;
    let path = scratch.file("model.json", model.to_text().unwrap());
    let read = Model::load(path).unwrap();
    let bits = |mut engine: Engine| {
        let plan = Arc::clone(engine.plan());
        let mut rows = table.open(&plan).unwrap();
        let mut samples = Samples::default();
        let mut bits = Vec::new();
        while let Some(event) = rows.next(&mut samples).unwrap() {
            if let Event::Row(now) = event {
                bits.extend(
                    engine
                        .step(now, &samples.values)
                        .unwrap()
                        .iter()
                        .map(|value| value.to_bits()),
                );
            }
        }
        bits
    };
    let (fitted, read) = (bits(model.engine().unwrap()), bits(read.engine().unwrap()));
    assert!(
        fitted
            .iter()
            .filter(|&&bits| !f64::from_bits(bits).is_nan())
            .count()
            > 10_000
    );
    assert!(fitted == read, "the model read back gives other bits");
}
