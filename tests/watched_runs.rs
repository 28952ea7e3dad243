//! What becomes of a watched file while a graph of it is in the shadow, cannot take over, or is not there. Decides nothing about what
//! the engine makes of a graph.

#![allow(clippy::unwrap_used)]

mod workbench;

use workbench::{Live, Scratch};

/// No drift at all, which is wrong of a position that moves evenly.
const GRAPH: &str = r#"
schema = 1
name = "watched"
[time]
column = "time_s"
[signals.position]
unit = "nm"
channels = ["Z"]
max_age = "3min"
[nodes.drift]
type = "slope"
inputs.signal = "position"
windows = ["30s"]
unit = "nm/min"
[nodes.model]
type = "zero"
inputs.truth = "drift.Z"
ahead = "30s"
[outputs]
predicted = "model"
"#;

fn desk(test: &str) -> Scratch {
    let scratch = Scratch::new(&format!("watched-runs-{test}"));
    scratch.file("graph.toml", GRAPH);
    scratch
}

/// The last drift over a window, which is right of it.
fn over(window: &str) -> String {
    let better = GRAPH.replace("\"zero\"", "\"persistence\"");
    better.replace("30s\"]", &format!("{window}\"]"))
}

/// Longer than a test feeds rows until then, and no longer than a thousand rows.
const SHADOW: [&str; 2] = ["--shadow", "2h"];
const PAST_THE_SHADOW: usize = 1_000;

/// Feeds rows until a shadow that began since is over.
fn past_the_shadow(live: &mut Live) -> Vec<String> {
    let mut revisions: Vec<_> = (0..PAST_THE_SHADOW).map(|_| live.revision()).collect();
    revisions.dedup();
    revisions
}

#[track_caller]
fn assert_told(told: &str, parts: &[&str]) {
    for part in parts {
        assert!(told.contains(part), "`{part}` is not in\n{told}");
    }
}

const CHANGED: &str =
    "graph.toml has changed: as it was in the shadow until now, it does not take over";

#[test]
fn a_graph_that_is_put_back_while_its_change_is_in_the_shadow_goes_on() {
    let scratch = desk("put-back");
    let graph = scratch.path("graph.toml");
    let mut live = Live::going_on(&graph, &SHADOW, 0);
    let first = live.revision();
    scratch.file("graph.toml", over("30s"));
    live.stays(&first);
    scratch.file("graph.toml", GRAPH);
    live.stays(&first);
    assert_eq!(past_the_shadow(&mut live), [first]);
    let told = live.told();
    assert_told(
        &told,
        &["nodes go on", CHANGED, "graph.toml is what runs again"],
    );
    assert!(!told.contains("took over"), "{told}");
    assert!(!told.contains("data ended"), "{told}");
}

#[test]
fn a_graph_that_changes_again_in_the_shadow_takes_over_as_it_is_last() {
    let scratch = desk("again");
    let graph = scratch.path("graph.toml");
    let mut live = Live::going_on(&graph, &SHADOW, 0);
    let first = live.revision();
    scratch.file("graph.toml", over("40s"));
    live.stays(&first);
    scratch.file("graph.toml", over("30s"));
    live.stays(&first);
    // What means the same stays in the shadow.
    scratch.file("graph.toml", over("30s") + "# tried today\n");
    live.stays(&first);
    let revisions = past_the_shadow(&mut live);
    let told = live.told();
    assert_eq!(revisions.len(), 2, "{revisions:?}: {told}");
    assert_eq!(told.matches(CHANGED).count(), 1, "{told}");
    assert_eq!(told.matches("took over").count(), 1, "{told}");
    assert_told(&told, &[&format!("graph.toml (revision {})", revisions[1])]);
}

#[test]
fn a_mistake_that_comes_into_the_file_takes_out_of_the_shadow_what_was_there() {
    let scratch = desk("broken");
    let graph = scratch.path("graph.toml");
    let mut live = Live::going_on(&graph, &SHADOW, 0);
    let first = live.revision();
    scratch.file("graph.toml", over("30s"));
    live.stays(&first);
    scratch.file("graph.toml", GRAPH.replace("[outputs]", "[outputs"));
    live.stays(&first);
    assert_eq!(past_the_shadow(&mut live), [first]);
    let refused = "graph.toml is not taken over; what runs goes on";
    assert_told(&live.told(), &[CHANGED, "error[A001]", refused]);
}

#[test]
fn a_restart_without_the_graphs_file_says_so_and_takes_the_file_when_it_comes() {
    let scratch = desk("mistyped");
    let (graph, state) = (scratch.path("graph.toml"), scratch.path("state"));
    let kept = ["--state", state.to_str().unwrap()];
    let mut live = Live::going_on(&graph, &kept, 0);
    let first = live.revision();
    let time = live.time;
    live.told();

    let typo = scratch.path("typo.toml");
    let mut live = Live::going_on(&typo, &kept, time);
    live.stays(&first);
    scratch.file("typo.toml", over("40s"));
    live.until_swapped(&first);
    let told = live.told();
    assert_told(
        &told,
        &[
            "error[A002]",
            "typo.toml is not taken over; what ran last goes on",
        ],
    );
    assert!(!told.contains("is not what ran last"), "{told}");
}

#[test]
fn a_watched_file_that_goes_is_told_once_and_again_when_it_is_back() {
    let scratch = desk("gone");
    let graph = scratch.path("graph.toml");
    let mut live = Live::new(&graph);
    let first = live.revision();
    let aside = scratch.path("aside.toml");
    std::fs::rename(&graph, &aside).unwrap();
    live.stays(&first);
    live.stays(&first);
    std::fs::rename(&aside, &graph).unwrap();
    live.stays(&first);
    let told = live.told();
    let gone =
        "graph.toml is no longer there: what runs goes on until it is there again with a change";
    assert_eq!(told.matches(gone).count(), 1, "{told}");
    assert_eq!(
        told.matches("graph.toml is there again, as it was").count(),
        1,
        "{told}"
    );
}
