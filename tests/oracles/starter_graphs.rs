//! The starter graph of every log in the shared data: it checks, fits and evaluates as it is.

use std::path::Path;

use crate::workbench::{Scratch, athermal, athermal_on, data};

/// Writes a starter graph for one log, fits it, and scores it on another: (RMSE of the forecast, without a model) per axis.
fn scored(train: &Path, test: &Path) -> Vec<(f64, f64)> {
    let scratch = Scratch::new("starter-graph");
    let (graph, model) = (scratch.path("graph.toml"), scratch.path("model.json"));
    athermal(&[&"init", &train, &"-o", &graph]).ended(0);
    athermal(&[&"check", &"--strict", &graph]).ended(0);
    athermal_on("fit", &graph, train, &[&"-o", &model]).ended(0);
    let facts = athermal_on("evaluate", &model, test, &[&"--format", &"json"]).json();
    let votes = facts["scores"].as_array().unwrap().iter();
    votes
        .filter(|score| score["node"] == "next/result")
        .map(|score| {
            let figure = |name: &str| score[name].as_f64().unwrap();
            (figure("rmse"), figure("baseline_zero"))
        })
        .collect()
}

#[test]
fn starter_graphs_of_the_oracle_logs_beat_no_model() {
    let Some(data) = data() else { return };
    let (mut better, mut all) = (0, 0);
    for (train, test) in [
        ("die-tester/train.csv", "die-tester/test.csv"),
        ("linear-axis/train.csv", "linear-axis/test.csv"),
        ("z-probe/GX-H12A.csv", "z-probe/GX-H12A-covered.csv"),
        ("z-probe/GX-H12A-covered.csv", "z-probe/GX-H12A.csv"),
        ("z-probe/superpinda.csv", "z-probe/superpinda-covered.csv"),
        ("z-probe/superpinda-covered.csv", "z-probe/superpinda.csv"),
        ("z-probe/N3F-H4NB.csv", "z-probe/N3F-H4NB.csv"),
        ("z-probe/TL-Q5MC2-Z.csv", "z-probe/TL-Q5MC2-Z.csv"),
        ("wall-heatflow/wall.csv", "wall-heatflow/wall.csv"),
        ("heating-system/heating.csv", "heating-system/heating.csv"),
        ("hairdryer/hairdryer.csv", "hairdryer/hairdryer.csv"),
    ] {
        let scores = scored(&data.join(train), &data.join(test));
        assert!(!scores.is_empty(), "{train}");
        for (rmse, nothing) in scores {
            println!("{train} -> {test}: {rmse:.3} of {nothing:.3}");
            better += usize::from(rmse < nothing);
            all += 1;
        }
    }
    // Six axes, three axes, and nine logs with one.
    assert_eq!(all, 6 + 3 + 9);
    assert!(10 * better >= 9 * all, "{better} of {all}");
}

#[test]
fn logs_of_the_oracle_in_which_nothing_drifts_are_told_so() {
    let Some(data) = data() else { return };
    for file in [
        "nab_ambient_temperature_system_failure.csv",
        "nab_machine_temperature_system_failure.csv",
    ] {
        let path = data.join("temperature-faults").join(file);
        let refused = athermal(&[&"init", &path, &"-o", &"-"]).ended(2);
        refused.tells(&["nothing in it drifts: t_"]);
    }
}
