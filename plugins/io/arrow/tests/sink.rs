//! Rows of a service in Parquet: each once, in files that are whole.

#![allow(clippy::unwrap_used)]

use std::path::{Path, PathBuf};

use athermal_arrow::ParquetSink;
use athermal_files::{Layout, Options, Reader, Row, TimeForm, recordings_in};
use athermal_serve::connector::Outlet;
use athermal_serve::testkit::{assert_sink, open_sink, put};

/// A folder of a test's own, empty.
fn folder(test: &str) -> PathBuf {
    let name = format!("athermal-arrow-sink-{}-{test}", std::process::id());
    let path = std::env::temp_dir().join(name);
    let _ = std::fs::remove_dir_all(&path);
    std::fs::create_dir_all(&path).unwrap();
    path
}

fn with(parameters: &str) -> ParquetSink {
    serde_json::from_str(parameters).unwrap()
}

/// The files of a folder by their names below it, each with the times of its rows in s.
fn files(folder: &Path) -> Vec<(String, Vec<i64>)> {
    let of = |path: PathBuf| {
        let layout = Layout::new("time_s", TimeForm::SECONDS, ["a", "b"]);
        let mut reader = Reader::open(&path, layout, Options::default()).unwrap();
        let (mut row, mut times) = (Row::default(), Vec::new());
        while reader.next_into(&mut row).unwrap() {
            let second = row.time_ns / 1_000_000_000;
            assert_eq!(row.values, [second as f64, (second + 1) as f64]);
            times.push(second);
        }
        let name = path.strip_prefix(folder).unwrap().display().to_string();
        (name, times)
    };
    recordings_in(folder).into_iter().map(of).collect()
}

fn put_all(outlet: &mut dyn Outlet, seconds: impl Iterator<Item = i64>) {
    seconds.for_each(|second| put(outlet, second, 2).unwrap());
    outlet.flush().unwrap();
}

#[test]
fn rows_in_parquet_keep_the_rules_of_sinks() {
    let folder = folder("rules");
    assert_sink(&with("{\"path\": \"rows\"}"), &folder, &["a", "b"]);
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn a_file_is_there_once_its_time_is_over_and_a_kill_leaves_whole_files_and_each_row_once() {
    let folder = folder("kill");
    let sink = with("{\"path\": \"out\", \"every\": \"1h\"}");
    let out = folder.join("out");
    let open = || open_sink(&sink, &folder, &["a", "b"]).unwrap();
    let every_minute = |from: i64, to: i64| (from..to).map(|minute| 60 * minute);
    let first = "date=1970-01-01/00-00-00.parquet".to_owned();
    let mut outlet = open();
    put_all(&mut *outlet, every_minute(0, 59));
    assert_eq!(files(&out), [], "the hour is not over");
    let place = outlet.kept().unwrap().end().unwrap();
    // The hour ends, and so does the program, before it has kept how far it was.
    put_all(&mut *outlet, every_minute(59, 75));
    drop(outlet);
    assert_eq!(
        files(&out),
        [(first.clone(), every_minute(0, 60).collect())]
    );
    // The journal knows two more rows alone: the file that was ended is taken back.
    let mut outlet = open();
    let kept = outlet.kept().unwrap();
    assert_eq!(kept.rows_after(place).unwrap(), Some(16));
    kept.cut(place, 0).unwrap();
    assert_eq!(files(&out), []);
    put_all(&mut *outlet, every_minute(59, 24 * 60 + 5));
    drop(outlet);
    let all = files(&out);
    assert_eq!(all.len(), 24);
    let rows: Vec<i64> = all.iter().flat_map(|(_, rows)| rows.clone()).collect();
    assert_eq!(rows, every_minute(0, 24 * 60).collect::<Vec<_>>());
    // Killed while it wrote a file: what is half there is no recording, and is written again.
    let last = out.join("date=1970-01-01/23-00-00.parquet");
    let bytes = std::fs::read(&last).unwrap();
    std::fs::write(last.with_file_name(".part"), &bytes[..bytes.len() / 2]).unwrap();
    std::fs::remove_file(&last).unwrap();
    drop(open());
    assert_eq!(files(&out), all);
    assert_eq!(all[0].0, first);
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn a_place_is_good_until_one_behind_it_is_kept_however_many_files_were_ended_since() {
    let folder = folder("place");
    let sink = with("{\"path\": \"out\", \"every\": \"1min\"}");
    let open = || open_sink(&sink, &folder, &["a", "b"]).unwrap();
    let out = folder.join("out");
    let waiting = || {
        let names = std::fs::read_dir(&out)
            .unwrap()
            .map(|of| of.unwrap().file_name());
        names
            .filter(|name| name.to_string_lossy().starts_with('.'))
            .count()
    };
    let mut outlet = open();
    put_all(&mut *outlet, 0..30);
    let place = outlet.kept().unwrap().end().unwrap();
    // Ten minutes at once, and a kill.
    put_all(&mut *outlet, 30..630);
    drop(outlet);
    let mut outlet = open();
    let kept = outlet.kept().unwrap();
    assert_eq!(kept.rows_after(place).unwrap(), Some(600));
    kept.cut(place, 100).unwrap();
    // Two minutes were whole, and the third is open again.
    let whole = files(&out);
    assert_eq!(
        whole.iter().map(|of| of.1.len()).collect::<Vec<_>>(),
        [60, 60]
    );
    put_all(&mut *outlet, 130..630);
    let kept = outlet.kept().unwrap();
    let place = kept.end().unwrap();
    assert_eq!(
        waiting(),
        11,
        "the place before may be the one that is on the disk"
    );
    assert_eq!(kept.end().unwrap(), place);
    assert_eq!(
        waiting(),
        11,
        "it was asked for twice, as where the disk is full"
    );
    kept.forget(place);
    assert_eq!(kept.rows_after(place).unwrap(), Some(0));
    assert_eq!(waiting(), 1);
    let seconds: Vec<i64> = files(&out).into_iter().flat_map(|of| of.1).collect();
    assert_eq!(seconds, (0..600).collect::<Vec<_>>());
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn a_file_that_is_there_and_not_its_own_is_not_written_over_and_no_row_is_lost_by_it() {
    let folder = folder("there");
    let sink = with("{\"path\": \"out\", \"every\": \"1min\"}");
    let mut outlet = open_sink(&sink, &folder, &["a", "b"]).unwrap();
    let file = folder.join("out/date=1970-01-01/00-01-00.parquet");
    std::fs::create_dir_all(file.parent().unwrap()).unwrap();
    std::fs::write(&file, "another's").unwrap();
    put_all(&mut *outlet, 0..60);
    let wrong = put(&mut *outlet, 60, 2).unwrap_err();
    assert!(wrong.contains("is there already"), "{wrong}");
    assert_eq!(std::fs::read(&file).unwrap(), b"another's");
    std::fs::remove_file(&file).unwrap();
    put_all(&mut *outlet, 60..121);
    let seconds = files(&folder.join("out")).into_iter().flat_map(|of| of.1);
    assert_eq!(seconds.collect::<Vec<_>>(), (0..120).collect::<Vec<_>>());
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn rows_of_other_columns_and_stretches_that_are_no_part_of_a_day_are_refused() {
    let folder = folder("refused");
    let sink = with("{\"path\": \"out\"}");
    let mut outlet = open_sink(&sink, &folder, &["a", "b"]).unwrap();
    put_all(&mut *outlet, 0..3);
    drop(outlet);
    let other = open_sink(&sink, &folder, &["a"]).err().unwrap();
    assert!(other.contains("rows of other columns"), "{other}");
    for every in ["7h", "30s"] {
        let sink = with(&format!("{{\"path\": \"out\", \"every\": {every:?}}}"));
        let wrong = open_sink(&sink, &folder, &["a", "b"]).err().unwrap();
        assert!(wrong.contains("must be a whole part of a day"), "{wrong}");
    }
    std::fs::remove_dir_all(folder).unwrap();
}
