//! Fits on the sums of days in place of rows: the same model from blocks of rows and from those that were kept, and beside a fit on the rows.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::workbench::{Finished, Scratch, athermal, graph, simulated};

const DAY_S: f64 = 86_400.0;

/// A recording of some days in a file for each, of which one lacks a sensor for hours, and the whole in one.
fn days(scratch: &Scratch, days: u32) -> (PathBuf, Vec<PathBuf>) {
    let whole = simulated(scratch, "simulated.csv", "linear-axis", f64::from(days), 1);
    let text = std::fs::read_to_string(whole).unwrap();
    let (header, rows) = text.split_once('\n').unwrap();
    let columns: Vec<&str> = header.split(',').collect();
    let sensor = columns
        .iter()
        .position(|name| name.ends_with("_degC"))
        .unwrap();
    let mut of_day: BTreeMap<i64, String> = BTreeMap::new();
    let mut all = format!("{header}\n");
    for row in rows.lines() {
        let mut cells: Vec<&str> = row.split(',').collect();
        let time: f64 = cells[0].parse().unwrap();
        let (day, hour) = ((time / DAY_S).floor(), time.rem_euclid(DAY_S) / 3600.0);
        if day == 1.0 && (3.0..5.0).contains(&hour) {
            cells[sensor] = "";
        }
        let row = cells.join(",") + "\n";
        all += &row;
        *of_day
            .entry(day as i64)
            .or_insert_with(|| format!("{header}\n")) += &row;
    }
    let files = of_day
        .into_iter()
        .map(|(day, text)| scratch.file(&format!("day{day}.csv"), text));
    let files: Vec<PathBuf> = files.collect();
    (scratch.file("whole.csv", all), files)
}

fn fit(graph: &Path, files: &[&PathBuf], model: &Path, more: &[&str]) -> Finished {
    let mut words: Vec<&dyn AsRef<std::ffi::OsStr>> = vec![&"fit", &graph, &"-o", &model];
    words.extend(more.iter().map(|word| word as &dyn AsRef<std::ffi::OsStr>));
    words.push(&"--data");
    words.extend(
        files
            .iter()
            .map(|file| *file as &dyn AsRef<std::ffi::OsStr>),
    );
    athermal(&words)
}

/// The graph and what was fitted, as the model has them.
fn learned(model: &Path) -> String {
    let text = std::fs::read_to_string(model).unwrap();
    let from = text.find("\"graph\":").unwrap();
    text[from..].to_owned()
}

fn fitted(model: &Path) -> Value {
    let text = std::fs::read_to_string(model).unwrap();
    serde_json::from_str::<Value>(&text).unwrap()["fitted"].clone()
}

#[test]
fn blocks_that_are_kept_give_the_model_of_the_rows_and_days_that_come_are_added() {
    let scratch = Scratch::new("fit-blocks");
    let (whole, days) = days(&scratch, 4);
    let (graph, blocks) = (graph("linear-axis"), scratch.path("blocks"));
    let folder = blocks.to_str().unwrap().to_owned();
    let kept = ["--blocks", "day", "--keep-blocks", &*folder];
    let model = |name: &str| scratch.path(&format!("{name}.json"));
    fit(&graph, &[&whole], &model("blocks"), &["--blocks", "day"]).ended(0);
    let expected = learned(&model("blocks"));
    let all: Vec<&PathBuf> = days.iter().collect();
    // Day by day, as files come.
    fit(&graph, &all[..3], &model("three"), &kept).ended(0);
    let of = |day: usize| blocks.join(format!("1970-01-{day:02}.json"));
    let written = |day: usize| std::fs::metadata(of(day)).unwrap().modified().unwrap();
    let second = written(2);
    fit(&graph, &all, &model("four"), &kept).ended(0);
    assert!(learned(&model("four")) == expected);
    assert_eq!(
        written(2),
        second,
        "a day that stays the same is not made anew"
    );
    // What is kept is read in place of the rows.
    let before: Vec<_> = (1..=4).map(written).collect();
    fit(&graph, &all, &model("again"), &kept).ended(0);
    assert!(learned(&model("again")) == expected);
    assert_eq!((1..=4).map(written).collect::<Vec<_>>(), before);
    // A file that changes makes its day anew, and the one after.
    let text = std::fs::read_to_string(&days[1]).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    let shorter = lines[..lines.len() - 500].join("\n") + "\n";
    std::fs::write(&days[1], &shorter).unwrap();
    fit(&graph, &all, &model("changed"), &kept).ended(0);
    fit(&graph, &all, &model("changed-rows"), &["--blocks", "day"]).ended(0);
    assert!(learned(&model("changed")) == learned(&model("changed-rows")));
    assert!(learned(&model("changed")) != expected);
    assert_eq!((written(1), written(4)), (before[0], before[3]));
    assert!(written(2) > before[1] && written(3) > before[2]);
    // A file that is gone takes its day with it.
    fit(&graph, &all[1..], &model("fewer"), &kept).ended(0);
    fit(
        &graph,
        &all[1..],
        &model("fewer-rows"),
        &["--blocks", "day"],
    )
    .ended(0);
    assert!(learned(&model("fewer")) == learned(&model("fewer-rows")) && !of(1).exists());
}

#[test]
fn a_fit_on_blocks_is_that_on_the_rows_where_folds_end_with_days() {
    let scratch = Scratch::new("fit-blocks-rows");
    let graph = graph("linear-axis");
    // A selection by three folds: thirds of six days end at midnight but for what a warm-up takes, those of four days do not.
    for (days_of, least) in [(6, 8), (4, 3)] {
        let (whole, _) = days(&scratch, days_of);
        let [rows, blocks] = [vec![], vec!["--blocks", "day"]].map(|more| {
            let model = scratch.path("model.json");
            fit(&graph, &[&whole], &model, &more).ended(0);
            fitted(&model)
        });
        let mut same = 0;
        for (node, of_rows) in rows.as_object().unwrap() {
            let of_blocks = &blocks[node];
            if of_rows["regressors"] != of_blocks["regressors"] {
                // What selects nothing has all of them.
                assert!(!node.starts_with("motion."), "{node}");
                continue;
            }
            same += 1;
            let numbers = |of: &Value| -> Vec<f64> {
                let all = of["coefficients"].as_array().into_iter().flatten();
                all.chain([&of["intercept"]])
                    .filter_map(Value::as_f64)
                    .collect()
            };
            let (one, other) = (numbers(of_rows), numbers(of_blocks));
            assert!(one.len() > 2 && one.len() == other.len(), "{node}");
            let size = one.iter().fold(0.0_f64, |size, b| size.max(b.abs()));
            for (one, other) in one.iter().zip(&other) {
                assert!((one - other).abs() <= 1e-9 * size, "{node}: {one} {other}");
            }
        }
        assert!(same >= least, "{days_of} days: {same} of nine");
    }
}

#[test]
fn what_sums_do_not_suffice_is_refused_by_name() {
    let scratch = Scratch::new("fit-blocks-refused");
    let log = simulated(&scratch, "log.csv", "linear-axis", 0.2, 1);
    let with = |name: &str, nodes: &str| {
        let text = format!(
            "schema = 1\nname = {name:?}\nextends = {:?}\n{nodes}",
            graph("linear-axis")
        );
        scratch.file(&format!("{name}.toml"), text)
    };
    let refused = |graph: &Path, words: &[&str]| {
        let model = scratch.path("model.json");
        fit(graph, &[&log], &model, &["--blocks", "day"])
            .ended(2)
            .tells(words);
        assert!(!model.exists());
    };
    let sgd = with("sgd", "nodes.thermal = { solver = { type = \"sgd\" } }\n");
    refused(
        &sgd,
        &["`thermal", "(linear) learns from", "fit without blocks"],
    );
    let far = with("far", "nodes.gradients = { windows = [\"2d\"] }\n");
    refused(&far, &["`gradients` looks back", "fit without blocks"]);
    // One day is not cut into the folds of a selection.
    let model = scratch.path("model.json");
    let one = fit(&graph("linear-axis"), &[&log], &model, &["--blocks", "day"]);
    one.ended(1).tells(&["1 blocks cannot be cut into"]);
    // A folder of something else stays as it is.
    let other = scratch.path("other");
    std::fs::create_dir_all(&other).unwrap();
    std::fs::write(other.join("2026-03-01.json"), "{}").unwrap();
    let kept = ["--blocks", "day", "--keep-blocks", other.to_str().unwrap()];
    let ended = fit(&graph("linear-axis"), &[&log], &model, &kept);
    ended
        .ended(2)
        .tells(&["holds 2026-03-01.json and no index.json"]);
    assert!(other.join("2026-03-01.json").exists());
}

#[test]
fn a_day_of_data_is_cut_into_blocks_of_hours_which_are_kept_and_read_again() {
    let scratch = Scratch::new("fit-blocks-hours");
    let (whole, _) = days(&scratch, 1);
    let (graph, blocks) = (graph("linear-axis"), scratch.path("blocks"));
    let model = |name: &str| scratch.path(&format!("{name}.json"));
    let fitted_on = |name: &str, length: &str, more: &[&str]| {
        let words = [&["--blocks", length], more].concat();
        fit(&graph, &[&whole], &model(name), &words)
    };
    // A day has no folds that end with days.
    fitted_on("days", "day", &[]).ended(1);
    fitted_on("hours", "6h", &[]).ended(0);
    let folder = blocks.to_str().unwrap().to_owned();
    for name in ["made", "read"] {
        fitted_on(name, "6h", &["--keep-blocks", &folder]).ended(0);
        assert_eq!(learned(&model(name)), learned(&model("hours")), "{name}");
    }
    let names = std::fs::read_dir(&blocks).unwrap();
    let mut names: Vec<String> = names
        .map(|of| of.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    let of_blocks = ["T0000", "T0600", "T1200", "T1800"].map(|of| format!("1970-01-01{of}.json"));
    assert_eq!(names[..4], of_blocks);
    // Another length makes all anew.
    fitted_on("longer", "4h", &["--keep-blocks", &folder]).ended(0);
    assert!(!blocks.join("1970-01-01T0600.json").exists());
    for (length, words) in [
        ("10min", "looks back"),
        ("90s", "whole minutes"),
        ("never", "--blocks"),
    ] {
        fitted_on("none", length, &[]).ended(2).tells(&[words]);
    }
}
