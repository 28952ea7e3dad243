//! What becomes of a watched file while a graph of it is in the shadow, cannot take over, or is not there. Decides nothing about what
//! the engine makes of a graph.

use crate::workbench::{Graph, Live, Scratch, athermal_fed};

/// No drift at all, which is wrong of a position that moves evenly.
fn watched() -> Graph {
    Graph::named("watched")
        .time("time_s")
        .signal("position", "nm", "Z", "3min")
        .slope("drift", "position", "30s", "nm/min")
        .model("model", "zero", "", "drift.Z", "30s")
        .outputs("predicted = 'model'")
}

fn desk(test: &str) -> Scratch {
    let scratch = Scratch::new(&format!("watched-runs-{test}"));
    scratch.file("graph.toml", watched());
    scratch
}

/// The last drift over a window, which is right of it.
fn over(window: &str) -> String {
    let better = watched().replace("\"zero\"", "\"persistence\"");
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
    scratch.file("graph.toml", watched());
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
fn a_graph_that_goes_while_it_is_in_the_shadow_does_not_take_over() {
    let scratch = desk("gone-in-shadow");
    let graph = scratch.path("graph.toml");
    let mut live = Live::going_on(&graph, &SHADOW, 0);
    let first = live.revision();
    scratch.file("graph.toml", over("30s"));
    live.stays(&first);
    std::fs::remove_file(&graph).unwrap();
    live.stays(&first);
    live.stays(&first);
    assert_eq!(past_the_shadow(&mut live), [first]);
    let told = live.told();
    let gone = "graph.toml is gone: as it was in the shadow until now, it does not take over";
    assert_told(&told, &["is no longer there", gone]);
    assert!(!told.contains("took over"), "{told}");
}

#[test]
fn a_mistake_that_comes_into_the_file_takes_out_of_the_shadow_what_was_there() {
    let scratch = desk("broken");
    let graph = scratch.path("graph.toml");
    let mut live = Live::going_on(&graph, &SHADOW, 0);
    let first = live.revision();
    scratch.file("graph.toml", over("30s"));
    live.stays(&first);
    scratch.file("graph.toml", watched().replace("[outputs]", "[outputs"));
    live.stays(&first);
    assert_eq!(past_the_shadow(&mut live), [first]);
    let refused = "graph.toml is not taken over; what runs goes on";
    assert_told(&live.told(), &[CHANGED, "error[A001]", refused]);
}

#[test]
fn a_graph_that_cannot_take_over_is_named_with_the_way_to_run_it_to_people_and_programs() {
    let scratch = desk("refused");
    let graph = scratch.path("graph.toml");
    let way = "what runs goes on; a run that begins with other files for `--output` and `--state` takes it";
    let renamed = watched().replace("max_age", "column = \"height\"\nmax_age");
    let other_time = watched().replace("\"time_s\"", "\"time_s\"\nunit = \"ms\"");
    for (text, why) in [
        (renamed, "graph.toml: the new graph reads position.Z"),
        (other_time, "graph.toml: the new graph reads time from"),
    ] {
        for format in ["table", "json"] {
            scratch.file("graph.toml", watched());
            // The rows of programs are those of people here.
            let out = scratch.path(&format!("{format}.csv"));
            let mut arguments = vec!["--quiet", "--format", format];
            if format == "json" {
                arguments.extend(["-o", out.to_str().unwrap()]);
            }
            let told = refused_with(&graph, &arguments, || {
                scratch.file("graph.toml", &text);
            });
            assert_told(
                &told,
                &[why, &format!("graph.toml is not taken over; {way}")],
            );
            let event = "\"event\":\"not_taken_over\"";
            assert_eq!(told.contains(event), format == "json", "{told}");
        }
    }
    scratch.file("graph.toml", watched());
    let mut live = Live::new(&graph);
    let first = live.revision();
    scratch.file("graph.toml", watched().to_string() + "more = \"drift\"\n");
    live.stays(&first);
    let lacks = "graph.toml has the output `more.Z`, for which there is no column; ";
    assert_told(&live.told(), &[&format!("{lacks}{way}")]);
}

/// What is told of a change of a graph by a run that is fed for longer than the file is looked at twice.
fn refused_with(graph: &std::path::Path, more: &[&str], change: impl FnOnce()) -> String {
    use std::io::Write;
    use std::process::{Command, Stdio};

    let mut child = Command::new(env!("CARGO_BIN_EXE_athermal"))
        .arg("run")
        .arg(graph)
        .args(["-i", "-", "--watch"])
        .args(more)
        .stdin(Stdio::piped())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut feed = child.stdin.take().unwrap();
    feed.write_all(b"time_s,Z\n0,0\n").unwrap();
    std::thread::sleep(std::time::Duration::from_millis(300));
    change();
    for nth in 1..50 {
        writeln!(feed, "{0},{0}", 10 * nth).unwrap();
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    drop(feed);
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success());
    String::from_utf8(output.stderr).unwrap()
}

#[test]
fn a_restart_with_a_graph_for_other_columns_says_that_what_ran_last_lacks_them_and_how_the_graph_is_run()
 {
    let scratch = desk("renamed");
    let (graph, state) = (scratch.path("graph.toml"), scratch.path("state"));
    let run = |state: &std::path::Path, rows: &str| {
        athermal_fed(
            &[&"run", &graph, &"-i", &"-", &"--watch", &"--state", &state],
            rows.as_bytes(),
        )
    };
    run(&state, "time_s,Z\n0,0\n10,10\n").ended(0);
    let renamed = watched().replace("max_age", "column = \"height\"\nmax_age");
    scratch.file("graph.toml", renamed);
    let log = "time_s,height\n20,20\n30,30\n";
    let refused = run(&state, log).ended(2);
    refused.tells(&[
        "graph.toml is not what ran last: that goes on, and the file is taken as a change of it",
        "there is no column `Z`",
        "(that is what the graph reads that ran last and would go on; ",
        "graph.toml holds another: a run that begins with other files for `--output` and `--state` takes it)",
    ]);
    assert_eq!(refused.out, "");
    run(&scratch.path("another"), log).ended(0);
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
