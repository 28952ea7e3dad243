//! Files that are read twice, and files whose ending names no format.

use std::path::PathBuf;

use super::workbench::athermal;
use super::{csv, desk, rows};

#[test]
fn a_file_that_is_given_twice_is_told_to_count_twice() {
    let (scratch, _, data, model) = desk("twice");
    let again = scratch.path("./").join(data.file_name().unwrap());
    let fit = |data: [&PathBuf; 2]| {
        let output = scratch.path("twice.json");
        athermal(&[&"fit", &model, &"-o", &output, &"--data", data[0], data[1]]).ended(0)
    };
    fit([&data, &again]).tells(&["this file is given more than once, and so often its rows count"]);
    let other = scratch.file("other.csv", csv(&rows(60, 60)));
    let told = fit([&data, &other]).told;
    assert!(!told.contains("more than once"), "{told}");
}

#[test]
fn an_ending_that_names_no_format_is_refused_before_anything_is_written() {
    let (scratch, plain, data, _) = desk("ending");
    let unknown = scratch.path("out.xyz");
    let run = |output: &PathBuf| athermal(&[&"run", &plain, &"--input", &data, &"-o", output]);
    run(&unknown)
        .ended(2)
        .tells(&["`.xyz` names no format", "`.csv`", "`.jsonl`"]);
    athermal(&[&"simulate", &"linear-axis", &"-o", &unknown]).ended(2);
    assert!(!unknown.exists());
    let without = scratch.path("out");
    run(&without).ended(0);
    let text = std::fs::read_to_string(without).unwrap();
    assert!(text.contains(','), "{text}");
}
