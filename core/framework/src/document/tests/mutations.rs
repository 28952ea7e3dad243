//! A graph file changed at random gives a graph or errors with places, and never a panic.

use proptest::prelude::*;

use super::*;
use crate::diagnostic::Severity;

/// Pieces that mean something to the language, so that changes reach beyond the parser.
const PIECES: [&str; 26] = [
    "\"",
    "'",
    "[",
    "]",
    "{",
    "}",
    "=",
    ".",
    ",",
    "\n",
    "#",
    "{axis}",
    "{x}",
    "5",
    "-1e999",
    "nan",
    "\"5min\"",
    "false",
    "each",
    "type",
    "[[tests]]",
    "[nodes.a]",
    "\"2 samples\"",
    "\u{b5}",
    "\u{0}",
    "1979-05-27",
];

#[derive(Debug, Clone)]
enum Change {
    Remove { from: f64, length: usize },
    Insert { at: f64, piece: usize },
    Copy { from: f64, to: f64, length: usize },
}

fn change() -> impl Strategy<Value = Change> {
    prop_oneof![
        (0.0..1.0, 1..40usize).prop_map(|(from, length)| Change::Remove { from, length }),
        (0.0..1.0, 0..PIECES.len()).prop_map(|(at, piece)| Change::Insert { at, piece }),
        (0.0..1.0, 0.0..1.0, 1..200usize).prop_map(|(from, to, length)| Change::Copy {
            from,
            to,
            length
        }),
    ]
}

fn apply(text: &mut Vec<char>, change: &Change) {
    let at = |share: f64, text: &[char]| (share * text.len() as f64) as usize;
    let piece = match *change {
        Change::Remove { from, length } => {
            let from = at(from, text);
            let to = (from + length).min(text.len());
            text.drain(from..to);
            return;
        }
        Change::Insert { at: share, piece } => {
            (at(share, text), PIECES[piece].chars().collect::<Vec<_>>())
        }
        Change::Copy { from, to, length } => {
            let from = at(from, text);
            (
                at(to, text),
                text[from..(from + length).min(text.len())].to_vec(),
            )
        }
    };
    text.splice(piece.0..piece.0, piece.1);
}

fn errors_have_places(text: &str) -> Result<(), TestCaseError> {
    let Outcome {
        graph,
        sources,
        diagnostics,
    } = read(&[("a.toml", text)]);
    prop_assert_eq!(graph.is_none(), diagnostics.has_errors());
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
    fn a_changed_graph_never_panics_and_every_error_has_a_place(changes in prop::collection::vec(change(), 1..6)) {
        let mut text: Vec<char> = die_tester().chars().collect();
        changes.iter().for_each(|change| apply(&mut text, change));
        errors_have_places(&text.into_iter().collect::<String>())?;
    }

    #[test]
    fn no_text_at_all_makes_the_reader_panic(text in "\\PC{0,200}") {
        errors_have_places(&text)?;
    }
}
