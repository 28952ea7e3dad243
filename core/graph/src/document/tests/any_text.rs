//! Any text at all gives a graph or errors with places, and never a panic; graphs changed at random are compiled too, in the tests of the whole.

use proptest::prelude::*;

use super::*;
use crate::diagnostic::Severity;

fn errors_have_places(text: &str) -> Result<(), TestCaseError> {
    let Outcome {
        graph,
        sources,
        diagnostics,
    } = read(&[("a.toml", text)]);
    prop_assert!(graph.is_some() || diagnostics.has_errors());
    for diagnostic in diagnostics
        .iter()
        .filter(|diagnostic| diagnostic.severity == Severity::Error)
    {
        let place = diagnostic.place;
        prop_assert!(
            place.is_some_and(|place| place.start <= place.end && place.end as usize <= text.len()),
            "{:?}",
            diagnostic
        );
        prop_assert!(
            crate::diagnostic::explain(diagnostic.code).is_some(),
            "{}",
            diagnostic.code
        );
    }
    prop_assert_eq!(
        diagnostics.render(&sources, true, 100).is_empty(),
        diagnostics.is_empty()
    );
    prop_assert!(
        diagnostics.to_json(&sources)["diagnostics"]
            .as_array()
            .is_some_and(|list| list.len() == diagnostics.len())
    );
    Ok(())
}

#[test]
fn the_unchanged_graph_is_read() {
    let Outcome {
        graph, diagnostics, ..
    } = read(&[("a.toml", die_tester())]);
    assert!(diagnostics.is_empty());
    let graph = graph.expect("the documentation's graph has no mistake");
    assert_eq!(graph.nodes.len(), 6);
    let vote = graph
        .nodes
        .iter()
        .find(|node| node.name == "vote")
        .expect("it votes");
    assert_eq!(vote.instances.len(), 6);
    let voters: Vec<&str> = vote.instances[2].inputs[0]
        .references
        .iter()
        .map(|(text, _)| text.as_str())
        .collect();
    assert_eq!(voters, ["thermal.Z1", "motion.Z1", "both.Z1"]);
    assert_eq!(graph.signals[0].range, Some((-20.0, 200.0)));
    assert_eq!(graph.signals[1].channels.len(), 6);
    assert_eq!(graph.outputs[0].from[0].0, "vote");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, ..ProptestConfig::default() })]

    #[test]
    fn no_text_at_all_makes_the_reader_panic(text in "\\PC{0,200}") {
        errors_have_places(&text)?;
    }
}
