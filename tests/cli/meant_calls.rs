//! Files in the place of others, and words of other programs: each is named for what it is, with the call that was meant.

use std::process::Command;

use crate::workbench::{Scratch, athermal, one_axis};

/// What the program says of a call in a folder, which it refuses.
fn refused(scratch: &Scratch, call: &str) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_athermal"))
        .current_dir(scratch.path(""))
        .args(call.split(' '))
        .output()
        .unwrap();
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{call}: {told}");
    told
}

#[test]
fn what_stands_in_the_place_of_another_is_named_with_the_call_that_was_meant() {
    let scratch = Scratch::new("meant-calls");
    std::fs::copy(one_axis(&scratch), scratch.path("g.toml")).unwrap();
    let simulated = scratch.path("log.csv");
    athermal(&[
        &"simulate",
        &"die-tester",
        &"--days",
        &"0.2",
        &"-o",
        &simulated,
    ])
    .ended(0);
    scratch.file("other.jsonl", "{\"time_s\": 0, \"a\": 1}\n");
    scratch.file(
        "model.json",
        "{\n  \"athermal_model\": 1,\n  \"card\": {}\n}\n",
    );
    std::fs::create_dir(scratch.path("out")).unwrap();
    let (log, graph, model) = (
        "this is a log, and a graph or model stands here",
        "this is a graph and holds no data",
        "this is a model and holds no data",
    );
    let fit = "tip: `athermal fit g.toml --data log.csv -o model.json`";
    let init = "tip: `athermal init log.csv`";
    let run = "tip: `athermal run model.json --input log.csv`";
    let folder = "this is a folder; name a file in it: out/NAME";
    for (call, parts) in [
        ("check log.csv", [log, init]),
        ("show log.csv", [log, init]),
        (
            "fit log.csv --data log.csv -o m.json",
            [log, "tip: `athermal init log.csv`"],
        ),
        ("fit log.csv --data g.toml -o model.json", ["log.csv", fit]),
        ("fit --data g.toml -o model.json log.csv", [graph, fit]),
        ("fit g.toml log.csv", ["log.csv", fit]),
        ("fit log.csv g.toml", ["log.csv", fit]),
        ("train g.toml --data log.csv", ["train", fit]),
        ("train g.toml", ["train", "tip: `athermal fit`"]),
        ("predict model.json --data log.csv", ["predict", run]),
        ("run model.json log.csv", ["log.csv", run]),
        ("run log.csv --input model.json", [log, run]),
        ("run other.jsonl --input other.jsonl", [log, "other.jsonl"]),
        (
            "evaluate log.csv --data model.json",
            [log, "tip: `athermal evaluate model.json --data log.csv`"],
        ),
        (
            "evaluate log.csv model.json",
            [
                "model.json",
                "tip: `athermal evaluate model.json --data log.csv`",
            ],
        ),
        (
            "score model.json -d log.csv",
            [
                "score",
                "tip: `athermal evaluate model.json --data log.csv`",
            ],
        ),
        (
            "evaluate model.json --data log.csv model.json",
            [model, "name models before"],
        ),
        (
            "compare g.toml --data log.csv --on model.json",
            [model, "name models before"],
        ),
        (
            "init model.json",
            ["this is a model, which fit writes,", "give it a log"],
        ),
        (
            "init g.toml",
            ["this is a graph, which init writes,", "give it a log"],
        ),
        ("fit g.toml --data log.csv -o out", [folder, "--output"]),
        ("simulate die-tester -o out", [folder, "--output"]),
        (
            "report model.json --data log.csv -o out",
            [folder, "--output"],
        ),
        (
            "run model.json --input log.csv -o out",
            [folder, "--output"],
        ),
        ("init log.csv -o out", [folder, "--output"]),
        (
            "init log.csv -d Z1_nm",
            ["-d", "tip: `athermal init log.csv --drifts Z1_nm`"],
        ),
        (
            "init log.csv --data Z1_nm X1_nm --time time_s",
            [
                "--data",
                "tip: `athermal init log.csv --time time_s --drifts Z1_nm X1_nm`",
            ],
        ),
        ("init -d log.csv", ["-d", init]),
    ] {
        let told = refused(&scratch, call);
        assert!(!told.contains("similar subcommand"), "{call}: {told}");
        for part in parts {
            assert!(told.contains(part), "{call}: no `{part}` in\n{told}");
        }
    }
    let help = athermal(&[&"fit", &"--help"]).out;
    assert!(help.contains("-d, --data"), "{help}");
}
