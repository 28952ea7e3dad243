//! What `athermal init` says of logs of which no starter graph can be made: what it is, where, and what to do.

use std::fmt::Write as _;

use crate::workbench::{Scratch, athermal};

#[track_caller]
fn says(name: &str, log: impl AsRef<[u8]>, told: &str) {
    let scratch = Scratch::new(&format!("init-refuses-{name}"));
    let (log, graph) = (scratch.file("log.csv", log), scratch.path("graph.toml"));
    let finished = athermal(&[&"init", &log, &"-o", &graph]).ended(2);
    finished.tells(&["log.csv", told]);
    assert!(!finished.told.contains("--lenient"), "{}", finished.told);
    assert!(!graph.exists());
}

/// A plate and a position, a row every so many seconds.
fn log(rows: u32, step: u64) -> String {
    let mut log = "time_s,plate_degC,Z_nm\n".to_owned();
    for nth in 0..rows {
        let t = f64::from(nth);
        let (plate, z) = (21.0 + (t / 7.0).sin(), 50.0 * (t / 20.0).sin());
        writeln!(log, "{},{plate:.3},{z:.2}", step * u64::from(nth)).unwrap();
    }
    log
}

#[test]
fn a_log_without_rows_or_with_a_single_one_is_said_to_have_too_few() {
    says(
        "names",
        log(0, 10),
        "it has no row that can be read below the names of its columns (time_s, plate_degC, Z_nm)",
    );
    says("single", log(1, 10), "it has a single row");
    says(
        "empty",
        "",
        "is empty; a recording starts with a line of column names",
    );
}

#[test]
fn a_log_of_years_is_told_to_be_short_in_days() {
    says(
        "years",
        log(60, 31_557_600),
        "it is too short: a drift over 1424 d, the least at the rate of its samples",
    );
}

#[test]
fn names_beyond_the_longest_row_are_refused_and_names_that_stand_twice_are_numbered() {
    let names: String = (0..80_000)
        .map(|nth| format!(",column_{nth}_degC"))
        .collect();
    says(
        "long",
        format!("time_s{names}\n1{}\n", ",1".repeat(80_000)),
        "a row longer than 1048576 bytes starts here",
    );
    says(
        "twice",
        "time_s,plate_degC,plate_degC\n0,1,2\n",
        "below the names of its columns (time_s, plate_degC[1], plate_degC[2])",
    );
}

#[test]
fn a_log_in_utf_16_is_read_and_one_without_its_mark_is_no_text() {
    let scratch = Scratch::new("init-refuses-utf-16");
    let wide: Vec<u8> = log(700, 10)
        .encode_utf16()
        .flat_map(u16::to_le_bytes)
        .collect();
    let marked = scratch.file("log.csv", [&[0xff, 0xfe][..], &wide].concat());
    athermal(&[&"init", &marked, &"-o", &scratch.path("graph.toml")]).ended(0);
    says(
        "unmarked",
        &wide,
        "is not text; save the recording as CSV or JSON lines in UTF-8",
    );
}

#[test]
fn a_column_with_a_sign_that_is_no_minus_is_left_out_with_its_first_cell() {
    let minus = log(700, 10).replace('-', "\u{2212}");
    let left_out = "Z_nm: left out, it is in part text, such as `\u{2212}0";
    says("minus", &minus, left_out);
    let commas = minus.replace(',', ";").replace('.', ",");
    says("minus-comma", commas, left_out);
}

#[test]
fn a_graph_in_the_place_of_a_log_is_told_to_be_what_init_writes() {
    let scratch = Scratch::new("init-refuses-graph");
    let graph = scratch.file("graph.toml", "schema = 1\n");
    let finished = athermal(&[&"init", &graph]).ended(2);
    finished.tells(&["this is a graph, which init writes, and holds no data; give it a log"]);
    assert!(
        !finished.told.contains("before this option"),
        "{}",
        finished.told
    );
}
