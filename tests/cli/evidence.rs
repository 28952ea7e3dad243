//! Combiners that go by fewer truths than they take: scoring says which, and what would help.

use std::ffi::OsStr;
use std::fmt::Write as _;

use crate::workbench::{Graph, Scratch, athermal_on};
use serde_json::json;

/// A graph in which zero is predicted of a measured truth, and put together by combiners with these parameters.
fn graph(combiners: &[(&str, &str)]) -> Graph {
    let zero = Graph::new()
        .time("time_s")
        .signal("out", "nm", "y", "2min")
        .with("column = '{channel}'")
        .model("none", "zero", "", "out", "0s");
    let graph = combiners.iter().fold(zero, |graph, (kind, parameters)| {
        let port = ["voters", "prediction"][usize::from(*kind == "conformal")];
        let inputs = format!("inputs.{port} = 'none'; inputs.truth = 'out'");
        graph
            .section(&format!("nodes.{kind}"), &format!("type = '{kind}'"))
            .with(&inputs)
            .with(parameters)
    });
    let outputs = combiners
        .iter()
        .map(|(kind, _)| format!("{kind} = '{kind}'"));
    graph.outputs(&outputs.collect::<Vec<_>>().join("; "))
}

/// Truths at these instants, in s.
fn truths(times: impl Iterator<Item = u32>) -> String {
    let mut rows = String::from("time_s,y\n");
    for (nth, time) in times.enumerate() {
        let _ = writeln!(rows, "{time},{}", 1 + nth % 7);
    }
    rows
}

/// What is warned of.
fn warned(told: &str) -> Vec<String> {
    let lines = told.lines();
    let lines = lines.filter_map(|line| line.strip_prefix("warning: "));
    lines.map(str::to_owned).collect()
}

/// The warnings of a score of these combiners on truths at these instants, in s.
fn warnings(
    test: &str,
    combiners: &[(&str, &str)],
    times: impl Iterator<Item = u32>,
) -> Vec<String> {
    let scratch = Scratch::new(test);
    let graph = scratch.file("graph.toml", graph(combiners));
    let data = scratch.file("data.csv", truths(times));
    let told = athermal_on("evaluate", &graph, &data, &[]).ended(0).told;
    warned(&told)
}

#[test]
fn a_memory_or_a_pace_that_never_leaves_enough_truths_is_told_with_what_would() {
    // At each minute the truths before it are known: none of the last half minute, four of the last five, 20 of 99 five
    // minutes apart.
    let found = warnings(
        "too-short",
        &[
            ("auto_weighted", "memory = \"30s\""),
            ("best", "memory = \"30s\""),
            ("guard", "memory = \"5min\""),
            ("conformal", "memory = \"5min\""),
            ("page_hinkley", ""),
            ("adwin", "first = 20\nevery = \"3min\""),
        ],
        (0..100).map(|row| 60 * row),
    );
    let expected = [
        ("auto_weighted", "1 truth", "any", "a longer `memory` lets"),
        ("best", "1 truth", "any", "a longer `memory` lets"),
        ("guard", "5 truths", "more than 4", "a longer `memory` lets"),
        (
            "conformal",
            "9 truths",
            "more than 4",
            "a longer `memory` lets",
        ),
        (
            "page_hinkley",
            "60 truths",
            "more than 20",
            "a shorter `every`, or more data, lets",
        ),
        (
            "adwin",
            "40 truths",
            "more than 33",
            "a shorter `every`, or more data, lets",
        ),
    ];
    let expected = expected.map(|(node, needed, most, remedy)| {
        format!(
            "{node} needs {needed} and never had {most} of the 99 that came, so it acted on none; {remedy} more count"
        )
    });
    assert_eq!(found, expected);
}

#[test]
fn nothing_is_said_where_truths_are_enough() {
    let enough = [
        ("auto_weighted", "memory = \"2min\""),
        ("guard", "memory = \"10min\""),
        ("conformal", "memory = \"20min\""),
        ("page_hinkley", "every = \"1min\""),
    ];
    let found = warnings("enough", &enough, (0..100).map(|row| 60 * row));
    assert!(found.is_empty(), "{found:?}");
}

#[test]
fn a_memory_that_held_enough_truths_only_once_is_told_by_how_often_it_did() {
    // Truths come each 10 s for a while, and five are known from 50 to 90 s: at 5 of the 95 ticks since.
    let burst = (0..10).map(|row| 10 * row);
    let calm = (0..90).map(|row| 150 + 60 * row);
    assert_eq!(
        warnings("once", &[("guard", "memory = \"1min\"")], burst.chain(calm)),
        [
            "guard needs 5 truths and had as many at only 5% of the ticks since it first did; a longer `memory` lets more count"
        ]
    );
}

#[test]
fn members_of_a_node_that_lack_the_same_are_told_of_once() {
    let scratch = Scratch::new("members");
    let graph = scratch.file(
        "graph.toml",
        Graph::new()
            .section("sets", "axis = ['x', 'y', 'z']")
            .time("time_s")
            .section("signals.out", "unit = 'nm'; channels = 'axis'")
            .with("column = '{channel}'; max_age = '2min'")
            .model("none", "zero", "", "out.{axis}", "0s")
            .with("each = 'axis'")
            .vote("vote", "best", "none.{axis}", "out.{axis}")
            .with("each = 'axis'; memory = '30s'")
            .outputs("vote = 'vote'"),
    );
    // `z` has only half of the truths, so that another number is told of it: all 50 are known at the last row, which has none
    // of its own. Of the others the truth of the last row comes too late.
    let mut rows = String::from("time_s,x,y,z\n");
    for row in 0..100 {
        let z = if row % 2 == 0 { "3" } else { "" };
        let _ = writeln!(rows, "{},1,2,{z}", 60 * row);
    }
    let data = scratch.file("data.csv", rows);
    let told = athermal_on("evaluate", &graph, &data, &[]).ended(0).told;
    let warnings: Vec<_> = told
        .lines()
        .filter(|line| line.starts_with("warning"))
        .collect();
    let never = |who: &str, came: u32| {
        format!(
            "warning: {who} needs 1 truth and never had any of the {came} that came, so it acted on none; a longer `memory` lets more count"
        )
    };
    assert_eq!(
        warnings,
        [
            never("vote.x (and 1 more like it)", 99),
            never("vote.z", 50)
        ]
    );
}

#[test]
fn data_that_are_too_short_are_told_as_such() {
    assert_eq!(
        warnings(
            "short",
            &[("guard", "memory = \"1h\"")],
            (0..3).map(|row| 60 * row)
        ),
        ["guard needs 5 truths and the data have 2 for it, so it acted on none"]
    );
}

#[test]
fn every_command_that_scores_a_combiner_tells_what_it_lacks_to_people_and_to_programs() {
    let scratch = Scratch::new("commands");
    let guard = scratch.file("graph.toml", graph(&[("guard", "memory = \"5min\"")]));
    let data = scratch.file("data.csv", truths((0..100).map(|row| 60 * row)));
    let told = "guard needs 5 truths and never had more than 4 of the 99 that came, so it acted on none; \
                a longer `memory` lets more count";
    let expected = json!([{
        "node": "guard",
        "told": 99,
        "needed": 5.0,
        "most": 4.0,
        "enough": 0.0,
        "remedy": "a longer `memory`",
    }]);
    let of_graph = format!("{}: {told}", guard.display());
    let on = data.to_str().unwrap();
    let commands = [
        ("evaluate", vec![], "/lacks", told),
        ("compare", vec!["--on", on], "/graphs/0/lacks", &of_graph),
        ("diagnose", vec!["--no-fit"], "/diagnosis/lacks", told),
        ("report", vec![], "/lacks", told),
    ];
    for (command, mut words, place, told) in commands {
        let call = |words: &[&str]| {
            let words: Vec<&dyn AsRef<OsStr>> = words.iter().map(|word| word as _).collect();
            athermal_on(command, &guard, &data, &words).ended(0)
        };
        assert_eq!(warned(&call(&words).told), [told], "{command}");
        words.extend(["--format", "json"]);
        let programs = call(&words).json();
        assert_eq!(programs.pointer(place), Some(&expected), "{command}");
    }
}

#[test]
fn programs_are_told_of_no_lack_where_truths_are_enough() {
    let scratch = Scratch::new("no-lack");
    let guard = scratch.file("graph.toml", graph(&[("guard", "memory = \"10min\"")]));
    let data = scratch.file("data.csv", truths((0..100).map(|row| 60 * row)));
    let json = athermal_on("evaluate", &guard, &data, &[&"--format", &"json"]);
    assert_eq!(json.ended(0).json()["lacks"], json!([]));
}
