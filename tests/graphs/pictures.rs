//! Pictures of a graph with nodes of all kinds.

use athermal::Model;

use athermal::drawing::{Arrow, Box, Class, Diagram, Flow, diagram, dot, mermaid, svg};

fn die_tester(expand: bool) -> Diagram {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/graphs/die-tester.toml");
    let model = Model::load(std::path::Path::new(path)).unwrap();
    diagram(&model.plan, expand)
}

fn named(diagram: &Diagram, name: &str) -> usize {
    let found = diagram.boxes.iter().position(|shown| shown.title == name);
    found.unwrap()
}

#[test]
fn instances_share_a_box_until_they_are_expanded() {
    let folded = die_tester(false);
    let titles: Vec<&str> = folded
        .boxes
        .iter()
        .map(|shown| shown.title.as_str())
        .collect();
    let expected = [
        "temperature",
        "position",
        "drift",
        "gradients",
        "thermal",
        "motion",
        "both",
        "vote",
        "predicted",
    ];
    assert_eq!(titles, expected);
    // Two signals, two slopes, four nodes for six axes each, one output.
    assert_eq!(die_tester(true).boxes.len(), 2 + 2 + 4 * 6 + 1);
}

#[test]
fn arrows_say_what_travels() {
    let folded = die_tester(false);
    let has = |from, to, kind| {
        let (from, to) = (named(&folded, from), named(&folded, to));
        folded.arrows.contains(&Arrow { from, to, kind })
    };
    assert!(has("gradients", "thermal", Flow::Data));
    assert!(has("drift", "thermal", Flow::Truth));
    assert!(!has("drift", "thermal", Flow::Data));
    assert!(has("drift", "motion", Flow::Data));
    assert!(has("vote", "predicted", Flow::Data));
}

#[test]
fn an_expanded_instance_has_arrows_of_its_own() {
    let expanded = die_tester(true);
    let to = named(&expanded, "vote.Z1");
    let from: Vec<&str> = expanded
        .arrows
        .iter()
        .filter(|arrow| arrow.to == to && arrow.kind == Flow::Data)
        .map(|arrow| expanded.boxes[arrow.from].title.as_str())
        .collect();
    assert_eq!(from, ["thermal.Z1", "motion.Z1", "both.Z1"]);
}

#[test]
fn names_cannot_break_out_of_a_picture() {
    let diagram = Diagram {
        name: "a <b> & \"c\"".to_owned(),
        boxes: vec![Box {
            title: "<script>\"".to_owned(),
            class: Class::Feature,
            lines: Vec::new(),
        }],
        arrows: Vec::new(),
    };
    assert!(!svg::text(&diagram).contains("<script>"));
    assert!(!mermaid::text(&diagram).contains("<script>"));
    assert!(dot::text(&diagram).contains("<script>\\\""));
}
