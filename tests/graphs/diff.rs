//! What counts as a change between two graphs, and what does not.

use crate::workbench::plan;
use athermal::core::compile::{Change, PlanDiff, diff};

const GRAPH: &str = include_str!("../../graphs/die-tester.toml");

/// The differences between the die tester's graph and one in which texts have been replaced.
fn replaced(changes: &[(&str, &str)]) -> PlanDiff {
    let changed = changes.iter().fold(GRAPH.to_owned(), |text, (from, to)| {
        assert!(text.contains(from), "the graph has no `{from}`");
        text.replace(from, to)
    });
    diff(&plan(GRAPH), &plan(&changed))
}

/// One line per difference.
fn told(diff: &PlanDiff) -> Vec<String> {
    let signals = diff.signals.iter().map(|s| (&s.channel, &s.change));
    let nodes = diff.nodes.iter().map(|n| (&n.instance, &n.change));
    let outputs = diff.outputs.iter().map(|o| (&o.output, &o.change));
    let mut lines = Vec::new();
    for (name, change) in signals.chain(nodes).chain(outputs) {
        match change {
            Change::Unchanged => {}
            Change::Added => lines.push(format!("{name} added")),
            Change::Removed => lines.push(format!("{name} removed")),
            Change::Changed(parameters) => lines.extend(parameters.iter().map(|p| {
                let shown = |value: &Option<serde_json::Value>| {
                    value
                        .as_ref()
                        .map_or("none".to_owned(), ToString::to_string)
                };
                format!("{name} {}: {} -> {}", p.path, shown(&p.from), shown(&p.to))
            })),
        }
    }
    lines
}

#[test]
fn how_a_graph_is_written_is_no_change() {
    let same = replaced(&[
        ("unit = \"Cel\"", "unit = \"degC\" # a comment"),
        ("windows = [\"5min\"]", "windows = [\"300s\"]"),
        ("ahead = \"5min\"", "\"ahead\" = \"300s\""),
        ("\"nm/min\"", "\"nm.min-1\""),
        ("\"150 nm/min\"", "\"0.15 um/min\""),
        ("max_age = \"1min\"", "max_age = \"60s\""),
        ("solver = { type = \"ridge\", alpha = 1.0 }", ""),
    ]);
    assert_eq!(told(&same), [""; 0]);
    assert!(same.is_same());
    assert_eq!(same.nodes.len(), 26);
}

#[test]
fn the_order_of_nodes_is_no_change() {
    let (before, votes) = GRAPH.split_once("[nodes.vote]").unwrap();
    let (votes, outputs) = votes.split_once("[outputs]").unwrap();
    let (head, nodes) = before.split_once("[nodes.drift]").unwrap();
    let moved = format!("{head}[nodes.vote]{votes}[nodes.drift]{nodes}[outputs]{outputs}");
    assert!(diff(&plan(GRAPH), &plan(&moved)).is_same());
}

#[test]
fn a_parameter_is_named_with_what_it_was_and_is() {
    let other = replaced(&[
        ("alpha = 1.0", "alpha = 2.0"),
        ("memory = \"15min\"", "memory = \"1h\""),
    ]);
    let told = told(&other);
    assert_eq!(told.len(), 12);
    assert_eq!(told[0], "thermal.X1 solver.alpha: 1.0 -> 2.0");
    assert_eq!(told[6], "vote.X1 memory: \"15min\" -> \"1h\"");
}

#[test]
fn what_is_further_down_is_changed_only_by_what_it_reads() {
    let other = replaced(&[("windows = [\"5min\"]", "windows = [\"4min\"]")]);
    assert_eq!(other.node("gradients"), Some(&Change::Unchanged));
    // The drift's span is what the estimators read; the votes are also paired with it.
    assert!(matches!(other.node("drift"), Some(Change::Changed(_))));
    assert!(matches!(other.node("thermal.X1"), Some(Change::Changed(_))));
    let other = replaced(&[("shortest = \"150s\"", "shortest = \"200s\"")]);
    assert!(matches!(other.node("thermal.X1"), Some(Change::Changed(_))));
    assert_eq!(other.node("vote.X1"), Some(&Change::Unchanged));
}

#[test]
fn nodes_and_members_come_and_go() {
    let other = replaced(&[
        ("\"Z2\"]", "\"W2\"]"),
        ("[nodes.motion]", "[nodes.inertia]"),
        ("motion.{axis}", "inertia.{axis}"),
    ]);
    assert_eq!(other.node("thermal.Z2"), Some(&Change::Removed));
    assert_eq!(other.node("thermal.W2"), Some(&Change::Added));
    assert_eq!(other.node("inertia.X1"), Some(&Change::Added));
    assert_eq!(other.node("motion.X1"), Some(&Change::Removed));
    assert_eq!(other.node("thermal.X1"), Some(&Change::Unchanged));
    assert_eq!(
        told(&other)
            .iter()
            .filter(|line| line.starts_with("vote.X1"))
            .collect::<Vec<_>>(),
        [
            "vote.X1 inputs.voters: [\"thermal.X1\",\"motion.X1\",\"both.X1\"] -> [\"thermal.X1\",\"inertia.X1\",\"both.X1\"]"
        ]
    );
}

#[test]
fn another_type_is_one_change() {
    let other = replaced(&[("type = \"ridge\", alpha = 1.0", "type = \"ols\"")]);
    assert_eq!(
        told(&other)[..2],
        [
            "thermal.X1 solver.type: \"ridge\" -> \"ols\"",
            "thermal.X1 solver.alpha: 1.0 -> none"
        ]
    );
    let other = replaced(&[
        ("type = \"auto_weighted\"", "type = \"mean\""),
        ("inputs.truth = \"drift.{axis}\"\nmemory = \"15min\"", ""),
    ]);
    assert_eq!(
        told(&other)[0],
        "vote.X1 type: \"auto_weighted\" -> \"mean\""
    );
}

#[test]
fn the_age_of_a_held_input_counts() {
    let other = replaced(&[(
        "inputs.features = \"gradients\"",
        "inputs.features = { from = \"gradients\", max_age = \"2min\" }",
    )]);
    let told = told(&other);
    assert!(told[0].starts_with("thermal.X1 inputs.features.max_age: [\"150s\",\"212.9"));
    assert!(told[0].ends_with("-> \"2min\""));
}

#[test]
fn signals_and_outputs_are_compared_too() {
    let other = replaced(&[
        ("200 Cel", "150 Cel"),
        ("predicted = \"vote\"", "predicted = \"thermal\""),
    ]);
    let told = told(&other);
    assert_eq!(
        told[0],
        "temperature.plate1 range.high: \"200 Cel\" -> \"150 Cel\""
    );
    assert_eq!(told[6], "predicted.X1 from: \"vote.X1\" -> \"thermal.X1\"");
}

#[test]
fn spelling_one_of_several_inputs_differently_is_no_change() {
    let two = |unit: &str| {
        let second = format!(
            "[nodes.short]\ntype = \"slope\"\ninputs.signal = \"temperature\"\nwindows = [\"2min\"]\nunit = \"{unit}\"\n\n[nodes.thermal]"
        );
        GRAPH
            .replace("[nodes.thermal]", &second)
            .replace("\"gradients\"", "[\"gradients\", \"short\"]")
    };
    assert!(diff(&plan(&two("mK/min")), &plan(&two("mK.min-1"))).is_same());
    assert!(diff(&plan(&two("mK.min-1")), &plan(&two("mK/min"))).is_same());
}
