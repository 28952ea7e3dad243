//! The starter graph of every log in the shared data: it checks, fits and evaluates as it is.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

const PROGRAM: &str = env!("CARGO_BIN_EXE_athermal");

fn data() -> Option<PathBuf> {
    let stated = std::env::var_os("ATHERMAL_SHARED").map(PathBuf::from);
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared");
    let data = stated.unwrap_or(beside).join("data");
    if !data.is_dir() {
        eprintln!("skipped: there is no {}", data.display());
        return None;
    }
    Some(data)
}

fn run(arguments: &[&str]) -> Output {
    Command::new(PROGRAM).args(arguments).output().unwrap()
}

/// Writes a starter graph for one log, fits it, and scores it on another: (RMSE of the vote, without a model) per axis.
fn scored(train: &Path, test: &Path) -> Vec<(f64, f64)> {
    let name = train.to_string_lossy().replace(['/', '\\'], "_");
    let base = std::env::temp_dir().join(format!("athermal-init-{}-{name}", std::process::id()));
    let path = |ending: &str| base.with_extension(ending).to_str().unwrap().to_owned();
    let (graph, model) = (path("toml"), path("json"));
    let (train, test) = (train.to_str().unwrap(), test.to_str().unwrap());
    for arguments in [
        &["init", train, "-o", &graph, "--force"][..],
        &["check", "--strict", &graph],
        &["fit", &graph, "--data", train, "-o", &model],
    ] {
        let output = run(arguments);
        let told = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{arguments:?}\n{told}");
    }
    let output = run(&["evaluate", &model, "--data", test, "--format", "json"]);
    let facts: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    for file in [graph, model] {
        std::fs::remove_file(file).unwrap();
    }
    let votes = facts["scores"].as_array().unwrap().iter();
    votes
        .filter(|score| score["node"].as_str().unwrap().starts_with("vote"))
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
        let output = run(&["init", path.to_str().unwrap(), "-o", "-"]);
        let told = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{told}");
        assert!(told.contains("nothing in it drifts: t_"), "{told}");
    }
}
