//! Recordings in Parquet, of a program that was built with them, beside the same recordings as CSV.

use athermal::files::{Layout, Options, Reader, Row, TimeForm};

use crate::workbench::{Scratch, athermal, athermal_on, graph};

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
    let rows = |path| {
        let layout = Layout::new("time_s", TimeForm::SECONDS, columns.clone());
        let mut reader = Reader::open(path, layout, Options::default()).unwrap();
        let (mut rows, mut row) = (Vec::new(), Row::default());
        while reader.next_into(&mut row).unwrap() {
            let values: Vec<u64> = row.values.iter().map(|value| value.to_bits()).collect();
            rows.push((row.time_ns, values));
        }
        rows
    };
    assert!(rows(csv).len() > 1000 && rows(csv) == rows(parquet));
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
const GRAPH: &str = r#"
schema = 1
name = "of-blocks"
[time]
column = "time_s"
[signals.temperature]
unit = "Cel"
channels = ["plate1", "room"]
column = "{channel}_degC"
max_age = "1min"
[signals.position]
unit = "nm"
channels = ["Z1"]
column = "{channel}_nm"
max_age = "3min"
[nodes.drift]
type = "slope"
inputs.signal = "position"
windows = ["5min"]
unit = "nm/min"
[nodes.gradients]
type = "slope"
inputs.signal = "temperature"
windows = ["5min"]
unit = "mK/min"
[nodes.thermal]
type = "linear"
inputs.features = "gradients"
inputs.truth = "drift.Z1"
ahead = "5min"
[outputs]
predicted = "thermal"
"#;

#[test]
fn blocks_of_parquet_are_those_of_csv_and_follow_what_paths_say() {
    let scratch = Scratch::new("parquet-blocks");
    let of = |name: &str| scratch.path(name);
    let graph = scratch.file("graph.toml", GRAPH);
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
    let keyed = scratch.file("keyed.toml", format!("{GRAPH}{signal}"));
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
