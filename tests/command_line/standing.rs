//! What stands in a file stays there where what would take its place is worth less, or is read meanwhile.

use std::ffi::OsStr;

use super::workbench::{athermal, athermal_on};
use super::{FITTED, csv, desk, rows};

#[cfg(unix)]
#[test]
fn a_log_that_a_shell_opens_as_standard_input_is_not_written_over() {
    let (_scratch, plain, data, _) = desk("shell");
    let before = std::fs::read(&data).unwrap();
    let run = std::process::Command::new(env!("CARGO_BIN_EXE_athermal"))
        .arg("run")
        .arg(&plain)
        .args(["-i", "-", "-o"])
        .arg(&data)
        .stdin(std::fs::File::open(&data).unwrap())
        .output()
        .unwrap();
    let told = String::from_utf8(run.stderr).unwrap();
    assert_eq!(run.status.code(), Some(2), "{told}");
    assert!(
        told.contains("this is the same file as standard input"),
        "{told}"
    );
    assert_eq!(std::fs::read(&data).unwrap(), before);
}

#[test]
fn results_of_tests_do_not_take_the_place_of_their_data() {
    let (scratch, _, data, _) = desk("junit-data");
    let graph = FITTED.replace(
        "[outputs]",
        "[[tests]]\nname = \"own\"\nfit = \"data.csv\"\non = \"data.csv\"\n\
         expect = [{ of = \"thermal\", valid_above = 0 }]\n[outputs]",
    );
    let graph = scratch.file("tested.toml", graph);
    let before = std::fs::read(&data).unwrap();
    let refused = athermal(&[&"test", &graph, &"--junit", &data]).ended(2);
    refused.tells(&["--junit", "this is the same file as", "data.csv"]);
    assert_eq!(std::fs::read(&data).unwrap(), before);
}
