//! Recordings in Parquet, of a program that was built with them, beside the same recordings as CSV.

use std::ffi::OsStr;
use std::path::Path;
use std::time::{Duration, Instant};

use athermal::core::prng::Prng;
use athermal::files::{Flush, Layout, Options, Reader, Row, TimeForm, Writer, recordings_in};

use crate::services::{HEADER, SERVICE, desk, end, lines, rows as log_rows, serve, until_rows};
use crate::stretches::learned;
use crate::workbench::{Graph, Scratch, athermal, athermal_on, graph, simulated};

#[test]
fn fit_evaluate_and_run_give_the_same_from_parquet_and_from_csv() {
    let scratch = Scratch::new("parquet");
    let mut results = Vec::new();
    for ending in ["csv", "parquet"] {
        let of = |name: &str| scratch.path(&format!("{name}.{ending}"));
        let (train, test) = (of("logs/train"), of("test"));
        std::fs::create_dir_all(train.parent().unwrap()).unwrap();
        for (log, seed) in [(&train, "1"), (&test, "2")] {
            athermal(&[
                &"simulate",
                &"die-tester",
                &"--days",
                &"1",
                &"--seed",
                &seed,
                &"-o",
                log,
            ])
            .ended(0);
        }
        let graph = scratch.path(&format!("{ending}.toml"));
        let model = scratch.path(&format!("{ending}.json"));
        athermal(&[&"init", &train, &"-o", &graph, &"--force"]).ended(0);
        athermal_on("fit", &graph, &train, &[&"-o", &model]).ended(0);
        let scores = athermal_on("evaluate", &model, &test, &[&"--format", &"json"]).ended(0);
        let output = of("out");
        athermal(&[&"run", &model, &"--input", &test, &"--output", &output]).ended(0);
        let model: serde_json::Value =
            serde_json::from_slice(&std::fs::read(&model).unwrap()).unwrap();
        results.push((
            model["fitted"].clone(),
            scores.json()["scores"].clone(),
            output,
        ));
    }
    let [
        (fitted, scores, csv),
        (of_parquet, scores_of_parquet, parquet),
    ] = &*results
    else {
        panic!("two of them")
    };
    assert!(!fitted.is_null() && fitted == of_parquet);
    assert_eq!(scores, scores_of_parquet);
    // What was put out is a recording too.
    let text = std::fs::read_to_string(csv).unwrap();
    let (header, _) = text.split_once('\n').unwrap();
    let columns: Vec<&str> = header.split(',').skip(1).collect();
    let rows = |path| rows(path, &columns);
    assert!(rows(csv).len() > 1000 && rows(csv) == rows(parquet));
}

/// The rows of a recording, to the bit.
fn rows(path: &Path, columns: &[&str]) -> Vec<(i64, Vec<u64>)> {
    let layout = Layout::new("time_s", TimeForm::SECONDS, columns.iter().copied());
    let mut reader = Reader::open(path, layout, Options::default()).unwrap();
    let (mut rows, mut row) = (Vec::new(), Row::default());
    while reader.next_into(&mut row).unwrap() {
        let values: Vec<u64> = row.values.iter().map(|value| value.to_bits()).collect();
        rows.push((row.time_ns, values));
    }
    rows
}

#[test]
fn the_sink_of_parquet_is_checked_listed_explained_and_in_the_schema() {
    let sink = "[sinks.hours]\ntype = \"parquet\"\npath = \"hours\"\nevery = \"1h\"\n";
    let scratch = desk("parquet-sink", &format!("{SERVICE}\n{sink}"));
    let line = scratch.path("line.toml");
    athermal(&[&"check", &line]).ended(0);
    let explained = athermal(&[&"explain", &line]).ended(0);
    assert!(explained.out.contains("hours") && explained.out.contains("parquet"));
    let listed = athermal(&[&"nodes", &"parquet"]).ended(0);
    for part in ["parquet (sink, from athermal-arrow", "path", "every"] {
        assert!(listed.out.contains(part), "{part} in {}", listed.out);
    }
    let schema = athermal(&[&"schema"]).ended(0).json();
    let of_sinks = &schema["properties"]["sinks"];
    assert!(of_sinks.to_string().contains("\"parquet\""), "{of_sinks}");
    let wrong = scratch.file(
        "wrong.toml",
        std::fs::read_to_string(&line)
            .unwrap()
            .replace("every =", "evry ="),
    );
    athermal(&[&"check", &wrong])
        .ended(2)
        .tells(&["evry", "every"]);
}

#[test]
fn a_service_that_is_killed_at_random_has_each_row_once_in_files_of_parquet_that_are_whole() {
    // A row is a tenth of a second, so each start ends a file and begins the next.
    const KILLS: usize = 24;
    const PIECE: usize = 300;
    let sink = "[sinks.by_minute]\ntype = \"parquet\"\npath = \"minutes\"\nevery = \"1min\"\n";
    let scratch = desk("parquet-kills", &format!("{SERVICE}\n{sink}"));
    let (log, out) = (scratch.path("log.csv"), scratch.path("history.csv"));
    let (mut prng, mut written) = (Prng::stream(7, "parquet"), 0);
    scratch.file("log.csv", HEADER);
    let mut add = |count: usize| {
        let mut file = std::fs::OpenOptions::new().append(true).open(&log).unwrap();
        let text = log_rows(written, written + count);
        std::io::Write::write_all(&mut file, text.as_bytes()).unwrap();
        written += count;
    };
    for nth in 0..KILLS {
        let before = lines(&out);
        add(PIECE);
        let mut child = serve(&scratch, &[]);
        let began = Instant::now();
        while nth % 4 != 0 && lines(&out) <= before && began.elapsed() < Duration::from_secs(20) {
            std::thread::sleep(Duration::from_millis(1));
        }
        add(PIECE);
        std::thread::sleep(Duration::from_micros(prng.between(0.0, 30e3) as u64));
        let _ = child.kill();
        let _ = child.wait();
        // What is there can be read, whenever the kill came.
        for file in recordings_in(&scratch.path("minutes")) {
            assert_eq!(rows(&file, &["drift.Z"]).len(), 600, "{}", file.display());
        }
    }
    let mut child = serve(&scratch, &[]);
    until_rows(&out, 2 * PIECE * KILLS, &mut child);
    end(child);
    let header = std::fs::read_to_string(&out).unwrap();
    let columns: Vec<&str> = header.lines().next().unwrap().split(',').collect();
    let columns = &columns[1..columns.len() - 1];
    let of_csv = rows(&out, columns);
    let files = recordings_in(&scratch.path("minutes"));
    let of_files: Vec<_> = files.iter().flat_map(|file| rows(file, columns)).collect();
    // The last minute is not over.
    let whole = KILLS - 1;
    assert_eq!((files.len(), of_files.len()), (whole, 600 * whole));
    assert!(of_csv.len() == 600 * KILLS && of_csv[..600 * whole] == of_files);
}

#[test]
fn files_of_a_folder_are_one_recording_with_what_their_paths_say() {
    let scratch = Scratch::new("hive");
    for (date, seed) in [("2026-03-01", "1"), ("2026-03-02", "2")] {
        let log = scratch.path(&format!("logs/line=4/machine=dt07/date={date}/log.parquet"));
        std::fs::create_dir_all(log.parent().unwrap()).unwrap();
        let words: [&dyn AsRef<std::ffi::OsStr>; 8] = [
            &"simulate",
            &"linear-axis",
            &"--days",
            &"0.2",
            &"--seed",
            &seed,
            &"-o",
            &log,
        ];
        athermal(&words).ended(0);
    }
    let logs = scratch.path("logs");
    std::fs::write(logs.join("_SUCCESS"), "").unwrap();
    // A graph that measures what the folders say.
    let with = |key: &str| {
        let path = scratch.path(&format!("{key}.toml"));
        let extends = graph("linear-axis-sensor");
        let text = format!(
            "schema = 1\nname = \"keyed\"\nextends = {extends:?}\n\
             [signals.of_folder]\nunit = \"1\"\nchannels = [\"{key}\"]\nmax_age = \"1min\"\n"
        );
        std::fs::write(&path, text).unwrap();
        path
    };
    let model = scratch.path("model.json");
    athermal_on("fit", &with("line"), &logs, &[&"-o", &model]).ended(0);
    let model = std::fs::read_to_string(&model).unwrap();
    for date in ["2026-03-01", "2026-03-02"] {
        assert!(model.contains(&format!("line=4/machine=dt07/date={date}/log.parquet")));
    }
    let refused = |key, words| {
        let ended = athermal_on("fit", &with(key), &logs, &[&"-o", &scratch.path("none")]);
        ended.ended(2).tells(&[words]);
    };
    refused("machine", "the folder says `dt07`, which is no number");
    refused("no_key", "no_key");
}

/// Of blocks: the least that is fitted.
fn thermal() -> Graph {
    Graph::of_die_tester("of-blocks", "plate1 room")
}

#[test]
fn blocks_of_parquet_are_those_of_csv_and_follow_what_paths_say() {
    let scratch = Scratch::new("parquet-blocks");
    let of = |name: &str| scratch.path(name);
    let graph = scratch.file("graph.toml", thermal());
    let fit = |graph, log: &std::path::Path, blocks: &str| {
        let folder = of(blocks);
        let words: [&dyn AsRef<std::ffi::OsStr>; 6] = [
            &"--blocks",
            &"day",
            &"--keep-blocks",
            &folder,
            &"-o",
            &of(&format!("{blocks}.json")),
        ];
        athermal_on("fit", graph, log, &words).ended(0);
        let model = std::fs::read(of(&format!("{blocks}.json"))).unwrap();
        let model: serde_json::Value = serde_json::from_slice(&model).unwrap();
        let kept = ["1970-01-01", "1970-01-02"]
            .map(|day| std::fs::read_to_string(folder.join(format!("{day}.json"))).unwrap());
        (kept, model["fitted"].clone())
    };
    std::fs::create_dir_all(of("logs/line=4")).unwrap();
    let (csv, parquet) = (of("log.csv"), of("logs/line=4/log.parquet"));
    for log in [&csv, &parquet] {
        athermal(&[&"simulate", &"die-tester", &"--days", &"1.2", &"-o", log]).ended(0);
    }
    let of_csv = fit(&graph, &csv, "csv");
    assert!(of_csv.1["thermal"].is_object());
    assert!(fit(&graph, &parquet, "parquet") == of_csv);
    // A graph that measures what the folder says, and the same file in another folder.
    let signal = "[signals.of_folder]\nunit = \"1\"\nchannels = [\"line\"]\nmax_age = \"1min\"\n";
    let keyed = scratch.file("keyed.toml", format!("{}{signal}", thermal()));
    let (four, _) = fit(&keyed, &of("logs"), "keyed");
    std::fs::rename(of("logs/line=4"), of("logs/line=5")).unwrap();
    let (five, _) = fit(&keyed, &of("logs"), "keyed");
    assert!(five != four);
    assert!(five == fit(&keyed, &of("logs"), "anew").0);
}

#[test]
fn a_run_that_keeps_a_state_writes_no_parquet() {
    let scratch = Scratch::new("parquet-state");
    let of = |name: &str| scratch.path(name);
    let (graph, log) = (graph("linear-axis-sensor"), of("log.csv"));
    athermal(&[&"simulate", &"linear-axis", &"--days", &"0.2", &"-o", &log]).ended(0);
    let (model, state) = (of("model.json"), of("a.state"));
    athermal_on("fit", &graph, &log, &[&"-o", &model]).ended(0);
    let run = |output| {
        athermal(&[
            &"run", &model, &"-i", &log, &"-o", &output, &"--state", &state,
        ])
    };
    let words = "out.parquet: nothing can be added to a file of Parquet";
    run(of("out.parquet")).ended(2).tells(&[words]);
    assert!(!of("out.parquet").exists());
    // The way out that is named loses no row.
    run(of("out.csv")).ended(0);
    let lines = |name| std::fs::read_to_string(of(name)).unwrap().lines().count();
    assert_eq!(lines("out.csv"), lines("log.csv"));
}

#[test]
fn a_fit_of_a_stretch_of_time_reads_no_group_of_rows_outside_of_it() {
    let scratch = Scratch::new("parquet-stretch");
    let graph = graph("linear-axis");
    let csv = simulated(&scratch, "whole.csv", "linear-axis", 2.0, 1);
    let text = std::fs::read_to_string(&csv).unwrap();
    let (header, lines) = text.split_once('\n').unwrap();
    let names: Vec<String> = header.split(',').skip(1).map(str::to_owned).collect();
    let layout = Layout::new("time_s", TimeForm::SECONDS, names.clone());
    let mut days = [1, 2].map(|day| {
        let path = scratch.path(&format!("logs/day={day}/log.parquet"));
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        Writer::create(&path, "time_s", &names, Flush::Buffered).unwrap()
    });
    let mut reader = Reader::open(&csv, layout, Options::default()).unwrap();
    let mut row = Row::default();
    while reader.next_into(&mut row).unwrap() {
        let day = usize::from(row.time_ns >= 86_400_000_000_000);
        days[day].write_row("", row.time_ns, &row.values).unwrap();
    }
    days.into_iter().for_each(|of| of.finish().unwrap());
    // Nothing but the table of contents is left of the second day.
    let second = scratch.path("logs/day=2/log.parquet");
    let mut bytes = std::fs::read(&second).unwrap();
    let (_, length) = bytes[..bytes.len() - 4].split_last_chunk().unwrap();
    let contents = bytes.len() - 8 - u32::from_le_bytes(*length) as usize;
    bytes[4..contents].fill(0xff);
    std::fs::write(&second, bytes).unwrap();
    let is_before = |line: &&str| line.split(',').next().unwrap().parse::<f64>().unwrap() < 8e4;
    let cut: Vec<&str> = lines.lines().filter(is_before).collect();
    let cut = scratch.file("cut.csv", format!("{header}\n{}\n", cut.join("\n")));
    let logs = scratch.path("logs");
    let of = |name: &str| scratch.path(&format!("{name}.json"));
    athermal_on("fit", &graph, &logs, &[&"-o", &of("all")]).ended(3);
    let stretch: &[&dyn AsRef<OsStr>] = &[&"-o", &of("stretch"), &"--to", &"80000"];
    athermal_on("fit", &graph, &logs, stretch).ended(0);
    athermal_on("fit", &graph, &cut, &[&"-o", &of("cut")]).ended(0);
    assert!(learned(&of("stretch")) == learned(&of("cut")));
}
