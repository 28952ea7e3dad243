//! The fitted model that a machine file names: what runs with its fits, what is told where the two are not of one graph, and what
//! does without it.

use std::path::PathBuf;

use crate::workbench::{Scratch, athermal};
use athermal::core::diagnostic::explain;

/// The codes of this page.
const CODES: [&str; 3] = ["A190", "A191", "A192"];

/// The graph of the pages, which names `machine.json`.
fn page() -> &'static str {
    explain("A191").unwrap().right
}

/// Rows a minute apart: two temperatures that wander, and a position that follows one of them.
fn rows(count: u32) -> String {
    let row = |nth: u32| {
        let minute = f64::from(nth);
        let (plate, room) = (25.0 + (minute / 40.0).sin(), 21.0 + (minute / 170.0).cos());
        let x = 300.0 * (minute / 40.0 - 0.3).sin() + 0.2 * f64::from(nth * nth % 11);
        format!("{},{plate:.4},{room:.4},{x:.2}\n", 60 * nth)
    };
    "time_s,plate,room,X\n".to_owned() + &(0..count).map(row).collect::<String>()
}

/// A scratch folder with the graph of the pages, data, and the model that it names, fitted on them: graph, data.
fn desk(test: &str) -> (Scratch, PathBuf, PathBuf) {
    let scratch = Scratch::new(&format!("named-{test}"));
    let graph = scratch.file("machine.toml", page());
    let data = scratch.file("data.csv", rows(400));
    let model = scratch.path("machine.json");
    athermal(&[&"fit", &graph, &"--data", &data, &"-o", &model, &"-q"]).ended(0);
    (scratch, graph, data)
}

#[test]
fn the_page_of_each_code_holds() {
    let (scratch, ..) = desk("pages");
    for code in CODES {
        let entry = explain(code).unwrap();
        athermal(&[
            &"check",
            &scratch.file("right.toml", entry.right),
            &"--strict",
        ])
        .ended(0);
        let wrong = scratch.file("wrong.toml", entry.wrong);
        let status = if code == "A192" { 1 } else { 2 };
        let checked = athermal(&[&"check", &wrong, &"--strict", &"--format", &"json"]);
        let told = checked.ended(status).json();
        let codes: Vec<_> = told["diagnostics"]
            .as_array()
            .unwrap()
            .iter()
            .map(|told| told["code"].as_str().unwrap().to_owned())
            .collect();
        assert_eq!(codes, [code], "{told:#}");
    }
}

#[test]
fn a_machine_file_gives_what_its_model_gives() {
    let (scratch, graph, data) = desk("alike");
    let model = scratch.path("machine.json");
    let rows = |graph: &PathBuf| athermal(&[&"run", graph, &"--input", &data]).ended(0).out;
    let of_model = rows(&model);
    assert!(of_model.lines().any(|line| !line.ends_with(',')));
    assert_eq!(rows(&graph), of_model);
    let scored = |graph: &PathBuf| {
        athermal(&[&"evaluate", graph, &"--data", &data, &"--format", &"json"])
            .ended(0)
            .json()["scores"]
            .clone()
    };
    assert!(scored(&model)[0]["rmse"].is_number(), "{}", scored(&model));
    assert_eq!(scored(&graph), scored(&model));
    let shown = |graph: &PathBuf| athermal(&[&"show", graph]).ended(0).out;
    assert!(shown(&model).contains("thermal"), "{}", shown(&model));
    assert_eq!(shown(&graph), shown(&model));
    athermal(&[&"diff", &graph, &model]).ended(0);
}

#[test]
fn a_machine_file_that_extends_the_fitted_graph_runs_and_paths_are_those_of_the_file() {
    let (scratch, _, data) = desk("extends");
    let plain = page().replace("model = \"machine.json\"", "");
    scratch.file("plain.toml", plain);
    std::fs::create_dir(scratch.path("line-3")).unwrap();
    let machine = scratch.file(
        "line-3/machine.toml",
        "schema = 1\nextends = \"../plain.toml\"\nmodel = \"../machine.json\"\n\
         [signals.temperature]\ncolumn = \"{channel}\"\n",
    );
    athermal(&[&"check", &machine, &"--strict"]).ended(0);
    let ran = athermal(&[&"run", &machine, &"--input", &data]).ended(0);
    assert!(ran.told.is_empty(), "{}", ran.told);
}

#[test]
fn what_is_read_in_another_way_is_told_alike_by_check_and_by_what_wants_more_of_the_graph() {
    let (scratch, _, data) = desk("doubt");
    let text = page().replace(
        "[nodes.thermal]",
        "[nodes.motion]\ntype = \"ar\"\ninputs.truth = \"drift\"\nahead = \"5min\"\nlags = [\"0s\"]\n[nodes.thermal]",
    ) + "motion = \"motion\"\n";
    let machine = scratch.file("machine.toml", &text);
    let model = scratch.path("machine.json");
    athermal(&[&"fit", &machine, &"--data", &data, &"-o", &model, &"-q"]).ended(0);
    let text = text.replace(
        "type = \"slope\"\ninputs.signal = \"temperature\"",
        "type = \"slope\"\nmin_samples = 4\ninputs.signal = \"temperature\"",
    );
    scratch.file("machine.toml", text);
    for told in [
        athermal(&[&"check", &machine]).ended(0),
        athermal(&[&"evaluate", &machine, &"--data", &data]).ended(0),
    ] {
        told.tells(&["warning[A192]", "`thermal` is as in the model"]);
        assert_eq!(told.told.matches("A192").count(), 1, "{}", told.told);
    }
}

#[test]
fn what_differs_from_the_fit_is_told_at_each_node_and_the_run_refused() {
    let (scratch, _, data) = desk("differs");
    let more = "[nodes.second]\ntype = \"linear\"\ninputs.features = \"gradients\"\n\
                inputs.truth = \"drift\"\nahead = \"5min\"\n[outputs]\n";
    let text = page()
        .replace("alpha = 1e-6", "alpha = 1e-4")
        .replace(
            "windows = [\"5min\"]\n\n[nodes.drift]",
            "windows = [\"5min\", \"10min\"]\n\n[nodes.drift]",
        )
        .replace("[outputs]\n", &(more.to_owned() + "second = \"second\"\n"));
    let machine = scratch.file("machine.toml", text);
    let path = machine.display();
    let model = scratch.path("machine.json");
    let checked = athermal(&[&"check", &machine]).ended(2);
    checked.tells(&[
        "error[A191]",
        &format!("`thermal` is not as in the model {}: ", model.display()),
        "`solver.alpha` is 0.0001, and was 1e-6 for the fit",
        "`inputs.features` has gradients.plate@300s, gradients.plate@600s, gradients.room@300s, gradients.room@600s, and had gradients.plate, gradients.room for the fit\n",
        "`second` is not as in the model",
        "there is none of that name",
        "the model that was fitted",
        &format!("`athermal fit {path} --data FILE -o {}`", model.display()),
        "2 errors",
    ]);
    let ran = athermal(&[&"run", &machine, &"--input", &data]).ended(2);
    assert_eq!(ran.told.matches("error[A191]").count(), 2, "{}", ran.told);
    // What is advised mends it.
    athermal(&[&"fit", &machine, &"--data", &data, &"-o", &model, &"-q"]).ended(0);
    athermal(&[&"check", &machine, &"--strict"]).ended(0);
}

#[test]
fn a_model_that_cannot_be_used_is_told_with_the_reason_and_what_fits_does_without_it() {
    let scratch = Scratch::new("named-unusable");
    let graph = scratch.file("machine.toml", page());
    let data = scratch.file("data.csv", rows(400));
    let told = |text: Option<&str>, reason: &str| {
        if let Some(text) = text {
            scratch.file("machine.json", text);
        }
        let model = scratch.path("machine.json");
        // A file that is there may be somebody's data, and is not to be written over.
        let advised = match text {
            None => model.display().to_string(),
            Some(_) => "MODEL.json".to_owned(),
        };
        for refused in [
            athermal(&[&"check", &graph]),
            athermal(&[&"run", &graph, &"--input", &data]),
            athermal(&[&"show", &graph]),
        ] {
            refused.ended(2).tells(&[
                "error[A190]",
                &format!("the model {} cannot be used: {reason}", model.display()),
                &format!(
                    "`athermal fit {} --data FILE -o {advised}`",
                    graph.display()
                ),
            ]);
        }
    };
    told(None, "there is no such file");
    told(Some("time_s,plate\n0,1\n"), "it is no fitted model");
    told(Some("{}"), "it is no fitted model");
    let newer = r#"{"athermal_model": 99, "card": null, "graph": {}, "fitted": {}}"#;
    told(
        Some(newer),
        "it was written by a later athermal, in format 99",
    );
    let foreign = r#"{"athermal_model": 1, "card": null, "graph": {"schema": 1, "nodes": {"a": {"type": "none"}}}, "fitted": {}}"#;
    told(Some(foreign), "of its graph, there is no node type");
    athermal(&[&"compare", &graph, &"--data", &data, &"--on", &data]).ended(0);
    athermal(&[&"diff", &graph, &graph]).ended(0);
    athermal(&[&"test", &graph]).ended(0);
    let model = scratch.path("machine.json");
    athermal(&[&"fit", &graph, &"--data", &data, &"-o", &model, &"-q"]).ended(0);
    athermal(&[&"check", &graph, &"--strict"]).ended(0);
    // Nor does the model look for the one that its own graph names.
    let moved = scratch.path("moved.json");
    std::fs::rename(&model, &moved).unwrap();
    athermal(&[&"run", &moved, &"--input", &data]).ended(0);
}

#[test]
fn a_model_that_names_its_own_graph_as_model_ends_as_any_that_is_none() {
    let scratch = Scratch::new("named-itself");
    let text = page().replace("machine.json", "machine.toml");
    let graph = scratch.file("machine.toml", text);
    athermal(&[&"check", &graph])
        .ended(2)
        .tells(&["error[A190]", "it is no fitted model"]);
}

#[test]
fn a_machine_file_in_another_unit_is_held_to_the_range_of_the_fit_in_its_own() {
    let (scratch, _, data) = desk("units");
    let log = std::fs::read_to_string(&data).unwrap();
    let in_fahrenheit = |warmer: f64| {
        let row = |line: &str| {
            let cells: Vec<&str> = line.split(',').collect();
            let of = |cell: &str| (cell.parse::<f64>().unwrap() + warmer) * 1.8 + 32.0;
            format!(
                "{},{},{},{}\n",
                cells[0],
                of(cells[1]),
                of(cells[2]),
                cells[3]
            )
        };
        let rows: String = log.lines().skip(1).map(row).collect();
        format!("time_s,plate,room,X\n{rows}")
    };
    let window = "windows = [\"5min\"]";
    let text = page().replacen(window, &format!("{window}\nunit = \"mK/min\""), 1);
    let graph = scratch.file("celsius.toml", &text);
    let model = scratch.path("machine.json");
    athermal(&[&"fit", &graph, &"--data", &data, &"-o", &model, &"-q"]).ended(0);
    let machine = scratch.file("fahrenheit.toml", text.replace("\"Cel\"", "\"[degF]\""));
    let told = |name: &str, warmer: f64| {
        let log = scratch.file(name, in_fahrenheit(warmer));
        athermal(&[&"evaluate", &machine, &"--data", &log])
            .ended(0)
            .told
    };
    let (same, warm) = (told("same.csv", 0.0), told("warm.csv", 60.0));
    assert!(!same.contains("in the data of the fit"), "{same}");
    assert!(warm.contains("in the data of the fit"), "{warm}");
}
