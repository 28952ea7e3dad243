//! No estimator with its defaults is worse than no model: on any axis of any machine whose data are there.

#![allow(clippy::unwrap_used)]

mod workbench;

use std::path::Path;

use athermal::Model;
use athermal::core::fit::{FitOptions, Outcome, fit};
use athermal::core::node::{Kind, RoleName, kinds};
use athermal::core::score::{ScoreOptions, score};
use athermal::files::{Dataset, Options};
use workbench::{Scratch, data, graph};

/// Baselines themselves, and what predicts from predictions.
const LEFT_OUT: [&str; 3] = ["persistence", "stack", "zero"];

/// Kinds that take products of features or several of their past values: each sensor with the window in the middle alone.
const OF_FEW: [&str; 7] = [
    "arimax",
    "armax",
    "bj",
    "narx",
    "oe",
    "polynomial",
    "state_space",
];

struct Machine {
    /// A graph of this project that has `drift` and `gradients`; its other nodes are left out.
    graph: &'static str,
    nodes: &'static [&'static str],
    axes: &'static str,
    few: &'static str,
    train: &'static str,
    test: &'static str,
    ahead: &'static str,
    lags: &'static str,
    limit: Option<&'static str>,
}

const DIE_TESTER: Machine = Machine {
    graph: "die-tester",
    nodes: &["thermal", "motion", "both", "vote"],
    axes: "each = \"axis\"\ninputs.truth = \"drift.{axis}\"",
    few: "gradients.*@302.27s",
    train: "die-tester/train.csv",
    test: "die-tester/test.csv",
    ahead: "5min",
    lags: r#"["0s", "5min", "10min"]"#,
    limit: Some("250 nm/min"),
};

/// One node for each kind, with nothing but what it must be told.
fn text(machine: &Machine, kinds: &[&Kind]) -> String {
    let extended = graph(machine.graph);
    let mut text = format!(
        "schema = 1\nextends = {:?}\nname = \"defaults\"\n",
        extended
    );
    for node in machine.nodes {
        text += &format!("nodes.{node} = false\n");
    }
    for kind in kinds {
        let name = kind.name;
        text += &format!("[nodes.{name}]\ntype = \"{name}\"\n{}\n", machine.axes);
        text += &format!("ahead = \"{}\"\n", machine.ahead);
        if (kind.inputs)().iter().any(|port| port.name == "features") {
            let few = OF_FEW.contains(&name);
            let features = if few { machine.few } else { "gradients" };
            text += &format!("inputs.features = \"{features}\"\n");
        }
        let schema = serde_json::Value::from((kind.schema)());
        for required in schema["required"].as_array().into_iter().flatten() {
            assert_eq!(required, "lags", "`{name}` must be told something else");
            text += &format!("lags = {}\n", machine.lags);
        }
    }
    text += "[outputs]\n";
    for (nth, kind) in kinds.iter().enumerate() {
        // The output that every graph has is taken over.
        let output = if nth == 0 { "predicted" } else { kind.name };
        text += &format!("{output} = \"{}\"\n", kind.name);
    }
    text
}

fn estimators() -> Vec<&'static Kind> {
    kinds()
        .values()
        .flatten()
        .copied()
        .filter(|kind| kind.role == RoleName::Estimator && !LEFT_OUT.contains(&kind.name))
        .collect()
}

/// Each output that is worse than no model on data that it was not fitted on, and how much.
fn worse(machine: &Machine, folder: &Path) -> Vec<String> {
    let scratch = Scratch::new(&format!("defaults-{}-{}", machine.graph, machine.ahead));
    let kinds = estimators();
    let path = scratch.file("defaults.toml", text(machine, &kinds));
    let model = Model::load(path).unwrap_or_else(|error| panic!("{error}"));
    let recording = |file: &str| Dataset::new(vec![folder.join(file)], Options::default());
    let options = FitOptions::default();
    let train = recording(machine.train);
    let (fitted, report) = fit(&model.plan, &train, &options, &mut |_| {}).unwrap();
    for estimator in &report.estimators {
        let outcome = &estimator.outcome;
        assert!(matches!(outcome, Outcome::Fitted(_)), "{estimator:?}");
    }
    let options = ScoreOptions {
        abs_truth_below: machine.limit.map(|limit| limit.parse().unwrap()),
        ..ScoreOptions::default()
    };
    let test = recording(machine.test);
    let scores = score(&model.plan, &fitted, &test, &options, &mut |_| {}).unwrap();
    assert!(scores.scores.len() >= kinds.len());
    let told = scores.scores.iter().filter_map(|score| {
        let (rmse, none) = (score.rmse.unwrap(), score.baseline_zero.unwrap());
        eprintln!("{} {rmse:.2} against {none:.2}", score.output);
        (rmse >= none).then(|| format!("{}: {rmse:.2} against {none:.2}", score.output))
    });
    told.collect()
}

#[track_caller]
fn nothing_is_worse(machine: &Machine) {
    let Some(folder) = data() else { return };
    let found = worse(machine, &folder);
    assert!(
        found.is_empty(),
        "worse than no model:\n{}",
        found.join("\n")
    );
}

#[test]
fn no_default_is_worse_than_no_model_in_a_forecast_of_the_die_tester() {
    nothing_is_worse(&DIE_TESTER);
}

#[test]
fn no_default_is_worse_than_no_model_as_a_virtual_sensor_of_the_die_tester() {
    nothing_is_worse(&Machine {
        ahead: "0s",
        lags: r#"["5min", "10min", "15min"]"#,
        ..DIE_TESTER
    });
}

#[test]
fn no_default_is_worse_than_no_model_in_a_forecast_of_the_linear_axis() {
    nothing_is_worse(&Machine {
        graph: "linear-axis",
        train: "linear-axis/train.csv",
        test: "linear-axis/test.csv",
        ..DIE_TESTER
    });
}

#[test]
fn no_default_is_worse_than_no_model_on_a_printer() {
    nothing_is_worse(&Machine {
        graph: "z-probe",
        nodes: &["thermal"],
        axes: "inputs.truth = \"drift.z\"",
        few: "gradients.*@200s",
        train: "z-probe/GX-H12A.csv",
        test: "z-probe/GX-H12A-covered.csv",
        ahead: "0s",
        lags: r#"["99s", "198s"]"#,
        limit: None,
    });
}
