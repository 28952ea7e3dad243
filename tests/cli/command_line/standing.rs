//! What stands in a file stays there where what would take its place is worth less, or is read meanwhile.

use std::ffi::OsStr;

use super::{csv, desk, linear, rows};
use crate::workbench::{athermal, athermal_on};

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
    let graph = linear().replace(
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

#[test]
fn a_fit_in_which_nothing_can_be_fitted_leaves_the_model_that_is_there() {
    let (scratch, _, _, model) = desk("unfit");
    let before = std::fs::read(&model).unwrap();
    let header = scratch.file("header.csv", "time_s,room,Z\n");
    let graph = scratch.path("fitted.toml");
    let fit = athermal_on("fit", &graph, &header, &[&"-o", &model]).ended(1);
    fit.tells(&[
        "thermal could not be fitted",
        "no model is written, and",
        "model.json stays as it is",
    ]);
    assert!(!fit.told.contains("wrote"), "{}", fit.told);
    assert_eq!(std::fs::read(&model).unwrap(), before);
    let fresh = scratch.path("fresh.json");
    let fit = athermal_on("fit", &graph, &header, &[&"-o", &fresh]).ended(1);
    assert!(!fit.told.contains("stays"), "{}", fit.told);
    assert!(!fresh.exists());
}

#[test]
fn nodes_of_a_model_that_have_no_fit_are_told_when_it_is_run() {
    let (scratch, _, _, _) = desk("half-fit");
    let more = "[signals.other]\nunit = \"Cel\"\nchannels = [\"hall\"]\nmax_age = \"1min\"\n\
                [nodes.second]\ntype = \"linear\"\ninputs.features = \"other\"\n\
                inputs.truth = \"position.Z\"\nahead = \"0s\"\n";
    let graph = scratch.file("two.toml", format!("{}{more}", linear()));
    let log = csv(&rows(0, 60)).replace('\n', ",\n");
    let log = scratch.file("log.csv", log.replacen("Z,", "Z,hall", 1));
    let model = scratch.path("two.json");
    athermal_on("fit", &graph, &log, &[&"-o", &model])
        .ended(1)
        .tells(&["second could not be fitted", "wrote"]);
    athermal(&[&"run", &model, &"-i", &log])
        .ended(0)
        .tells(&["two.json: second could not be fitted and gives nothing"]);
}

#[test]
fn a_model_that_takes_over_without_a_fit_of_its_own_says_whose_it_goes_by() {
    let (scratch, _, data, model) = desk("fit-of-before");
    let text = std::fs::read_to_string(&model).unwrap();
    let mut half: serde_json::Value = serde_json::from_str(&text).unwrap();
    half["fitted"] = serde_json::json!({});
    let half = scratch.file("half.json", half.to_string());
    let swap = format!("300={}", half.display());
    let arguments: [&dyn AsRef<OsStr>; 6] = [&"run", &model, &"-i", &data, &"--swap-at", &swap];
    athermal(&arguments).ended(0).tells(&[
        "half.json: thermal could not be fitted there, and keeps the fit of what ran before",
        "took over before",
    ]);
}

#[test]
fn what_is_run_for_programs_comes_as_json_lines() {
    let (scratch, plain, data, _) = desk("json-lines");
    let lines = scratch.path("lines.jsonl");
    athermal(&[&"run", &plain, &"-i", &data, &"-o", &lines]).ended(0);
    let run = athermal(&[&"run", &plain, &"-i", &data, &"--format", &"json"]).ended(0);
    assert_eq!(run.out, std::fs::read_to_string(lines).unwrap());
    let at = format!("300={}", plain.display());
    let arguments: [&dyn AsRef<OsStr>; 8] = [
        &"run",
        &plain,
        &"-i",
        &data,
        &"--format",
        &"json",
        &"--swap-at",
        &at,
    ];
    let first = athermal(&arguments).ended(0).out;
    let first: serde_json::Value = serde_json::from_str(first.lines().next().unwrap()).unwrap();
    assert!(first["revision"].is_string(), "{first}");
}
