//! What this program brings: its kinds of nodes, and graphs without a mistake or a warning.

use crate::workbench::{athermal, graphs};
use std::collections::BTreeMap;

use athermal::core::node::NodeKind;
use athermal::core::registry::{all, find};

#[test]
fn every_built_in_kind_is_linked_and_comes_from_its_crate() {
    let mut found: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for kind in all::<NodeKind>() {
        assert!(find::<NodeKind>(kind.name).is_ok(), "{}", kind.name);
        found.entry(kind.package).or_default().push(kind.name);
    }
    let expected = [
        (
            "athermal-combiners",
            "adwin auto_weighted best conformal fallback guard hedge mean median page_hinkley state_gate trimmed",
        ),
        (
            "athermal-control",
            "compensate cross_check health optical_loss remeasure safe_state settled stability uncorrected",
        ),
        (
            "athermal-estimators",
            "ar arimax arma armax arx bj elastic_net huber kalman lasso linear narx oe persistence polynomial rls stack state_space zero",
        ),
        (
            "athermal-features",
            "delay difference first_order hampel lag minimum_difference moving pick product resample sample_at scale slope sum",
        ),
        ("athermal-kinematics", "kinematics"),
    ];
    let found = found
        .iter()
        .map(|(package, names)| (*package, names.join(" ")));
    let found: Vec<_> = found.collect();
    assert_eq!(
        found,
        expected.map(|(package, names)| (package, names.to_owned()))
    );
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
    let linked: Vec<&str> = all::<NodeKind>().map(|kind| kind.name).collect();
    assert_eq!(listed, linked);
}

#[test]
fn every_kind_explains_itself_and_its_parameters() {
    for kind in all::<NodeKind>() {
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
    let within = |folder: &std::path::Path| -> Vec<_> {
        let all = std::fs::read_dir(folder).unwrap();
        all.map(|entry| entry.unwrap().path()).collect()
    };
    let groups = within(&root.join("plugins"));
    let folders: Vec<_> = groups.iter().flat_map(|group| within(group)).collect();
    for kind in all::<NodeKind>() {
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
