//! Requests that cannot be met as they stand, told before anything is done; and what is told once for all that was asked.

use std::collections::BTreeMap;

use serde_json::Value;

use super::{csv, desk, rows};
use crate::workbench::{Scratch, athermal, athermal_on};

#[test]
fn options_that_need_another_are_refused_without_it() {
    let (scratch, plain, data, model) = desk("requests");
    let log = scratch.path("log.csv");
    for (more, lacking) in [
        (["--shadow", "1h"], "--swap-at"),
        (["--margin", "5%"], "--shadow"),
    ] {
        let run = athermal(&[&"run", &plain, &"--input", &data, &more[0], &more[1]]);
        run.ended(2).tells(&["required", lacking]);
    }
    let simulate = athermal(&[&"simulate", &"-o", &log, &"--days", &"3"]);
    simulate.ended(2).tells(&["required", "<MACHINE>"]);
    assert!(!log.exists());
    athermal_on("evaluate", &model, &data, &[&"--mode", &"k-step"])
        .ended(2)
        .tells(&["--mode k-step needs the number of steps: `--steps 3`"]);
    athermal_on(
        "report",
        &model,
        &data,
        &[&"-o", &"-", &"--format", &"json"],
    )
    .ended(2)
    .tells(&["cannot both go to standard output"]);
    athermal(&[&"run", &plain, &"--input", &data, &"--swap-at", &"6h="])
        .ended(2)
        .tells(&["--swap-at takes TIME=GRAPH"]);
}

#[test]
fn a_log_in_the_place_of_a_model_is_refused_by_its_beginning() {
    let (scratch, _, data, _) = desk("swapped");
    // What comes after is no text, and would be told instead if it were read.
    let mut log = std::fs::read(&data).unwrap();
    log.extend([0xff; 20_000]);
    // Its name does not show what it is.
    let log = scratch.file("odd", log);
    athermal_on("evaluate", &log, &data, &[])
        .ended(2)
        .tells(&["odd", "no model"]);
}

#[test]
fn a_limit_in_a_unit_of_something_else_is_refused() {
    let (_scratch, _, data, model) = desk("limit");
    let limited = |limit: &str| {
        athermal(&[
            &"evaluate",
            &model,
            &"--data",
            &data,
            &"--abs-truth-below",
            &limit,
        ])
    };
    limited("250 nm/min")
        .ended(2)
        .tells(&["nm/min", "position.Z"]);
    limited("250").ended(2);
    limited("0.203 um").ended(0);
}

#[test]
fn a_limit_below_which_no_truth_lies_is_refused() {
    let (_scratch, _, data, model) = desk("no-limit");
    for limit in ["0 nm", "-5 nm"] {
        athermal_on("evaluate", &model, &data, &[&"--abs-truth-below", &limit])
            .ended(2)
            .tells(&["no truth is below that"]);
    }
}

#[test]
fn what_is_doubtful_in_data_or_a_graph_is_told_once_by_each_command_that_takes_it() {
    let (scratch, ..) = desk("doubts");
    let unused = "schema = 1\nextends = \"fitted.toml\"\nnodes.unused = { type = \"slope\", inputs.signal = \"temperature\", windows = [\"30s\"] }\n\
                  signals.temperature = { range = [\"20.5 Cel\", \"200 Cel\"] }\n";
    let (one, two) = (
        scratch.file("one.toml", unused),
        scratch.file("two.toml", unused),
    );
    let data = scratch.path("data.csv");
    let compared = athermal(&[&"compare", &one, &two, &"--data", &data, &"--on", &data]);
    let told = compared.ended(0).told;
    let times = told.matches("samples are infinite or out of range").count();
    assert_eq!(times, 1, "{told}");
    athermal(&[&"show", &one]).ended(0).tells(&["A059"]);
    athermal(&[&"diff", &one, &two]).ended(0).tells(&["A059"]);
}

#[test]
fn persistence_of_several_horizons_is_told_for_each() {
    let scratch: Scratch = desk("horizons").0;
    let graph = "schema = 1\nextends = \"plain.toml\"\nnodes.later = { type = \"persistence\", inputs.truth = \"drift.Z\", ahead = \"2min\" }\n\
                 outputs.later = \"later\"\n";
    let graph = scratch.file("later.toml", graph);
    let data = scratch.file("more.csv", csv(&rows(0, 200)));
    let scores = athermal_on("evaluate", &graph, &data, &[]).ended(0);
    let scored = athermal_on("evaluate", &graph, &data, &[&"--format", &"json"]).ended(0);
    let scored = scored.json();
    let mut lines = scores.out.lines();
    let heading = lines.find(|line| line.contains("persistence")).unwrap();
    assert!(heading.contains(" at 30s and "), "{heading}");
    assert!(heading.contains(" at 2min"), "{heading}");
    let of = |row: usize| scored["scores"][row]["baseline_persistence"].as_f64();
    assert_ne!(of(0), of(1));
}

/// What the page of a node says of its output ports, by name.
fn ports(kind: &str) -> BTreeMap<String, String> {
    let told = athermal(&[&"nodes", &kind, &"--format", &"json"]).ended(0);
    let told = told.json();
    let text = |port: &Value, key: &str| port[key].as_str().unwrap().to_owned();
    let ports = told["outputs"].as_array().unwrap().iter();
    ports
        .map(|port| (text(port, "name"), text(port, "summary")))
        .collect()
}

#[test]
fn the_page_of_a_node_names_the_output_ports_that_it_has() {
    for (kind, expected) in [
        ("rls", &["learning", "novelty", "prediction", "std_dev"][..]),
        (
            "auto_weighted",
            &["novelty", "prediction", "std_dev", "weights"],
        ),
        (
            "guard",
            &["novelty", "prediction", "reason", "std_dev", "weights"],
        ),
        ("conformal", &["lower", "prediction", "upper"]),
        ("narx", &["novelty", "prediction"]),
    ] {
        let ports = ports(kind);
        assert_eq!(ports.keys().collect::<Vec<_>>(), expected, "{kind}");
        let always = |what: &String| !what.contains("not with all parameters");
        assert!(ports.values().all(always), "{kind}");
    }
    // With stochastic gradients it goes on learning, and does not tell how sure it is.
    let ports = ports("linear");
    assert!(ports.contains_key("novelty"));
    for port in ["learning", "std_dev"] {
        assert!(
            ports[port].ends_with(" (not with all parameters)"),
            "{port}"
        );
    }
}

#[test]
fn the_choices_of_a_list_are_told_too() {
    let page = athermal(&[&"nodes", &"compensate"]).ended(0).out;
    assert!(page.contains("\"quasi_stable\""), "{page}");
}

#[test]
fn a_file_that_is_not_there_ends_with_the_same_status_whatever_it_was_to_be() {
    let (scratch, plain, data, model) = desk("not-there");
    let [graph, fitted, log] = ["no.toml", "no.json", "no.csv"].map(|name| scratch.path(name));
    for gone in [&graph, &fitted] {
        for command in ["show", "check", "test"] {
            athermal(&[&command, gone]).ended(3).tells(&["no."]);
        }
        athermal_on("evaluate", gone, &data, &[]).ended(3);
        athermal(&[&"run", gone, &"--input", &data]).ended(3);
        let swap = format!("60={}", gone.display());
        athermal(&[&"run", &plain, &"--input", &data, &"--swap-at", &swap]).ended(3);
    }
    athermal_on("fit", &graph, &data, &[&"-o", &scratch.path("m.json")]).ended(3);
    athermal_on("evaluate", &model, &log, &[]).ended(3);
    athermal(&[&"run", &plain, &"--input", &log]).ended(3);
    // What is wrong in a file that can be read is another matter, even where it names one that cannot be.
    let text = format!("schema = 1\nextends = {graph:?}\n");
    let extending = scratch.file("extending.toml", text);
    athermal(&[&"check", &extending])
        .ended(2)
        .tells(&["error[A002]"]);
    athermal(&[&"check", &graph, &extending]).ended(2);
}
