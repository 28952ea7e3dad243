//! What people are told, programs are told too.

use std::ffi::OsStr;

use serde_json::{Value, json};

use super::{csv, desk, rows};
use crate::workbench::{Scratch, athermal};

#[test]
fn the_counts_of_a_graph_are_told_to_programs_too() {
    let (scratch, plain, _, _) = desk("counts");
    let wrong = scratch.file("wrong.toml", "schema = 1\nnodes.a = { type = \"slop\" }\n");
    let told = athermal(&[&"check", &plain, &wrong, &"--format", &"json"])
        .ended(2)
        .json();
    let of_plain = json!({
        "file": plain.display().to_string(),
        "channels": 2,
        "nodes": 2,
        "instances": 2,
        "outputs": 3,
    });
    assert_eq!(told["graphs"], json!([of_plain]));
    assert!(!told["diagnostics"].as_array().unwrap().is_empty());
}

#[test]
fn what_was_simulated_is_told_to_programs_too() {
    let scratch = Scratch::new("command-line-simulated");
    let output = scratch.path("axis.csv");
    let call: [&dyn AsRef<OsStr>; 10] = [
        &"simulate",
        &"linear-axis",
        &"--days",
        &"0.01",
        &"--seed",
        &"3",
        &"-o",
        &output,
        &"--format",
        &"json",
    ];
    let told = athermal(&call).ended(0).json();
    let lines = std::fs::read_to_string(&output).unwrap().lines().count();
    let expected = json!({
        "output": output, "rows": lines - 1, "machine": "linear-axis", "days": 0.01, "seed": 3,
        "spread": 0.0, "machine_seed": 1,
    });
    assert_eq!(told, expected);
}

#[test]
fn the_signal_to_noise_by_which_init_chooses_is_told_to_programs() {
    let scratch = Scratch::new("command-line-init-facts");
    let (log, graph) = (scratch.path("axis.csv"), scratch.path("graph.toml"));
    athermal(&[&"simulate", &"linear-axis", &"--days", &"0.5", &"-o", &log]).ended(0);
    let told = athermal(&[&"init", &log, &"-o", &graph, &"--format", &"json"])
        .ended(0)
        .json();
    let columns = told["columns"].as_array().unwrap();
    let named = |taken_as: &str| -> Vec<&str> {
        let of = columns.iter().filter(|of| of["taken_as"] == taken_as);
        of.map(|of| of["column"].as_str().unwrap()).collect()
    };
    assert_eq!(named("drifting"), ["X_nm", "Y_nm", "Z_nm"]);
    assert_eq!(named("temperature").len(), 4);
    let windows = told["windows"].as_array().unwrap();
    assert_eq!(windows.len(), 3);
    let text = std::fs::read_to_string(&graph).unwrap();
    for of in windows {
        let widths = of["widths"].as_array().unwrap();
        let chosen = widths
            .iter()
            .find(|width| width["window_s"] == of["window_s"]);
        let chosen = chosen.unwrap()["ratio"].as_f64().unwrap();
        // The remark, and the graph's comment, have the same to one digit.
        let remark = format!("{} {chosen:.1}", of["column"].as_str().unwrap());
        let remarks = told["remarks"].to_string();
        assert!(remarks.contains(&remark), "{remark} is not in {remarks}");
        assert!(widths.len() > 3 && !text.is_empty());
    }
}

/// The key of a command's facts at which it tells what is doubtful in the data that it was given.
fn at<'a>(command: &str, told: &'a Value) -> &'a Value {
    match command {
        "compare" => &told["graphs"][0],
        _ => told,
    }
}

#[test]
fn what_is_doubtful_in_data_has_one_name_and_one_shape_in_all_commands() {
    let (scratch, _, _, model) = desk("doubtful");
    let fitted = scratch.path("fitted.toml");
    let data = scratch.file("long.csv", csv(&rows(0, 600)));
    // The sensor goes on from where it was, after half an hour at one value and one at no value; another log is in another unit.
    let odd = rows(0, 600).into_iter().enumerate().map(|(nth, row)| {
        let mut cells: Vec<String> = row.split(',').map(str::to_owned).collect();
        match nth {
            100..300 => cells[1] = "30.500".to_owned(),
            400..500 => cells[1] = String::new(),
            550 => cells[1] = "180.000".to_owned(),
            _ => {}
        }
        cells.join(",")
    });
    let odd = scratch.file("odd.csv", csv(&odd.collect::<Vec<_>>()));
    let ask = |command: &'static str| {
        let call: Vec<&dyn AsRef<OsStr>> = match command {
            "compare" => vec![&"compare", &fitted, &"--data", &data, &"--on", &odd],
            "diagnose" => vec![&"diagnose", &model, &"--no-fit", &"--data", &odd],
            _ => vec![&command, &model, &"--data", &odd],
        };
        let call = [&call[..], &[&"--format", &"json"]].concat();
        athermal(&call).ended(0).json()
    };
    let evaluated = ask("evaluate");
    for key in ["stuck", "silent", "leaps"] {
        let found = &evaluated[key][0];
        assert_eq!(found["channel"], "temperature.room", "{key}");
        for command in ["compare", "diagnose", "report"] {
            assert_eq!(at(command, &ask(command))[key], evaluated[key], "{command}");
        }
    }
    assert_eq!(evaluated["outside_fit"][0]["channel"], "temperature.room");
    for command in ["diagnose", "report"] {
        assert_eq!(
            ask(command)["outside_fit"],
            evaluated["outside_fit"],
            "{command}"
        );
    }
    // Fitted on the longer log, only the leap of the sensor is outside.
    let compared = ask("compare");
    assert_eq!(at("compare", &compared)["outside_fit"][0]["highest"], 180.0);
    assert!(compared["graphs"][0].get("in_fit").is_none(), "{compared}");
    let call: [&dyn AsRef<OsStr>; 8] = [
        &"compare",
        &fitted,
        &"--data",
        &odd,
        &"--on",
        &data,
        &"--format",
        &"json",
    ];
    let compared = athermal(&call).ended(0).json();
    assert_eq!(compared["graphs"][0]["in_fit"]["stuck"], evaluated["stuck"]);
    assert!(compared["graphs"][0].get("stuck").is_none(), "{compared}");
}

#[test]
fn a_graph_that_does_not_suit_the_log_is_named_beside_what_it_lacks() {
    let (scratch, _, data, _) = desk("unsuited");
    let fitted = scratch.path("fitted.toml");
    let text = std::fs::read_to_string(&fitted).unwrap();
    let other = scratch.file("other.toml", text.replace("\"room\"", "\"hall\""));
    let call: [&dyn AsRef<OsStr>; 7] = [
        &"compare", &fitted, &other, &"--data", &data, &"--on", &data,
    ];
    let told = athermal(&call).ended(2);
    told.tells(&[&format!("for the graph {}: ", other.display()), "`hall`"]);
}
