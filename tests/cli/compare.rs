//! Graphs side by side: what `athermal compare` says, what the zoo holds, and that no shipped graph does harm. Decides nothing of
//! how good a graph must be beyond that.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use crate::workbench::{Scratch, athermal, data, graph, graphs, simulated};
use athermal::Model;
use athermal::core::node::{NodeKind, RoleName};
use athermal::core::registry::all;
use athermal::diagnosis::comparison::{Comparison, Contender, compare};
use athermal::files::{Dataset, Options};
use athermal::run::fit::{FitOptions, Outcome, fit};
use athermal::run::score::trace;
use serde_json::Value;

/// A graph that puts out its truth in place of these outputs: all of its predictions are then scored on the instants that they have in
/// common, as `compare` does.
pub fn scored_together(scratch: &Scratch, graph: &Path, outputs: &[&str], truth: &str) -> PathBuf {
    let removed = outputs.iter().map(|of| format!("outputs.{of} = false\n"));
    let removed: String = removed.collect();
    let text = format!(
        "schema = 1\nextends = {graph:?}\ntests = []\n{removed}outputs.measured = \"{truth}\"\n"
    );
    scratch.file("together.toml", text)
}

/// Kinds that predict the same whatever was measured: baselines, which others are measured by.
const BASELINES: [&str; 2] = ["zero", "persistence"];

fn figure(rows: &Value, graph: &str, node: &str, column: usize) -> f64 {
    let mut rows = rows.as_array().unwrap().iter();
    let row = rows.find(|row| row["graph"] == graph && row["node"] == node);
    row.unwrap()["rmse"][column].as_f64().unwrap()
}

#[test]
fn graphs_are_fitted_on_one_recording_and_scored_on_common_instants_of_another() {
    let scratch = Scratch::new("compare");
    let train = simulated(&scratch, "train.csv", "die-tester", 2.0, 1);
    let test = simulated(&scratch, "test.csv", "die-tester", 1.0, 2);
    // Its longest window reaches back four times as far, so that it is valid later.
    let slow = scratch.file(
        "slow.toml",
        format!(
            "schema = 1\nextends = {:?}\nname = \"slow\"\nnodes.gradients = {{ windows = [\"5min\", \"90min\"] }}\n",
            graph("die-tester")
        ),
    );
    let both = athermal(&[
        &"compare",
        &graph("die-tester"),
        &slow,
        &"--data",
        &train,
        &"--on",
        &test,
        &"--format",
        &"json",
    ]);
    let both = both.ended(0).json();
    let table = &both["comparisons"][0];
    assert_eq!(table["truths"].as_array().unwrap().len(), 6);
    assert_eq!(table["rows"].as_array().unwrap().len(), 8);
    let alone = |graph: &Path| {
        let alone = athermal(&[
            &"compare",
            &graph,
            &"--data",
            &train,
            &"--on",
            &test,
            &"--format",
            &"json",
        ]);
        alone.ended(0).json()["comparisons"][0].clone()
    };
    let count = |table: &Value| table["truths"][2]["n"].as_u64().unwrap();
    let first = alone(&graph("die-tester"));
    assert_eq!(count(table), count(&alone(&slow)));
    assert!(
        count(table) + 40 < count(&first),
        "{} {}",
        count(table),
        count(&first)
    );
    // Alone, a graph's figures are those of `evaluate`.
    let model = scratch.path("model.json");
    let voters = scored_together(&scratch, &graph("die-tester"), &["predicted"], "drift");
    athermal(&[&"fit", &voters, &"--data", &train, &"-o", &model]).ended(0);
    let scores = athermal(&[&"evaluate", &model, &"--data", &test, &"--format", &"json"]);
    let scores = scores.ended(0).json();
    for score in scores["scores"].as_array().unwrap() {
        let axis = score["truth"].as_str().unwrap();
        let mut truths = first["truths"].as_array().unwrap().iter();
        let column = truths.position(|truth| truth["truth"] == axis).unwrap();
        let rmse = figure(
            &first["rows"],
            "die-tester",
            score["node"].as_str().unwrap(),
            column,
        );
        assert!((rmse / score["rmse"].as_f64().unwrap() - 1.0).abs() < 1e-12);
        let truth = &first["truths"][column];
        for key in ["baseline_zero", "baseline_persistence"] {
            let (here, there) = (truth[key].as_f64().unwrap(), score[key].as_f64().unwrap());
            assert!((here / there - 1.0).abs() < 1e-12);
        }
    }
    // The best is marked, once in each column.
    let text = athermal(&[
        &"compare",
        &graph("die-tester"),
        &slow,
        &"--data",
        &train,
        &"--on",
        &test,
    ]);
    let text = text.ended(0).out;
    assert_eq!(text.matches('*').count(), 1 + 6, "{text}");
    assert!(
        text.lines().all(|line| line.chars().count() <= 80),
        "{text}"
    );
    assert!(text.contains("slow was fitted in "), "{text}");
}

#[test]
fn a_graph_and_its_copy_differ_by_nothing_and_others_by_what_their_errors_vary() {
    let scratch = Scratch::new("compare-copy");
    let log = simulated(&scratch, "log.csv", "die-tester", 1.0, 1);
    let copy = scratch.file(
        "copy.toml",
        format!(
            "schema = 1\nextends = {:?}\nname = \"copy\"\n",
            graph("die-tester")
        ),
    );
    let compared = |format: &str| {
        athermal(&[
            &"compare",
            &graph("die-tester"),
            &copy,
            &"--data",
            &log,
            &"--on",
            &log,
            &"--format",
            &format,
        ])
        .ended(0)
    };
    let told = compared("json").json();
    let table = &told["comparisons"][0];
    let rows = table["rows"].as_array().unwrap();
    let (mut sure, mut zero) = (0, 0);
    for (column, truth) in table["truths"].as_array().unwrap().iter().enumerate() {
        let best = &rows[usize::try_from(truth["best"].as_u64().unwrap()).unwrap()];
        for row in rows {
            let error = row["difference_error"][column].as_f64().unwrap();
            let difference =
                row["rmse"][column].as_f64().unwrap() - best["rmse"][column].as_f64().unwrap();
            if row["node"] == best["node"] {
                assert_eq!((difference, error), (0.0, 0.0), "{row}");
                zero += 1;
            } else {
                assert!(difference > 0.0 && error > 0.0, "{row}");
                sure += usize::from(difference > 2.0 * error);
            }
        }
    }
    // Of six axes the best and its copy; of the three other voters of either graph some are surely worse.
    assert_eq!(zero, 12);
    assert!(sure > 6, "{sure}");
    let text = compared("table").out;
    assert_eq!(
        text.matches(" ±0\n").count() + text.matches(" ±0 ").count(),
        6,
        "{text}"
    );
    assert!(text.contains("~"), "{text}");
}

#[test]
fn what_is_seldom_valid_is_scored_on_its_own_instants_and_compared_with_none() {
    let scratch = Scratch::new("compare-seldom");
    let graph = scratch.file(
        "graph.toml",
        "schema = 1\n[time]\ncolumn = \"s\"\n[signals.out]\nunit = \"V\"\nchannels = [\"y\"]\ncolumn = \"{channel}\"\nmax_age = \"20s\"\n\
         [nodes.often]\ntype = \"ar\"\ninputs.truth = \"out.y\"\nahead = \"10s\"\nlags = [\"0s\"]\n\
         [nodes.seldom]\ntype = \"ar\"\ninputs.truth = \"out.y\"\nahead = \"10s\"\nlags = [\"700s\"]\n\
         [outputs]\noften = \"often\"\nseldom = \"seldom\"\n",
    );
    // Loud at first, where only one of them predicts, and then hardly at all.
    let rows: String = (0..100)
        .map(|nth| {
            let size = if nth < 75 { 5.0 } else { 0.1 };
            format!("{},{:.4}\n", 10 * nth, size * (0.8 * f64::from(nth)).sin())
        })
        .collect();
    let log = scratch.file("log.csv", format!("s,y\n{rows}"));
    let told = athermal(&[&"compare", &graph, &"--data", &log, &"--on", &log])
        .ended(0)
        .out;
    let line = |of: &str| told.lines().find(|line| line.contains(of)).unwrap();
    assert!(line("often (ar)").contains('*'), "{told}");
    assert!(!line("seldom (ar)").contains('*'), "{told}");
    assert!(line("seldom (ar)").contains(" @29"), "{told}");
    assert!(told.contains("compared with none"), "{told}");
}

#[test]
fn graphs_that_mean_something_else_by_a_truth_are_told() {
    let scratch = Scratch::new("compare-otherwise");
    let log = simulated(&scratch, "log.csv", "linear-axis", 0.5, 1);
    let other = scratch.file(
        "other.toml",
        format!(
            "schema = 1\nextends = {:?}\nname = \"other\"\n[nodes.half]\ntype = \"scale\"\ninputs.signal = \"position\"\nfactor = 0.5\n\
             [nodes.drift]\ninputs.signal = \"half\"\n",
            graph("linear-axis")
        ),
    );
    let compared = |second: &Path| {
        athermal(&[
            &"compare",
            &graph("linear-axis"),
            &second,
            &"--data",
            &log,
            &"--on",
            &log,
        ])
        .ended(0)
    };
    compared(&other).tells(&["of other has other values than that of linear-axis"]);
    let same = compared(&graph("linear-axis"));
    assert!(!same.told.contains("other values"), "{}", same.told);
}

#[test]
fn horizons_are_not_compared_with_each_other() {
    let scratch = Scratch::new("compare-horizons");
    let log = simulated(&scratch, "log.csv", "die-tester", 1.0, 1);
    let told = athermal(&[
        &"compare",
        &graph("die-tester"),
        &graph("die-tester-sensor"),
        &"--data",
        &log,
        &"--on",
        &log,
        &"--abs-truth-below",
        &"250 nm/min",
        &"--format",
        &"json",
    ]);
    let told = told.ended(0).json();
    let ahead: Vec<f64> = told["comparisons"]
        .as_array()
        .unwrap()
        .iter()
        .map(|table| table["ahead_s"].as_f64().unwrap())
        .collect();
    assert_eq!(ahead, [0.0, 300.0]);
    let limit = athermal(&[
        &"compare",
        &graph("die-tester"),
        &"--data",
        &log,
        &"--on",
        &log,
        &"--abs-truth-below",
        &"1 K",
    ]);
    limit.ended(2).tells(&["--abs-truth-below is in K"]);
}

#[test]
fn the_zoo_holds_every_estimator_and_every_combiner() {
    let zoo = Model::load(graph("zoo")).unwrap();
    let there: BTreeSet<&str> = zoo.plan.nodes.iter().map(|node| node.kind.name).collect();
    let all = all::<NodeKind>();
    let of_role = all.filter(|kind| matches!(kind.role, RoleName::Estimator | RoleName::Combiner));
    let missing: Vec<&str> = of_role
        .map(|kind| kind.name)
        .filter(|name| !there.contains(name))
        .collect();
    assert!(missing.is_empty(), "graphs/zoo.toml lacks {missing:?}");
}

/// Fits a shipped graph on one recording and compares it with no model on another.
fn compared(name: &str, train: &Path, test: &Path, below: Option<&str>) -> Vec<Comparison> {
    let mut model = Model::load(graph(name)).unwrap();
    let recording = |path: &Path| Dataset::new(vec![path.to_owned()], Options::default());
    let options = FitOptions::default();
    let (fitted, report) = fit(&model.plan, &recording(train), &options, &mut |_| {}).unwrap();
    for estimator in &report.estimators {
        assert!(
            matches!(estimator.outcome, Outcome::Fitted(_)),
            "{estimator:?}"
        );
    }
    model.fitted = fitted;
    let trace = trace(&model.plan, &model.fitted, &recording(test), &mut |_, _| {}).unwrap();
    let contender = Contender {
        name: name.to_owned(),
        plan: model.plan,
        trace,
    };
    compare(
        &[contender],
        below.map(|below| below.parse().unwrap()).as_ref(),
    )
}

#[test]
fn no_shipped_graph_is_worse_than_no_model_on_any_axis_of_any_recording() {
    let Some(data) = data() else { return };
    let die_tester = (
        "die-tester/train.csv",
        "die-tester/test.csv",
        Some("250 nm/min"),
    );
    let linear_axis = (
        "linear-axis/train.csv",
        "linear-axis/test.csv",
        Some("250 nm/min"),
    );
    let probe = |train, test| (train, test, None);
    let alone = |file| probe(file, file);
    let mut runs = Vec::new();
    // Others of these machines differ from the one graph in what they do beside predicting; the zoo takes as long as all else.
    let is_long = std::env::var_os("ATHERMAL_LONG").is_some();
    let is_shortest = |name: &str| {
        let of_machine = ["die-tester", "linear-axis"]
            .iter()
            .find(|machine| name.starts_with(**machine));
        name != "zoo" && of_machine.is_none_or(|machine| name == *machine)
    };
    for path in graphs("graphs") {
        let name = path.file_stem().unwrap().to_str().unwrap().to_owned();
        if !(is_long || is_shortest(&name)) {
            continue;
        }
        match &name {
            name if name == "zoo" || name.starts_with("die-tester") => {
                runs.push((name.clone(), die_tester))
            }
            name if name.starts_with("linear-axis") => runs.push((name.clone(), linear_axis)),
            name if name == "z-probe" => {
                for (train, test) in [
                    ("z-probe/GX-H12A.csv", "z-probe/GX-H12A-covered.csv"),
                    ("z-probe/GX-H12A-covered.csv", "z-probe/GX-H12A.csv"),
                    ("z-probe/superpinda.csv", "z-probe/superpinda-covered.csv"),
                    ("z-probe/superpinda-covered.csv", "z-probe/superpinda.csv"),
                ] {
                    runs.push((name.clone(), probe(train, test)));
                }
            }
            // One recording each; `evaluation_modes` fits on a part and lets the rest run free.
            name if name == "hairdryer" => {
                runs.push((name.clone(), alone("hairdryer/hairdryer.csv")))
            }
            name if name == "heating-system" => {
                runs.push((name.clone(), alone("heating-system/heating.csv")))
            }
            name if name == "wall-heatflow" => {
                runs.push((name.clone(), alone("wall-heatflow/wall.csv")))
            }
            name if name == "machine-temperature" => runs.push((
                name.clone(),
                alone("temperature-faults/nab_machine_temperature_system_failure.csv"),
            )),
            name if name == "ambient-temperature" => runs.push((
                name.clone(),
                alone("temperature-faults/nab_ambient_temperature_system_failure.csv"),
            )),
            name => panic!("no recording is named for graphs/{name}.toml"),
        }
    }
    let mut worse = Vec::new();
    let mut scored = 0;
    for (name, (train, test, below)) in &runs {
        for table in compared(name, &data.join(train), &data.join(test), *below) {
            for row in table
                .rows
                .iter()
                .filter(|row| !BASELINES.contains(&row.kind))
            {
                for (truth, rmse) in table.truths.iter().zip(&row.rmse) {
                    let (Some(rmse), Some(zero)) = (*rmse, truth.baseline_zero) else {
                        worse.push(format!("{name} {} {}: not scored", row.node, truth.name));
                        continue;
                    };
                    scored += 1;
                    if rmse > zero {
                        worse.push(format!(
                            "{name} on {test}: {}.{} {rmse} of {zero}",
                            row.node, truth.name
                        ));
                    }
                }
            }
        }
    }
    assert!(scored > if is_long { 150 } else { 30 }, "{scored}");
    assert!(worse.is_empty(), "{}", worse.join("\n"));
}

#[test]
fn several_predictions_of_a_node_for_one_truth_have_a_row_each() {
    let scratch = Scratch::new("compare-several");
    let log = simulated(&scratch, "log.csv", "die-tester", 0.5, 1);
    let text = format!(
        r#"schema = 1
extends = {:?}
name = "several"
tests = []
nodes.motion = false
nodes.both = false
nodes.vote = false
[sets]
sensor = ["room", "chuck"]
[nodes.side]
type = "linear"
each = ["sensor", "axis"]
inputs.features = "gradients.{{sensor}}@*"
inputs.truth = "drift.{{axis}}"
ahead = "5min"
[outputs]
thermal = "thermal"
predicted = "side"
"#,
        graph("die-tester")
    );
    let graph = scratch.file("several.toml", text);
    let model = scratch.path("model.json");
    let voters = scored_together(&scratch, &graph, &["thermal", "predicted"], "drift");
    athermal(&[&"fit", &voters, &"--data", &log, &"-o", &model]).ended(0);
    let scores = athermal(&[&"evaluate", &model, &"--data", &log, &"--format", &"json"]);
    let scores = scores.ended(0).json();
    let compared = |format: &str| {
        let of = ["compare", "--data", "--on", "--format"];
        athermal(&[&of[0], &graph, &of[1], &log, &of[2], &log, &of[3], &format]).ended(0)
    };
    let table = compared("json").json()["comparisons"][0].clone();
    let rows = table["rows"].as_array().unwrap();
    let of: Vec<_> = rows
        .iter()
        .map(|row| (row["node"].as_str(), row["channel"].as_str()))
        .collect();
    assert_eq!(
        of,
        [
            (Some("thermal"), None),
            (Some("side"), Some("room-*")),
            (Some("side"), Some("chuck-*"))
        ]
    );
    for (nth, truth) in table["truths"].as_array().unwrap().iter().enumerate() {
        for row in rows {
            let name = truth["name"].as_str().unwrap();
            let channel = row["channel"].as_str().unwrap_or("*").replace('*', name);
            let mut scores = scores["scores"].as_array().unwrap().iter();
            let output = format!("{}.{channel}", row["node"].as_str().unwrap());
            let score = scores.find(|of| of["output"] == *output);
            let (found, expected) = (&row["rmse"][nth], &score.unwrap()["rmse"]);
            assert!((found.as_f64().unwrap() / expected.as_f64().unwrap() - 1.0).abs() < 1e-12);
        }
    }
    let told = compared("table").out;
    assert!(told.contains("side.chuck-* (linear)"), "{told}");
}

#[test]
fn what_graphs_are_fitted_on_is_known_again_by_its_content() {
    let scratch = Scratch::new("compare-same-file");
    let log = simulated(&scratch, "log.csv", "die-tester", 0.2, 1);
    let copy = scratch.file("copy.csv", std::fs::read(&log).unwrap());
    let other = simulated(&scratch, "other.csv", "die-tester", 0.2, 2);
    let same = scratch.path("../compare-same-file/log.csv");
    let compared = |on: &Path| {
        let graph = graph("die-tester");
        athermal(&[&"compare", &graph, &"--data", &log, &"--on", &on]).ended(0)
    };
    for on in [&log, &same, &copy] {
        compared(on).tells(&["the graphs are fitted on this file and scored on it"]);
    }
    assert!(!compared(&other).told.contains("the graphs are fitted on"));
}
