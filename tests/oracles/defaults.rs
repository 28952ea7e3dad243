//! No estimator or combiner with its defaults is worse than no model: on any axis of any data set that is there. A printer is
//! fitted on a probe and tested on the same probe, covered; two more probes have no such recording. Some kinds see one window of
//! each sensor, and on the printers all of them too. Of the die tester's six axes, two are looked at; `ATHERMAL_LONG=1` looks at all.
//!
//! What does not hold: from one sort of probe to another nearly every kind is worse on some pair, least squares too. Probes differ
//! in how they answer to heat.

use std::path::{Path, PathBuf};

use crate::workbench::{Scratch, data, graph};
use athermal::Model;
use athermal::core::node::{Kind, NodeKind, RoleName};
use athermal::core::registry::all;
use athermal::files::{Dataset, Options};
use athermal::run::fit::{FitOptions, Outcome, fit};
use athermal::run::score::{ScoreOptions, score};

/// Baselines themselves, and what goes by states whose limits have no default.
const LEFT_OUT: [&str; 3] = ["persistence", "state_gate", "zero"];

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

#[derive(Clone, Copy)]
enum Recorded {
    /// One recording is fitted on, another is scored on.
    Apart {
        train: &'static str,
        test: &'static str,
    },
    /// So many rows of one recording are fitted on, the rest is scored on.
    Parted { file: &'static str, rows: usize },
}

#[derive(Clone, Copy)]
struct Machine {
    /// A graph of this project; of its nodes only those for features and truths are taken over.
    graph: &'static str,
    nodes: &'static [&'static str],
    outputs: &'static [&'static str],
    axes: &'static str,
    /// References with a comma between them, and fewer of them.
    features: &'static str,
    few: &'static str,
    recorded: Recorded,
    ahead: &'static str,
    lags: &'static str,
    memory: &'static str,
    limit: Option<&'static str>,
    /// Kinds that are made of the features of one instant alone, where the truth is a level that follows them late: they are left out.
    instant: &'static [&'static str],
}

const DIE_TESTER: Machine = Machine {
    graph: "die-tester",
    nodes: &["thermal", "motion", "both", "vote"],
    outputs: &["predicted"],
    axes: "each = \"axis\"\ninputs.truth = \"drift.{axis}\"",
    features: "gradients",
    few: "gradients.*@302.27s",
    recorded: Recorded::Apart {
        train: "die-tester/train.csv",
        test: "die-tester/test.csv",
    },
    ahead: "5min",
    lags: r#"["0s", "5min", "10min"]"#,
    memory: "1h",
    limit: Some("250 nm/min"),
    instant: &[],
};

const PRINTER: Machine = Machine {
    graph: "z-probe",
    nodes: &["thermal"],
    axes: "inputs.truth = \"drift.z\"",
    few: "gradients.*@200s",
    recorded: Recorded::Apart {
        train: "z-probe/GX-H12A.csv",
        test: "z-probe/GX-H12A-covered.csv",
    },
    ahead: "0s",
    lags: r#"["99s", "198s"]"#,
    memory: "10min",
    limit: None,
    ..DIE_TESTER
};

/// Three voters that see different things, for what combines them.
const VOTERS: [&str; 3] = ["linear", "ar", "arx"];

fn node_of(kind: &str, machine: &Machine) -> String {
    let axis = if machine.axes.contains("{axis}") {
        ".{axis}"
    } else if machine.axes.contains("{place}") {
        ".{place}"
    } else {
        ""
    };
    format!("default-{kind}{axis}")
}

/// One node for each kind, with nothing but what it must be told.
fn text(machine: &Machine, kinds: &[&Kind]) -> String {
    let extended = graph(machine.graph);
    let mut text = format!("schema = 1\nextends = {extended:?}\nname = \"defaults\"\n");
    if machine.graph == "die-tester" && std::env::var_os("ATHERMAL_LONG").is_none() {
        // One that barely moves, and one that moves far; the other four are like them.
        text += "sets.axis = [\"X1\", \"Z2\"]\ntests = []\n";
    }
    for node in machine.nodes {
        text += &format!("nodes.{node} = false\n");
    }
    for kind in kinds {
        text += &node(machine, kind);
    }
    text += "[outputs]\n";
    // The outputs that a graph has are taken over; the others are scored on the instants that they have in common.
    for (name, kind) in machine.outputs.iter().zip(kinds) {
        text += &format!("{name} = \"default-{}\"\n", kind.name);
    }
    text
}

fn node(machine: &Machine, kind: &Kind) -> String {
    let name = kind.name;
    let mut text = format!("[nodes.default-{name}]\ntype = \"{name}\"\n");
    let has = |name: &str| (kind.inputs)().iter().any(|port| port.name == name);
    for line in machine.axes.lines() {
        if has("truth") || !line.contains("inputs.truth") {
            text += &format!("{line}\n");
        }
    }
    if kind.role == RoleName::Estimator {
        text += &format!("ahead = \"{}\"\n", machine.ahead);
    }
    if has("features") {
        let few = OF_FEW.contains(&name);
        let features = if few { machine.few } else { machine.features };
        let features: Vec<&str> = features.split(", ").collect();
        text += &format!("inputs.features = {features:?}\n");
    }
    if has("voters") {
        let voters = VOTERS.map(|voter| node_of(voter, machine));
        text += &format!("inputs.voters = {voters:?}\n");
    }
    if has("prediction") {
        text += &format!("inputs.prediction = {:?}\n", node_of("linear", machine));
    }
    let schema = (kind.schema)();
    for required in schema["required"].as_array().into_iter().flatten() {
        match required.as_str().unwrap() {
            "lags" => text += &format!("lags = {}\n", machine.lags),
            "memory" => text += &format!("memory = \"{}\"\n", machine.memory),
            other => panic!("`{name}` must be told `{other}` too"),
        }
    }
    text
}

fn with_defaults() -> Vec<&'static Kind> {
    let predicts = |kind: &&Kind| matches!(kind.role, RoleName::Estimator | RoleName::Combiner);
    all::<NodeKind>()
        .filter(|kind| predicts(kind) && !LEFT_OUT.contains(&kind.name))
        .collect()
}

/// The file to fit on and the one to score on.
fn recordings(recorded: Recorded, folder: &Path, scratch: &Scratch) -> [PathBuf; 2] {
    let (file, first) = match recorded {
        Recorded::Apart { train, test } => return [train, test].map(|file| folder.join(file)),
        Recorded::Parted { file, rows } => (file, rows),
    };
    let text = std::fs::read_to_string(folder.join(file)).unwrap();
    let (header, rows) = text.split_once('\n').unwrap();
    let rows: Vec<&str> = rows.lines().collect();
    let (before, after) = rows.split_at(first);
    [("train.csv", before), ("test.csv", after)]
        .map(|(name, rows)| scratch.file(name, format!("{header}\n{}\n", rows.join("\n"))))
}

/// The least share of the rows in which there is a truth that must be predicted.
const LEAST: f64 = 0.8;

/// Each output that is worse than no model on data that it was not fitted on, and how much, or that is mostly absent.
fn worse(machine: &Machine, kinds: &[&Kind], folder: &Path) -> Vec<String> {
    let (Recorded::Apart { train: file, .. } | Recorded::Parted { file, .. }) = machine.recorded;
    let name = Path::new(file).file_stem().unwrap().display();
    let scratch = Scratch::new(&format!(
        "defaults-{}-{name}-{}-{}",
        machine.graph,
        machine.ahead,
        kinds.len()
    ));
    let path = scratch.file("defaults.toml", text(machine, kinds));
    let model = Model::load(path).unwrap_or_else(|error| panic!("{error}"));
    let [train, test] = recordings(machine.recorded, folder, &scratch)
        .map(|file| Dataset::new(vec![file], Options::default()));
    let options = FitOptions::default();
    let (fitted, report) = fit(&model.plan, &train, &options, &mut |_| {}).unwrap();
    for estimator in &report.estimators {
        let outcome = &estimator.outcome;
        assert!(matches!(outcome, Outcome::Fitted(_)), "{estimator:?}");
    }
    let options = ScoreOptions {
        abs_truth_below: machine.limit.map(|limit| limit.parse().unwrap()),
        ..ScoreOptions::default()
    };
    let scores = score(&model.plan, &fitted, &test, &options, &mut |_| {}).unwrap();
    assert!(scores.scores.len() >= kinds.len());
    let told = scores.scores.iter().filter_map(|score| {
        let (rmse, none) = (score.rmse.unwrap(), score.baseline_zero.unwrap());
        let (output, valid) = (&score.output, score.valid.unwrap());
        eprintln!("{output} {rmse:.3} against {none:.3}, valid {valid:.3}");
        let mut instant = machine.instant.iter();
        let is_instant =
            instant.any(|kind| output.split('.').next() == Some(&*node_of(kind, machine)));
        let worse = rmse >= none && !is_instant || valid < LEAST;
        worse.then(|| format!("{output}: {rmse:.3} against {none:.3}, in {valid:.3} of the rows"))
    });
    told.collect()
}

#[track_caller]
fn none_is_worse(machine: &Machine, kinds: &[&Kind]) {
    let Some(folder) = data() else { return };
    let found = worse(machine, kinds, &folder);
    assert!(
        found.is_empty(),
        "worse than no model:\n{}",
        found.join("\n")
    );
}

#[track_caller]
fn nothing_is_worse(machine: &Machine) {
    none_is_worse(machine, &with_defaults());
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
        recorded: Recorded::Apart {
            train: "linear-axis/train.csv",
            test: "linear-axis/test.csv",
        },
        ..DIE_TESTER
    });
}

#[test]
fn no_default_is_worse_than_no_model_on_a_printer() {
    nothing_is_worse(&PRINTER);
}

const OTHER_PRINTER: Machine = Machine {
    recorded: Recorded::Apart {
        train: "z-probe/superpinda.csv",
        test: "z-probe/superpinda-covered.csv",
    },
    ..PRINTER
};

#[test]
fn no_default_is_worse_than_no_model_on_another_printer() {
    nothing_is_worse(&OTHER_PRINTER);
}

/// All features, for the kinds that are given few of them elsewhere.
#[track_caller]
fn all_features_are_not_worse(machine: &Machine, features: &'static str) {
    let mut kinds = with_defaults();
    kinds.retain(|kind| OF_FEW.contains(&kind.name));
    assert_eq!(kinds.len(), OF_FEW.len());
    let all = Machine {
        few: features,
        ..*machine
    };
    none_is_worse(&all, &kinds);
}

#[test]
fn all_features_of_a_printer_are_not_worse_than_no_model_either() {
    all_features_are_not_worse(&PRINTER, PRINTER.features);
}

#[test]
fn all_features_of_another_printer_are_not_worse_than_no_model_either() {
    all_features_are_not_worse(&OTHER_PRINTER, OTHER_PRINTER.features);
}

#[test]
fn no_default_is_worse_than_no_model_on_a_dryer() {
    nothing_is_worse(&Machine {
        graph: "hairdryer",
        nodes: &["arx", "states", "output_error", "armax", "box_jenkins"],
        outputs: &[
            "predicted",
            "output_error",
            "armax",
            "box_jenkins",
            "states",
        ],
        axes: "inputs.truth = \"outlet.air\"",
        features: "heater",
        few: "heater",
        recorded: Recorded::Parted {
            file: "hairdryer/hairdryer.csv",
            rows: 500,
        },
        ahead: "0 samples",
        lags: r#"["1 sample", "2 samples"]"#,
        memory: "20 samples",
        limit: None,
        instant: &[],
    });
}

#[test]
fn no_default_is_worse_than_no_model_on_a_wall() {
    nothing_is_worse(&Machine {
        graph: "wall-heatflow",
        nodes: &["arx", "states", "output_error"],
        outputs: &["predicted", "arx", "states"],
        axes: "inputs.truth = \"heatflow.y\"",
        features: "wall",
        few: "wall",
        recorded: Recorded::Parted {
            file: "wall-heatflow/wall.csv",
            rows: 1176,
        },
        ahead: "0 samples",
        lags: r#"["1 sample", "2 samples"]"#,
        memory: "48 samples",
        limit: None,
        instant: &[],
    });
}

#[test]
fn no_default_is_worse_than_no_model_on_a_lamp_and_a_plate() {
    nothing_is_worse(&Machine {
        graph: "heating-system",
        nodes: &["arx", "states", "output_error"],
        outputs: &["predicted", "arx", "states"],
        axes: "inputs.truth = \"plate.temperature\"",
        features: "lamp",
        few: "lamp",
        recorded: Recorded::Parted {
            file: "heating-system/heating.csv",
            rows: 560,
        },
        ahead: "0s",
        lags: r#"["2s", "4s"]"#,
        memory: "1min",
        limit: None,
        // The plate needs minutes to follow its lamp, and its mean over the fit is near.
        instant: &[
            "elastic_net",
            "huber",
            "lasso",
            "linear",
            "conformal",
            "fallback",
            "polynomial",
            "rls",
        ],
    });
}

const OFFICE: Machine = Machine {
    graph: "ambient-temperature",
    nodes: &["motion", "both", "guarded"],
    axes: "each = \"place\"\ninputs.truth = \"drift.{place}\"",
    few: "gradients",
    recorded: Recorded::Parted {
        file: "temperature-faults/nab_ambient_temperature_system_failure.csv",
        rows: 3633,
    },
    ahead: "3h",
    lags: r#"["0s", "3h"]"#,
    memory: "36h",
    limit: None,
    ..DIE_TESTER
};

#[test]
fn no_default_is_worse_than_no_model_in_an_office_whose_records_have_gaps_of_days() {
    nothing_is_worse(&OFFICE);
}

const FAILING: Machine = Machine {
    graph: "machine-temperature",
    few: "gradients.*@3600s",
    recorded: Recorded::Parted {
        file: "temperature-faults/nab_machine_temperature_system_failure.csv",
        rows: 11348,
    },
    ahead: "30min",
    lags: r#"["0s", "30min"]"#,
    memory: "6h",
    ..OFFICE
};

#[test]
fn no_default_is_worse_than_no_model_on_a_machine_that_fails_now_and_then() {
    nothing_is_worse(&FAILING);
}

#[test]
fn neither_is_one_that_has_the_truth_itself_among_its_features() {
    all_features_are_not_worse(&FAILING, "gradients, drift");
}
