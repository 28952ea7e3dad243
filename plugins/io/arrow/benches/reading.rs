//! Values a second that are read from Parquet and from CSV of the same table: 200,000 rows of 50 columns, in turns, the best of five.
//!
//! `cargo bench -p athermal-arrow`

#![allow(clippy::unwrap_used)]

use std::path::Path;
use std::time::Instant;

use athermal_arrow as _;
use athermal_files::{Flush, Layout, Options, Reader, Row, TimeForm, Writer};

const ROWS: u32 = 200_000;
const COLUMNS: u32 = 50;

fn main() {
    // Under `cargo test` a few rows do.
    let rows = if std::env::args().any(|argument| argument == "--bench") {
        ROWS
    } else {
        100
    };
    let folder =
        std::env::temp_dir().join(format!("athermal-arrow-{}-reading", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let columns: Vec<String> = (0..COLUMNS).map(|nth| format!("T{nth}_degC")).collect();
    let files = ["log.csv", "log.parquet"].map(|name| folder.join(name));
    for file in &files {
        let mut writer = Writer::create(file, "time_s", &columns, Flush::Buffered).unwrap();
        let mut values = vec![0.0; columns.len()];
        for row in 0..rows {
            for (nth, value) in values.iter_mut().enumerate() {
                let phase = f64::from(row) * 1e-3 + nth as f64;
                *value = ((21.5 + phase.sin()) * 1e3).round() / 1e3;
            }
            writer
                .write_row(
                    "",
                    1_772_409_600_000_000_000 + i64::from(row) * 1_000_000_000,
                    &values,
                )
                .unwrap();
        }
        writer.finish().unwrap();
    }
    let mut best = [f64::INFINITY; 2];
    for _ in 0..5 {
        for (best, file) in best.iter_mut().zip(&files) {
            let began = Instant::now();
            assert_eq!(read(file, &columns), rows);
            *best = best.min(began.elapsed().as_secs_f64());
        }
    }
    for (seconds, file) in best.iter().zip(&files) {
        let size = std::fs::metadata(file).unwrap().len() as f64 / 1e6;
        let speed = f64::from(rows * COLUMNS) / seconds / 1e6;
        let name = file.file_name().unwrap_or_default().to_string_lossy();
        println!("{name:12} {size:7.1} MB {seconds:7.3} s {speed:7.1} M values/s");
    }
    std::fs::remove_dir_all(&folder).unwrap();
}

fn read(file: &Path, columns: &[String]) -> u32 {
    let layout = Layout::new("time_s", TimeForm::SECONDS, columns.to_vec());
    let mut reader = Reader::open(file, layout, Options::default()).unwrap();
    let (mut row, mut rows) = (Row::default(), 0);
    while reader.next_into(&mut row).unwrap() {
        rows += 1;
    }
    rows
}
