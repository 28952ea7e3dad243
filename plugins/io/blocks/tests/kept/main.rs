//! Fits on blocks beside fits on the rows: the same bits from blocks that were made just now and from those that were kept.

#![allow(clippy::unwrap_used)]

mod outlived;

use std::cell::Cell;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use athermal_blocks::KeptBlocks;
use athermal_core::engine::Fitted;
use athermal_core::time::{Duration, Instant};
use athermal_estimators as _;
use athermal_features as _;
use athermal_files::{Dataset, Options};
use athermal_run::fit::{
    Block, FitError, FitOptions, FitReport, blocks_of, check_blocks, fit, fit_from_blocks,
    rows_identity,
};
use athermal_run::model::Model;
use athermal_run::recording::Table;
use serde_json::Value;

const DAY: Duration = Duration::from_ns(86_400_000_000_000);

const GRAPH: &str = r#"
schema = 1
name = "blocks"

[time]
column = "time_s"

[signals.t]
unit = "Cel"
channels = ["a", "b", "c"]
column = "{channel}_degC"
max_age = "2min"

[signals.position]
unit = "nm"
channels = ["z"]
column = "{channel}_nm"
max_age = "3min"

[nodes.drift]
type = "slope"
inputs.signal = "position"
windows = ["5min"]
unit = "nm/min"

[nodes.gradients]
type = "slope"
inputs.signal = "t"
windows = ["5min", "20min"]
unit = "mK/min"

[nodes.chosen]
type = "linear"
inputs.features = "gradients"
inputs.truth = "drift.z"
ahead = "5min"
train.abs_truth = { below = "500 nm/min" }
selection = { method = "forward", folds = 3, tolerance = 1e-3 }

[nodes.sparse]
type = "lasso"
alpha = 0.001
inputs.features = "gradients"
inputs.truth = "drift.z"
ahead = "5min"

[nodes.motion]
type = "ar"
inputs.truth = "drift.z"
ahead = "5min"
lags = ["0s", "5min"]
solver = { type = "ridge", alpha = { by = "cross_validation", folds = 2 } }

[outputs]
drift = "chosen"
"#;

/// A folder of a test's own, which goes with it.
struct Folder(PathBuf);

impl Folder {
    fn of(test: &str) -> Self {
        let name = format!("athermal-blocks-{}-{test}", std::process::id());
        let path = std::env::temp_dir().join(name);
        let _ = std::fs::remove_dir_all(&path);
        std::fs::create_dir_all(&path).unwrap();
        Self(path)
    }

    fn file(&self, name: &str, text: impl AsRef<str>) -> PathBuf {
        let path = self.0.join(name);
        std::fs::write(&path, text.as_ref()).unwrap();
        path
    }

    fn model(&self, text: &str) -> Model {
        Model::load(self.file("graph.toml", text)).unwrap()
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// A recording of a row each half minute, as text without its names by days. One sensor is silent for hours of the second day.
fn days(count: u32) -> Vec<String> {
    let mut noise = 1_u64;
    let mut uniform = move || {
        noise = noise
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (noise >> 40) as f64 / f64::from(1 << 24) - 0.5
    };
    let mut slow = [21.0, 22.0, 20.0];
    let mut days = vec![String::new(); count as usize];
    for row in 0..2880 * count {
        let t = f64::from(row) * 30.0;
        let room = 21.0 + (t / 9000.0).sin() + 0.5 * (t / 2300.0).cos();
        for (nth, part) in slow.iter_mut().enumerate() {
            let lag = [20.0, 60.0, 150.0][nth];
            *part += (room - *part) / lag + 0.01 * uniform();
        }
        let z = 800.0 * (slow[0] - slow[2]) + 300.0 * slow[1] + 0.5 * uniform();
        let [a, b, c] = slow.map(|value| format!("{value:.4}"));
        let is_silent = (3000..3300).contains(&row);
        let b = if is_silent { String::new() } else { b };
        days[row as usize / 2880] += &format!("{t},{a},{b},{c},{z:.2}\n");
    }
    days
}

fn text(rows: &[String]) -> String {
    "time_s,a_degC,b_degC,c_degC,z_nm\n".to_owned() + &rows.concat()
}

fn data(files: &[PathBuf]) -> Dataset {
    Dataset::new(files.to_vec(), Options::default())
}

fn blocks(model: &Model, files: &[PathBuf]) -> Vec<Block> {
    let mut blocks = Vec::new();
    let mut take = |block| {
        blocks.push(block);
        Ok(())
    };
    blocks_of(
        &model.plan,
        &data(files),
        DAY,
        &|_| true,
        &mut |_| {},
        &mut take,
    )
    .unwrap();
    blocks
}

fn on_blocks(model: &Model, files: &[PathBuf]) -> (Fitted, FitReport) {
    let blocks = blocks(model, files);
    let options = FitOptions::default();
    fit_from_blocks(&model.plan, &blocks, &options, &mut |_| {}).unwrap()
}

fn text_of(fitted: &Fitted) -> BTreeMap<String, Value> {
    let of = |predictor| serde_json::to_value(predictor).unwrap();
    let all = fitted.iter();
    all.map(|(node, predictor)| (node.clone(), of(predictor.as_ref())))
        .collect()
}

#[test]
fn a_fit_on_blocks_is_that_on_the_rows_and_finds_the_same_regressors() {
    let folder = Folder::of("beside");
    let model = folder.model(GRAPH);
    let whole = [folder.file("whole.csv", text(&days(6)))];
    let options = FitOptions::default();
    let (of_rows, report) = fit(&model.plan, &data(&whole), &options, &mut |_| {}).unwrap();
    let (of_blocks, on_blocks) = on_blocks(&model, &whole);
    assert_eq!(report.failed().count() + on_blocks.failed().count(), 0);
    assert_eq!(
        (report.ticks, report.segments),
        (on_blocks.ticks, on_blocks.segments)
    );
    assert_eq!(
        (report.period, &report.ranges),
        (on_blocks.period, &on_blocks.ranges)
    );
    let (of_rows, of_blocks) = (text_of(&of_rows), text_of(&of_blocks));
    assert_eq!(of_rows.len(), 3);
    for (node, rows) in &of_rows {
        let blocks = &of_blocks[node];
        assert_eq!(rows["regressors"], blocks["regressors"], "{node}");
        let numbers = |of: &Value| -> Vec<f64> {
            let all = of["coefficients"].as_array().into_iter().flatten();
            all.chain([&of["intercept"]])
                .filter_map(Value::as_f64)
                .collect()
        };
        let (rows, blocks) = (numbers(rows), numbers(blocks));
        assert!(rows.len() > 2, "{node}");
        let size = rows.iter().fold(0.0_f64, |size, b| size.max(b.abs()));
        for (one, other) in rows.iter().zip(&blocks) {
            assert!(
                (one - other).abs() <= 1e-9 * size,
                "{node}: {rows:?} {blocks:?}"
            );
        }
    }
    // Which rows are left out is the same too: a sensor was silent.
    for (rows, blocks) in report.estimators.iter().zip(&on_blocks.estimators) {
        assert_eq!(
            (rows.rows, rows.dropped),
            (blocks.rows, blocks.dropped),
            "{}",
            rows.node
        );
    }
    assert!(report.estimators.iter().any(|of| of.dropped.incomplete > 0));
}

#[test]
fn a_sensor_that_is_mostly_dead_is_left_out_of_blocks_as_of_rows() {
    let folder = Folder::of("dead");
    let model = folder.model(GRAPH);
    let dead: Vec<String> = days(4)[1..]
        .iter()
        .map(|day| {
            let rows = day.lines().map(|row| {
                let mut cells: Vec<&str> = row.split(',').collect();
                cells[1] = if cells[0].ends_with("00") {
                    cells[1]
                } else {
                    ""
                };
                cells.join(",") + "\n"
            });
            rows.collect()
        })
        .collect();
    let all = [days(1), dead].concat();
    let whole = [folder.file("whole.csv", text(&all))];
    let options = FitOptions::default();
    let (_, report) = fit(&model.plan, &data(&whole), &options, &mut |_| {}).unwrap();
    let (_, on_blocks) = on_blocks(&model, &whole);
    for (rows, blocks) in report.estimators.iter().zip(&on_blocks.estimators) {
        assert_eq!(rows.dropped_candidates, blocks.dropped_candidates);
        assert_eq!(
            (rows.rows, rows.dropped),
            (blocks.rows, blocks.dropped),
            "{}",
            rows.node
        );
    }
}

#[test]
fn blocks_come_back_from_json_to_the_bit_and_each_knows_two_days_alone() {
    let folder = Folder::of("json");
    let model = folder.model(GRAPH);
    let days = days(4);
    let whole = [folder.file("whole.csv", text(&days))];
    let all = blocks(&model, &whole);
    let days_of: Vec<i64> = all.iter().map(|block| block.day).collect();
    assert_eq!(days_of, [0, 1, 2, 3]);
    let texts: Vec<String> = all.iter().map(|block| block.to_json().unwrap()).collect();
    let again: Vec<Block> = texts
        .iter()
        .map(|text| Block::from_json(text).unwrap())
        .collect();
    let options = FitOptions {
        threads: 1,
        ..FitOptions::default()
    };
    let fit_of = |blocks: &[Block]| {
        let fitted = fit_from_blocks(&model.plan, &blocks.to_vec(), &options, &mut |_| {});
        text_of(&fitted.unwrap().0)
    };
    assert_eq!(fit_of(&all), fit_of(&again));
    assert_eq!(fit_of(&all), text_of(&on_blocks(&model, &whole).0));
    // A day with the day before gives the block that it has among many, from a table as from a file.
    let pair = [folder.file("pair.csv", text(&days[1..3]))];
    let table = Table::read(&data(&pair), &model.plan).unwrap();
    let mut of_pair = Vec::new();
    let mut take = |block: Block| {
        of_pair.push(block.to_json().unwrap());
        Ok(())
    };
    blocks_of(
        &model.plan,
        &table,
        DAY,
        &|day| day == 2,
        &mut |_| {},
        &mut take,
    )
    .unwrap();
    assert_eq!(of_pair, texts[2..3]);
    // Days are in order, and of this graph.
    let swapped = [again[1].clone(), again[0].clone()];
    let stray = fit_from_blocks(&model.plan, &swapped.to_vec(), &options, &mut |_| {});
    assert!(
        stray
            .err()
            .unwrap()
            .to_string()
            .contains("not in the order of time")
    );
    let other = folder.model(&GRAPH.replace("\"20min\"", "\"30min\""));
    let stray = fit_from_blocks(&other.plan, &again.to_vec(), &options, &mut |_| {});
    assert!(
        stray
            .err()
            .unwrap()
            .to_string()
            .contains("of another graph")
    );
    // How an estimator is fitted is no part of its examples.
    let other = folder.model(&GRAPH.replace("alpha = 0.001", "alpha = 0.01"));
    assert_eq!(rows_identity(&other.plan), rows_identity(&model.plan));
}

/// Keeps blocks of files, and gives the fit on them with how many were made.
fn kept(folder: &Path, model: &Model, files: &[PathBuf]) -> (BTreeMap<String, Value>, u64) {
    kept_with(folder, model, files, &Options::default())
}

fn kept_with(
    folder: &Path,
    model: &Model,
    files: &[PathBuf],
    options: &Options,
) -> (BTreeMap<String, Value>, u64) {
    let open = |files: Vec<PathBuf>, _| Dataset::new(files, options.clone());
    let is_read = Cell::new(false);
    let blocks = KeptBlocks::refresh(
        folder,
        &model.plan,
        DAY,
        files,
        "",
        &open,
        &mut |data, wanted, take| {
            is_read.set(true);
            blocks_of(&model.plan, data, DAY, wanted, &mut |_| {}, take)
        },
    );
    let blocks = blocks.unwrap();
    assert_eq!(blocks.cards.len(), files.len());
    assert!(blocks.cards.iter().all(|card| card.rows > 0));
    assert!(
        blocks.made > 0 || !is_read.get(),
        "nothing is read where nothing changes"
    );
    let fitted = fit_from_blocks(&model.plan, &blocks, &FitOptions::default(), &mut |_| {});
    (text_of(&fitted.unwrap().0), blocks.made)
}

#[test]
fn days_that_come_change_or_go_are_made_anew_and_others_stay() {
    let folder = Folder::of("kept");
    let model = folder.model(GRAPH);
    let mut days = days(6);
    let name = |nth: usize| format!("day{nth}.csv");
    let mut files: Vec<PathBuf> = (0..6)
        .map(|nth| folder.file(&name(nth), text(&days[nth..=nth])))
        .collect();
    let blocks = folder.0.join("blocks");
    let fresh = |model: &Model, files: &[PathBuf]| text_of(&on_blocks(model, files).0);
    let (fitted, made) = kept(&blocks, &model, &files[..5]);
    assert_eq!((fitted, made), (fresh(&model, &files[..5]), 5));
    let (fitted, made) = kept(&blocks, &model, &files);
    assert_eq!((fitted, made), (fresh(&model, &files), 1));
    let (fitted, made) = kept(&blocks, &model, &files);
    assert_eq!((fitted, made), (fresh(&model, &files), 0));
    // The same content under another name.
    let moved = folder.0.join("moved.csv");
    std::fs::rename(&files[2], &moved).unwrap();
    files[2] = moved;
    assert_eq!(kept(&blocks, &model, &files).1, 0);
    // Its day and the day after change with a file.
    let half = days[3].len() / 2;
    let half = half + days[3][half..].find('\n').unwrap() + 1;
    days[3].truncate(half);
    folder.file(&name(3), text(&days[3..=3]));
    let (fitted, made) = kept(&blocks, &model, &files);
    assert_eq!((fitted, made), (fresh(&model, &files), 2));
    // A file that is gone takes its day with it.
    let (fitted, made) = kept(&blocks, &model, &files[1..]);
    assert_eq!((fitted, made), (fresh(&model, &files[1..]), 1));
    // Other features are other examples.
    let other = folder.model(&GRAPH.replace("\"20min\"", "\"30min\""));
    let (fitted, made) = kept(&blocks, &other, &files[1..]);
    assert_eq!((fitted, made), (fresh(&other, &files[1..]), 5));
    let index = std::fs::read_to_string(blocks.join("index.json")).unwrap();
    assert!(index.contains(&rows_identity(&other.plan)));
    // A folder of something else stays as it is.
    let strange = Folder::of("strange");
    let own = strange.file("2026-03-01.json", "{}");
    let refused = KeptBlocks::refresh(
        &strange.0,
        &model.plan,
        DAY,
        &files,
        "",
        &|files, _| data(&files),
        &mut |_, _, _| Ok(()),
    );
    let words = refused.err().unwrap().to_string();
    assert!(
        words.contains("holds 2026-03-01.json and no index.json"),
        "{words}"
    );
    assert!(own.exists());
}

#[test]
fn what_a_file_gives_beside_its_content_makes_its_days_anew() {
    let folder = Folder::of("place");
    let model = folder.model(GRAPH);
    let days = days(4);
    let name = |nth: usize| format!("day{nth}.csv");
    let mut files: Vec<PathBuf> = (0..4)
        .map(|nth| folder.file(&name(nth), text(&days[nth..=nth])))
        .collect();
    let blocks = folder.0.join("blocks");
    // The clock of the last one is behind by an hour, so that it ends in a fifth day.
    let hour = 3_600_000_000_000;
    let options = Options {
        offsets: vec![(files[3].clone(), hour)],
        ..Options::default()
    };
    let fresh = |files: &[PathBuf], options: &Options| {
        let mut blocks = Vec::new();
        let mut take = |block| {
            blocks.push(block);
            Ok(())
        };
        let data = Dataset::new(files.to_vec(), options.clone());
        blocks_of(&model.plan, &data, DAY, &|_| true, &mut |_| {}, &mut take).unwrap();
        let options = FitOptions::default();
        text_of(
            &fit_from_blocks(&model.plan, &blocks, &options, &mut |_| {})
                .unwrap()
                .0,
        )
    };
    let (shifted, made) = kept_with(&blocks, &model, &files, &options);
    assert_eq!((&shifted, made), (&fresh(&files, &options), 5));
    assert_eq!(kept_with(&blocks, &model, &files, &options).1, 0);
    // Under another name nothing is added to its times.
    let other = folder.0.join("other.csv");
    std::fs::rename(&files[3], &other).unwrap();
    files[3] = other;
    let (fitted, made) = kept_with(&blocks, &model, &files, &options);
    assert_eq!((&fitted, made), (&fresh(&files, &options), 1));
    assert!(fitted != shifted);
    // A file that is given twice is not there once: its times start again.
    let half = days[3].lines().take(1440).map(|row| format!("{row}\n"));
    let half = [half.collect::<String>()];
    let twice = [
        files[0].clone(),
        folder.file("half.csv", text(&half)),
        folder.file("again.csv", text(&half)),
    ];
    assert_eq!(kept(&blocks, &model, &twice[..2]).1, 1);
    let (fitted, made) = kept(&blocks, &model, &twice);
    assert_eq!((fitted, made), (fresh(&twice, &Options::default()), 1));
    // What a first call made before it ended is not taken for blocks of other files.
    std::fs::remove_dir_all(&blocks).unwrap();
    let ends = KeptBlocks::refresh(
        &blocks,
        &model.plan,
        DAY,
        &files,
        "",
        &|files, _| data(&files),
        &mut |data, wanted, take| {
            let mut rest = 2;
            let mut some = |block| {
                rest -= 1;
                take(block)?;
                if rest == 0 {
                    return Err(FitError::Recording("no room is left".into()));
                }
                Ok(())
            };
            blocks_of(&model.plan, data, DAY, wanted, &mut |_| {}, &mut some)
        },
    );
    assert!(ends.is_err() && !blocks.join("1970-01-02.json").exists());
    let (fitted, made) = kept(&blocks, &model, &files[2..]);
    assert_eq!((fitted, made), (fresh(&files[2..], &Options::default()), 2));
}

#[test]
fn what_sums_do_not_suffice_is_named() {
    let folder = Folder::of("refused");
    let refused = |from: &str, to: &str| {
        let model = folder.model(&GRAPH.replace(from, to));
        check_blocks(&model.plan, DAY).err().unwrap().to_string()
    };
    let huber = refused("type = \"lasso\"\nalpha = 0.001", "type = \"huber\"");
    assert!(
        huber.contains("not what `sparse` (huber) learns from"),
        "{huber}"
    );
    let sgd = refused(
        "selection = {",
        "solver = { type = \"sgd\" }\nselection = {",
    );
    assert!(sgd.contains("`chosen` (linear) learns from"), "{sgd}");
    let far = refused("\"20min\"", "\"2d\"");
    assert!(far.contains("`gradients` looks back"), "{far}");
    let model = folder.model(GRAPH);
    let mut table = Table::default();
    let row = vec![1.0; model.plan.sources.len()];
    table.push(Instant::from_ns(86_400_000_000_000), &row);
    table.segment();
    table.push(Instant::from_ns(0), &row);
    let back = blocks_of(
        &model.plan,
        &table,
        DAY,
        &|_| true,
        &mut |_| {},
        &mut |_| Ok(()),
    );
    let back = back.err().unwrap().to_string();
    assert!(back.contains("the rows go back to block 0"), "{back}");
}
