//! What the program says and how it ends, whatever it is given: 0 fine, 1 the answer is no, 2 the request was wrong,
//! 3 something outside failed. Decides nothing about the figures themselves.

mod advice;
mod beside;
mod beyond;
mod columns;
mod features;
mod files;
mod gaps;
mod machine_file;
mod mistakes;
mod mistakes_in_tests;
mod next;
mod numbers;
mod older;
mod planned;
mod programs;
mod references;
mod requests;
mod scored;
mod sensors;
mod standing;
mod truths;

use std::path::PathBuf;
use std::process::{Command, Stdio};

use crate::workbench::{Graph, Scratch, athermal, athermal_fed};

/// A graph in which nothing needs fitting.
fn plain() -> Graph {
    Graph::named("plain")
        .time("time_s")
        .signal("temperature", "Cel", "room", "1min")
        .with("range = ['-20 Cel', '200 Cel']")
        .signal("position", "nm", "Z", "3min")
        .slope("drift", "position", "30s", "nm/min")
        .model("same", "persistence", "", "drift.Z", "30s")
        .outputs("predicted = 'same'; now = 'drift'; room = 'temperature'")
}

/// A graph that needs a fit.
fn linear() -> Graph {
    Graph::named("fitted")
        .time("time_s")
        .signal("temperature", "Cel", "room", "1min")
        .with("range = ['-20 Cel', '200 Cel']")
        .signal("position", "nm", "Z", "3min")
        .model("thermal", "linear", "temperature", "position.Z", "0s")
        .outputs("predicted = 'thermal'")
}

/// Rows every ten seconds from an instant on: a room that warms by 0.1 K a row, and a position ten times as large.
fn rows(from: u32, count: u32) -> Vec<String> {
    let row = |nth: u32| {
        let room = 20.0 + 0.1 * f64::from(nth) + 0.01 * f64::from(nth * nth % 7);
        format!(
            "{},{room:.3},{:.3}",
            from + 10 * nth,
            10.0 * room + 0.1 * f64::from(nth % 3)
        )
    };
    (0..count).map(row).collect()
}

fn csv(rows: &[String]) -> String {
    format!("time_s,room,Z\n{}\n", rows.join("\n"))
}

/// A scratch folder with both graphs, a recording, and a model fitted on it.
fn desk(test: &str) -> (Scratch, PathBuf, PathBuf, PathBuf) {
    let scratch = Scratch::new(&format!("command-line-{test}"));
    let plain = scratch.file("plain.toml", self::plain());
    scratch.file("fitted.toml", linear());
    let data = scratch.file("data.csv", csv(&rows(0, 60)));
    let model = scratch.path("model.json");
    athermal(&[
        &"fit",
        &scratch.path("fitted.toml"),
        &"--data",
        &data,
        &"-o",
        &model,
        &"-q",
    ])
    .ended(0);
    (scratch, plain, data, model)
}

#[test]
fn a_graph_without_mistakes_is_fine_and_one_with_warnings_only_when_not_strict() {
    let (scratch, plain, ..) = desk("check");
    athermal(&[&"check", &plain])
        .ended(0)
        .tells(&["plain.toml", "2 measured channels"]);
    let unused =
        "[nodes.unused]\ntype = \"slope\"\ninputs.signal = \"temperature\"\nwindows = [\"30s\"]\n";
    let warned = scratch.file(
        "warned.toml",
        self::plain().replace("[outputs]", &format!("{unused}[outputs]")),
    );
    athermal(&[&"check", &warned])
        .ended(0)
        .tells(&["warning", "`unused`", "1 warning"]);
    athermal(&[&"check", &"--strict", &warned]).ended(1);
    athermal(&[&"check", &"--strict", &plain]).ended(0);
    athermal(&[&"check", &scratch.path("nowhere.toml")])
        .ended(3)
        .tells(&["nowhere.toml"]);
}

#[test]
fn every_mistake_is_told_with_its_place_and_the_nearest_name() {
    let (scratch, ..) = desk("mistakes");
    let text = plain()
        .replace("type = \"slope\"", "type = \"slop\"")
        .replace("type = \"persistence\"", "type = \"persistance\"");
    let wrong = scratch.file("wrong.toml", text);
    let told = athermal(&[&"check", &wrong]).ended(2);
    told.tells(&[
        "`slop`",
        "did you mean `slope`?",
        "`persistance`",
        "did you mean `persistence`?",
        "wrong.toml:19:8",
        "2 errors",
    ]);
    let json = athermal(&[&"check", &wrong, &"--format", &"json"])
        .ended(2)
        .json();
    let text = json.to_string();
    for part in ["A040", "wrong.toml", "\"line\":19", "slope"] {
        assert!(text.contains(part), "{part} in {text}");
    }
    athermal(&[&"nodes", &"linaer"])
        .ended(2)
        .tells(&["`linaer`", "did you mean `linear`?"]);
    for command in ["fit", "evaluate"] {
        let output: [&dyn AsRef<std::ffi::OsStr>; 2] = [&"-o", &"model.json"];
        let mut arguments: Vec<&dyn AsRef<std::ffi::OsStr>> =
            vec![&command, &wrong, &"--data", &"data.csv"];
        if command == "fit" {
            arguments.extend(output);
        }
        athermal(&arguments)
            .ended(2)
            .tells(&["`slop`", "wrong.toml:19:8"]);
    }
}

#[test]
fn a_wrong_call_ends_with_2_and_help_with_0() {
    athermal(&[&"fiit"]).ended(2).tells(&["fit"]);
    athermal(&[&"evaluate"]).ended(2);
    let help = athermal(&[&"--help"]).ended(0);
    assert!(help.out.contains("evaluate"));
}

#[test]
fn a_graph_that_needs_fitting_is_no_model() {
    let (scratch, plain, data, model) = desk("unfitted");
    let graph = scratch.path("fitted.toml");
    athermal(&[&"run", &graph, &"--input", &data])
        .ended(2)
        .tells(&["fitted.toml", "thermal", "athermal fit"]);
    athermal(&[&"evaluate", &graph, &"--data", &data])
        .ended(2)
        .tells(&["thermal"]);
    athermal(&[&"run", &plain, &"--input", &data]).ended(0);
    athermal(&[&"evaluate", &plain, &"--data", &data]).ended(0);
    athermal(&[&"run", &model, &"--input", &data]).ended(0);
}

#[test]
fn scores_are_printed_as_json_with_all_their_keys() {
    let (_scratch, _, data, model) = desk("json");
    let json = athermal(&[&"evaluate", &model, &"--data", &data, &"--format", &"json"])
        .ended(0)
        .json();
    let score = &json["scores"][0];
    for (key, value) in [
        ("output", "thermal.Z"),
        ("node", "thermal"),
        ("type", "linear"),
        ("truth", "position.Z"),
        ("unit", "nm"),
    ] {
        assert_eq!(score[key], value, "{score}");
    }
    for key in [
        "ahead_s",
        "horizon_s",
        "n",
        "rmse",
        "r2_zero",
        "r2_mean",
        "bias",
        "max_abs",
        "valid",
        "baseline_zero",
        "baseline_persistence",
    ] {
        assert!(score[key].is_number(), "{key} in {score}");
    }
    assert!(
        score.as_object().unwrap().contains_key("truth_noise"),
        "a plain sample has none, and the key is there"
    );
    assert_eq!(score["n"], 60);
    assert_eq!(json["data"][0], data.display().to_string());
    assert_eq!(
        (
            json["period"]["from_s"].as_f64(),
            json["period"]["to_s"].as_f64()
        ),
        (Some(0.0), Some(590.0))
    );
    let fit = athermal(&[
        &"fit",
        &model,
        &"--data",
        &data,
        &"-o",
        &model,
        &"--format",
        &"json",
    ])
    .ended(0)
    .json();
    assert_eq!(
        (
            &fit["ticks"],
            &fit["segments"],
            &fit["estimators"][0]["rows"]
        ),
        (&60.into(), &1.into(), &60.into())
    );
    let table = athermal(&[&"evaluate", &model, &"--data", &data]).ended(0);
    assert!(
        table.out.contains("thermal.Z") && table.out.contains("persistence"),
        "{}",
        table.out
    );
}

#[test]
fn a_bad_cell_is_an_error_with_file_line_and_column_or_counted_when_lenient() {
    let (scratch, plain, _, model) = desk("bad-cell");
    let mut lines = rows(0, 60);
    lines[6] = "60,warm,200".to_owned();
    lines[9] = "90,??,200".to_owned();
    let bad = scratch.file("bad.csv", csv(&lines));
    let places = ["bad.csv:8", "`room`", "`warm`"];
    athermal(&[&"run", &plain, &"--input", &bad])
        .ended(2)
        .tells(&places);
    athermal(&[&"evaluate", &model, &"--data", &bad])
        .ended(2)
        .tells(&places);
    athermal(&[
        &"fit",
        &model,
        &"--data",
        &bad,
        &"-o",
        &scratch.path("new.json"),
    ])
    .ended(2)
    .tells(&places);
    assert!(!scratch.path("new.json").exists());
    let lenient = athermal(&[&"run", &plain, &"--input", &bad, &"--lenient"]).ended(0);
    lenient.tells(&["2 × unreadable cell", "bad.csv:8"]);
    for needless in ["in `", "--lenient"] {
        assert!(!lenient.told.contains(needless), "{}", lenient.told);
    }
    let room: Vec<bool> = lenient
        .out
        .lines()
        .skip(1)
        .map(|line| line.ends_with(','))
        .collect();
    assert_eq!(room.iter().filter(|absent| **absent).count(), 2);
    assert!(room[6] && room[9]);
    athermal(&[&"evaluate", &model, &"--data", &bad, &"--lenient"])
        .ended(0)
        .tells(&["2 × unreadable cell"]);
    lines[9] = "90,21,??".to_owned();
    let bad = scratch.file("bad.csv", csv(&lines));
    athermal(&[&"evaluate", &model, &"--data", &bad, &"--lenient"])
        .ended(0)
        .tells(&["2 × unreadable cell (1 in `Z`, 1 in `room`), taken as missing; the first: "]);
}

#[test]
fn a_missing_column_is_told_with_those_that_are_there() {
    let (scratch, plain, ..) = desk("missing-column");
    let data = scratch.file(
        "other.csv",
        csv(&rows(0, 5)).replace("time_s,room,Z", "time_s,rooms,Z"),
    );
    athermal(&[&"run", &plain, &"--input", &data])
        .ended(2)
        .tells(&[
            "other.csv",
            "`room`",
            "`time_s`, `rooms`, `Z`",
            "did you mean `rooms`?",
        ]);
}

#[test]
fn a_last_line_cut_off_is_reported_and_the_rest_is_used() {
    let (scratch, plain, data, _) = desk("cut-off");
    let whole = athermal(&[&"run", &plain, &"--input", &data]).ended(0);
    let text = std::fs::read_to_string(&data).unwrap();
    let cut = scratch.file("cut.csv", format!("{text}600,2"));
    let run = athermal(&[&"run", &plain, &"--input", &cut]).ended(0);
    run.tells(&["cut.csv:62", "cut off"]);
    assert_eq!(run.out, whole.out);
}

#[test]
fn times_that_step_back_or_leap_once_are_refused_and_counted_with_the_first_place() {
    let (scratch, plain, data, _) = desk("steps-back");
    let whole = athermal(&[&"run", &plain, &"--input", &data]).ended(0);
    let mut lines = rows(0, 60);
    lines.insert(30, "290,150,999".to_owned());
    lines.insert(40, "55,150,999".to_owned());
    lines.insert(50, "4102444800,150,999".to_owned());
    let back = scratch.file("back.csv", csv(&lines));
    let run = athermal(&[&"run", &plain, &"--input", &back]).ended(0);
    run.tells(&[
        "2 × row whose time is out of order",
        "1 × row whose time is that of the row before",
        "back.csv:32",
        "back.csv:42",
    ]);
    assert_eq!(run.out, whole.out, "what was refused leaves no trace");
}

#[test]
fn several_files_are_joined_in_time_or_are_segments() {
    let (scratch, _, data, model) = desk("several");
    let all = rows(0, 60);
    let (first, second) = (
        scratch.file("a.csv", csv(&all[..30])),
        scratch.file("b.csv", csv(&all[30..])),
    );
    let evaluated = |files: &[&PathBuf]| {
        let mut arguments: Vec<&dyn AsRef<std::ffi::OsStr>> =
            vec![&"evaluate", &model, &"--format", &"json", &"--data"];
        arguments.extend(
            files
                .iter()
                .map(|file| *file as &dyn AsRef<std::ffi::OsStr>),
        );
        athermal(&arguments).ended(0).json()["scores"].clone()
    };
    let whole = evaluated(&[&data]);
    assert_eq!(evaluated(&[&first, &second]), whole);
    assert_eq!(
        evaluated(&[&second, &first]),
        whole,
        "time decides, and not the order in which they are named"
    );
    let again = scratch.file("c.csv", csv(&all));
    let output = scratch.path("segments.json");
    let fitted = athermal(&[
        &"fit",
        &model,
        &"-o",
        &output,
        &"--format",
        &"json",
        &"--data",
        &data,
        &again,
    ])
    .ended(0)
    .json();
    assert_eq!(
        (&fitted["segments"], &fitted["ticks"]),
        (&2.into(), &120.into())
    );
    let joined = athermal(&[
        &"fit",
        &model,
        &"-o",
        &output,
        &"--format",
        &"json",
        &"--data",
        &first,
        &second,
    ])
    .ended(0)
    .json();
    assert_eq!(
        (&joined["segments"], &joined["ticks"]),
        (&1.into(), &60.into())
    );
}

#[test]
fn json_lines_go_in_and_out() {
    let (scratch, plain, data, _) = desk("json-lines");
    let lines: Vec<String> = rows(0, 60)
        .iter()
        .map(|row| {
            let cells: Vec<&str> = row.split(',').collect();
            format!(
                "{{\"time_s\": {}, \"Z\": {}, \"room\": {}, \"remark\": \"x\"}}",
                cells[0], cells[2], cells[1]
            )
        })
        .collect();
    let input = scratch.file("data.jsonl", lines.join("\n") + "\n");
    let (from_csv, from_json) = (scratch.path("one.jsonl"), scratch.path("other.jsonl"));
    athermal(&[&"run", &plain, &"--input", &data, &"--output", &from_csv]).ended(0);
    athermal(&[&"run", &plain, &"--input", &input, &"--output", &from_json]).ended(0);
    let text = std::fs::read_to_string(from_csv).unwrap();
    assert_eq!(text.lines().count(), 60);
    assert_eq!(text, std::fs::read_to_string(from_json).unwrap());
    let last: serde_json::Value = serde_json::from_str(text.lines().last().unwrap()).unwrap();
    assert!(
        last["predicted.Z"].is_number() && last["room.room"].is_number(),
        "{last}"
    );
}

#[test]
fn standard_input_is_read_and_empty_cells_stand_for_nothing() {
    let (_scratch, plain, ..) = desk("standard-input");
    let run = athermal_fed(
        &[&"run", &plain, &"--input", &"-", &"--output", &"-"],
        b"time_s,room,Z\n0,21,\n10,,5\n20,NaN,inf\n",
    )
    .ended(0);
    assert_eq!(
        run.out,
        "time_s,predicted.Z,now.Z,room.room\n0,,,21.0\n10,,,\n20,,,\n"
    );
    run.tells(&["position.Z: 1 sample is infinite or out of range"]);
}

#[test]
fn what_cannot_be_read_or_written_ends_with_3() {
    let (scratch, plain, data, model) = desk("outside");
    let nowhere = scratch.path("no/such/folder/file.csv");
    athermal(&[&"run", &plain, &"--input", &nowhere])
        .ended(3)
        .tells(&["file.csv"]);
    athermal(&[&"run", &plain, &"--input", &data, &"--output", &nowhere])
        .ended(3)
        .tells(&["file.csv"]);
    athermal(&[&"run", &scratch.path("none.json"), &"--input", &data])
        .ended(3)
        .tells(&["none.json"]);
    athermal(&[&"evaluate", &model, &"--data", &nowhere])
        .ended(3)
        .tells(&["file.csv"]);
    athermal(&[&"fit", &model, &"--data", &data, &"-o", &nowhere])
        .ended(3)
        .tells(&["file.csv"]);
}

#[test]
fn data_without_rows_are_told_and_never_a_panic() {
    let (scratch, plain, _, model) = desk("empty");
    let nothing = scratch.file("nothing.csv", "");
    athermal(&[&"run", &plain, &"--input", &nothing])
        .ended(2)
        .tells(&["nothing.csv", "empty"]);
    let header = scratch.file("header.csv", "time_s,room,Z\n");
    let run = athermal(&[&"run", &plain, &"--input", &header]).ended(0);
    assert_eq!(run.out, "time_s,predicted.Z,now.Z,room.room\n");
    let json = athermal(&[
        &"evaluate",
        &model,
        &"--data",
        &header,
        &"--format",
        &"json",
    ])
    .ended(0)
    .json();
    assert_eq!(
        (&json["scores"][0]["n"], &json["scores"][0]["rmse"]),
        (&0.into(), &serde_json::Value::Null)
    );
    let fit = athermal(&[
        &"fit",
        &model,
        &"--data",
        &header,
        &"-o",
        &scratch.path("new.json"),
    ])
    .ended(1);
    fit.tells(&["thermal could not be fitted", "has no value in the data"]);
}

#[test]
fn a_model_that_is_damaged_or_of_a_later_version_is_refused() {
    let (scratch, _, data, model) = desk("damaged");
    let text = std::fs::read_to_string(&model).unwrap();
    let run = |name: &str, text: &str| {
        athermal(&[&"run", &scratch.file(name, text), &"--input", &data]).ended(2)
    };
    run("half.json", &text[..text.len() / 2]).tells(&["half.json"]);
    run("other.json", "{\"a\": 1}").tells(&["other.json"]);
    run("list.json", "[1, 2]").tells(&["list.json"]);
    run(
        "later.json",
        &text.replace("\"athermal_model\": 1", "\"athermal_model\": 2"),
    )
    .tells(&["later.json", "2"]);
    run(
        "renamed.json",
        &text.replace("\"temperature.room\"", "\"temperature.hall\""),
    )
    .tells(&["temperature.hall"]);
    run(
        "kind.json",
        &text.replace("\"type\": \"linear\"", "\"type\": \"liner\""),
    )
    .tells(&["kind.json"]);
}

#[test]
fn a_reader_that_has_seen_enough_is_no_error() {
    let (scratch, plain, ..) = desk("closed-pipe");
    let many = scratch.file("many.csv", csv(&rows(0, 30_000)));
    let calls: [Vec<&dyn AsRef<std::ffi::OsStr>>; 4] = [
        vec![&"run", &plain, &"--input", &many, &"--output", &"-"],
        vec![&"nodes"],
        vec![&"nodes", &"--format", &"json"],
        vec![&"evaluate", &plain, &"--data", &many],
    ];
    for arguments in calls {
        let mut child = Command::new(env!("CARGO_BIN_EXE_athermal"))
            .args(arguments.iter().map(|argument| argument.as_ref()))
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        drop(child.stdout.take());
        let ended = child.wait_with_output().unwrap();
        let told = String::from_utf8_lossy(&ended.stderr);
        assert!(
            ended.status.success() && !told.contains("panicked"),
            "{}: {told}",
            ended.status
        );
    }
}
