//! What this program brings: its kinds of nodes, and graphs without a mistake or a warning.

use crate::workbench::{athermal, graphs};
use athermal::core::node::kinds;

#[test]
fn every_built_in_kind_is_linked_and_comes_from_its_crate() {
    let found: Vec<(&str, Vec<&str>)> = kinds()
        .iter()
        .map(|(name, same)| (*name, same.iter().map(|kind| kind.package).collect()))
        .collect();
    let expected = [
        ("adwin", "athermal-combiners"),
        ("ar", "athermal-estimators"),
        ("arimax", "athermal-estimators"),
        ("arma", "athermal-estimators"),
        ("armax", "athermal-estimators"),
        ("arx", "athermal-estimators"),
        ("auto_weighted", "athermal-combiners"),
        ("best", "athermal-combiners"),
        ("bj", "athermal-estimators"),
        ("compensate", "athermal-control"),
        ("conformal", "athermal-combiners"),
        ("delay", "athermal-features"),
        ("difference", "athermal-features"),
        ("elastic_net", "athermal-estimators"),
        ("fallback", "athermal-combiners"),
        ("first_order", "athermal-features"),
        ("guard", "athermal-combiners"),
        ("hampel", "athermal-features"),
        ("health", "athermal-control"),
        ("hedge", "athermal-combiners"),
        ("huber", "athermal-estimators"),
        ("kalman", "athermal-estimators"),
        ("lag", "athermal-features"),
        ("lasso", "athermal-estimators"),
        ("linear", "athermal-estimators"),
        ("mean", "athermal-combiners"),
        ("median", "athermal-combiners"),
        ("minimum_difference", "athermal-features"),
        ("moving", "athermal-features"),
        ("narx", "athermal-estimators"),
        ("oe", "athermal-estimators"),
        ("optical_loss", "athermal-control"),
        ("page_hinkley", "athermal-combiners"),
        ("persistence", "athermal-estimators"),
        ("pick", "athermal-features"),
        ("polynomial", "athermal-estimators"),
        ("product", "athermal-features"),
        ("resample", "athermal-features"),
        ("rls", "athermal-estimators"),
        ("safe_state", "athermal-control"),
        ("sample_at", "athermal-features"),
        ("scale", "athermal-features"),
        ("settled", "athermal-control"),
        ("slope", "athermal-features"),
        ("stability", "athermal-control"),
        ("stack", "athermal-estimators"),
        ("state_gate", "athermal-combiners"),
        ("state_space", "athermal-estimators"),
        ("sum", "athermal-features"),
        ("trimmed", "athermal-combiners"),
        ("uncorrected", "athermal-control"),
        ("zero", "athermal-estimators"),
    ];
    let expected: Vec<_> = expected
        .into_iter()
        .map(|(name, package)| (name, vec![package]))
        .collect();
    assert_eq!(found, expected);
}

#[test]
fn the_program_knows_the_same_kinds_as_the_library() {
    let listed = athermal(&[&"nodes", &"--format", &"json"]).ended(0).json();
    let listed: Vec<&str> = listed["nodes"]
        .as_array()
        .unwrap()
        .iter()
        .map(|node| node["name"].as_str().unwrap())
        .collect();
    let linked: Vec<&str> = kinds().keys().copied().collect();
    assert_eq!(listed, linked);
}

#[test]
fn every_kind_explains_itself_and_its_parameters() {
    for kind in kinds().values().flatten() {
        assert!(kind.summary().len() > 10, "{}", kind.name);
        let schema = (kind.schema)();
        for (name, parameter) in schema["properties"].as_object().into_iter().flatten() {
            let text = parameter["description"].as_str().unwrap_or_default();
            assert!(
                text.len() > 10,
                "`{name}` of {} is not explained",
                kind.name
            );
        }
    }
}

#[test]
fn every_shipped_graph_checks_without_a_warning() {
    let graphs = graphs("graphs");
    assert!(graphs.len() >= 8, "{graphs:?}");
    for path in graphs {
        let checks = athermal(&[&"check", &"--strict", &path]).ended(0);
        assert!(!checks.told.contains("warning"), "{}", checks.told);
    }
}

#[test]
fn every_experiment_checks_and_those_that_are_wrong_on_purpose_are_warned_of() {
    let mut warned = Vec::new();
    for path in graphs("graphs/experiments") {
        let checks = athermal(&[&"check", &path]).ended(0);
        if checks.told.contains("warning[A065]") {
            warned.push(path.file_stem().unwrap().to_str().unwrap().to_owned());
        }
    }
    assert_eq!(
        warned,
        ["settle-time-forecast", "settle-time-virtual-sensor"]
    );
}

#[test]
fn every_kind_goes_through_the_conformance_kit() {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    let plugins = std::fs::read_dir(root.join("plugins")).unwrap();
    let folders: Vec<_> = plugins.map(|entry| entry.unwrap().path()).collect();
    for kind in kinds().values().flatten() {
        let named = format!("name = \"{}\"", kind.package);
        let of_package = |folder: &&std::path::PathBuf| {
            std::fs::read_to_string(folder.join("Cargo.toml"))
                .is_ok_and(|manifest| manifest.lines().any(|line| line == named))
        };
        let folder = folders.iter().find(of_package).unwrap_or_else(|| {
            panic!(
                "`{}` comes from {}, which is no plugin",
                kind.name, kind.package
            )
        });
        let tests = std::fs::read_to_string(folder.join("tests/nodes/conformance.rs"));
        assert!(
            tests.is_ok_and(|tests| {
                tests.contains("\n    assert_every_kind_conforms(env!(\"CARGO_PKG_NAME\"));")
            }),
            "{} has no tests/nodes/conformance.rs that asks for every kind of it",
            kind.package
        );
    }
}
