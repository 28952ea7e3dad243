//! Replacing the graph of `athermal run`, as a user does it: at a time of the data, after a comparison, or when a file changes.
//! Decides nothing about what the engine makes of it.

use std::io::Write;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::workbench::{Finished, Graph, Live, Scratch, athermal, athermal_fed};

/// Two predictions of a drift, of which the graph shows one.
fn shown() -> Graph {
    Graph::named("shown")
        .time("time_s")
        .signal("position", "nm", "Z", "3min")
        .section("modules.model", "from = 'model.toml'")
        .slope("drift", "position", "30s", "nm/min")
        .section("nodes.model", "module = 'model'; inputs.truth = 'drift.Z'")
        .outputs("predicted = 'model'")
}

/// The module of a file of its own: the truth at the smallest lag, and nothing at all.
fn module(shown: &str) -> String {
    format!(
        "schema = 1\n[modules.model]\ninputs = [\"truth\"]\noutputs = {{ shown = \"{shown}\", same = \"same\", still = \"still\" }}\n\
         nodes.same = {{ type = \"persistence\", inputs.truth = \"{{truth}}\", ahead = \"30s\" }}\n\
         nodes.still = {{ type = \"zero\", inputs.truth = \"{{truth}}\", ahead = \"30s\" }}\n"
    )
}

/// A folder with the graph, one that shows zero in place of the last drift, and five minutes of an uneven drift.
fn desk(test: &str) -> Scratch {
    let scratch = Scratch::new(&format!("swap-commands-{test}"));
    scratch.file("model.toml", module("same"));
    scratch.file("graph.toml", shown());
    let still = "schema = 1\nextends = \"graph.toml\"\nname = \"still\"\noutputs.predicted = \"model:still\"\n";
    scratch.file("still.toml", still);
    scratch.file("data.csv", format!("time_s,Z\n{}", rows(1000, 31)));
    scratch
}

/// Rows ten seconds apart from an instant on.
fn rows(from: u32, count: u32) -> String {
    let row = |nth: u32| {
        let place = 10.0 * f64::from(nth) + 7.0 * (0.9 * f64::from(nth)).sin();
        format!("{},{place:.3}\n", from + 10 * nth)
    };
    (0..count).map(row).collect()
}

fn run(scratch: &Scratch, arguments: &[&str]) -> Finished {
    let (graph, data) = (scratch.path("graph.toml"), scratch.path("data.csv"));
    let mut all: Vec<&dyn AsRef<std::ffi::OsStr>> = vec![&"run", &graph, &"--input", &data];
    all.extend(arguments.iter().map(|argument| argument as &dyn AsRef<_>));
    athermal(&all)
}

/// Time, prediction and revision of each row.
fn table(finished: &Finished) -> Vec<(f64, String, String)> {
    let mut lines = finished.out.lines();
    assert_eq!(lines.next(), Some("time_s,predicted.Z,revision"));
    let row = |line: &str| {
        let cells: Vec<_> = line.split(',').collect();
        (cells[0].parse().unwrap(), cells[1].into(), cells[2].into())
    };
    lines.map(row).collect()
}

fn swap(scratch: &Scratch, at: &str, graph: &str) -> String {
    format!("--swap-at={at}={}", scratch.path(graph).display())
}

#[test]
fn the_new_graph_makes_the_rows_from_the_stated_time_on() {
    let scratch = desk("at");
    // As the data write it, and so long after the first row.
    for at in ["1200", "200s"] {
        let finished = run(&scratch, &[&swap(&scratch, at, "still.toml")]).ended(0);
        finished.tells(&[
            "3 of 3 nodes go on as they were",
            "took over before tick 21",
        ]);
        let table = table(&finished);
        assert_eq!(table.len(), 31, "no row is lost");
        for (time, predicted, revision) in &table {
            assert_eq!(*revision == table[0].2, *time < 1200.0, "at {time} s");
            assert_eq!(predicted == "0.0", *time >= 1200.0, "at {time} s");
        }
    }
}

#[test]
fn outputs_that_only_one_graph_has_are_empty_while_another_runs() {
    let scratch = desk("columns");
    let more = "schema = 1\nextends = \"graph.toml\"\n[outputs]\nstill = \"model:still\"\n";
    scratch.file("more.toml", more);
    let out = run(&scratch, &[&swap(&scratch, "1200", "more.toml")])
        .ended(0)
        .out;
    let mut lines = out.lines();
    assert_eq!(lines.next(), Some("time_s,predicted.Z,still.Z,revision"));
    for line in lines {
        let cells: Vec<_> = line.split(',').collect();
        let swapped = cells[0].parse::<f64>().unwrap() >= 1200.0;
        assert_eq!(cells[2].is_empty(), !swapped, "{line}");
    }
}

#[test]
fn columns_keep_their_names_where_the_new_graph_gives_its_outputs_in_another_order() {
    let scratch = desk("order");
    let graph = |outputs: [&str; 2]| shown().replace("predicted = \"model\"\n", &outputs.concat());
    let (last, still) = ("last = \"model:same\"\n", "still = \"model:still\"\n");
    scratch.file("graph.toml", graph([last, still]));
    scratch.file("turned.toml", graph([still, last]));
    let swapped = run(&scratch, &[&swap(&scratch, "1200", "turned.toml")]).ended(0);
    swapped.tells(&["took over before tick 21"]);
    let alone = run(&scratch, &[&swap(&scratch, "1200", "graph.toml")]).ended(0);
    assert_eq!(swapped.out, alone.out);
}

#[test]
fn a_graph_that_lacks_outputs_of_what_runs_is_told() {
    let scratch = desk("lacking");
    let other = shown().replace("predicted = \"model\"", "still = \"model:still\"");
    scratch.file("other.toml", other);
    let finished = run(&scratch, &[&swap(&scratch, "1200", "other.toml")]).ended(0);
    finished
        .tells(&["other.toml has no output `predicted.Z`, whose column is empty while it runs"]);
    let same = run(&scratch, &[&swap(&scratch, "1200", "still.toml")]).ended(0);
    assert!(!same.told.contains("has no output"), "{}", same.told);
}

#[test]
fn a_graph_that_looks_back_further_than_the_past_reaches_says_how_far() {
    let scratch = desk("past");
    let long = "schema = 1\nextends = \"graph.toml\"\nname = \"long\"\nnodes.drift = { windows = [\"10min\"] }\n";
    scratch.file("long.toml", long);
    let early = run(&scratch, &[&swap(&scratch, "100s", "long.toml")]).ended(0);
    early.tells(&[
        "drift: warmed by the past",
        "the past to warm it by is 90s, and it looks back as far as",
    ]);
    let short = long.replace("10min", "20s");
    scratch.file("short.toml", short);
    let late = run(&scratch, &[&swap(&scratch, "290s", "short.toml")]).ended(0);
    assert!(!late.told.contains("looks back as far"), "{}", late.told);
}

#[test]
fn what_goes_by_all_of_its_past_is_told_to_know_the_last_of_it() {
    let scratch = desk("endless");
    let voting = |shape: &str| {
        format!(
            "schema = 1\nextends = \"graph.toml\"\nname = \"voting\"\n\
             [nodes.vote]\ntype = \"hedge\"\n{shape}inputs = {{ voters = [\"model:same\", \"model:still\"], truth = \"drift.Z\" }}\n\
             [outputs]\npredicted = \"vote\"\n"
        )
    };
    scratch.file("endless.toml", voting(""));
    scratch.file("fading.toml", voting("half_life = \"10s\"\n"));
    let told = "vote: goes by all of its past, of which 90s is known";
    let endless = run(&scratch, &[&swap(&scratch, "100s", "endless.toml")]).ended(0);
    endless.tells(&[told]);
    let fading = run(&scratch, &[&swap(&scratch, "100s", "fading.toml")]).ended(0);
    assert!(!fading.told.contains("all of its past"), "{}", fading.told);
}

#[test]
fn a_graph_of_another_machine_is_told_by_the_outputs_that_it_leaves_empty() {
    let scratch = desk("silent");
    scratch.file("data.csv", format!("time_s,Z\n{}", rows(1000, 400)));
    let other = "schema = 1\nextends = \"graph.toml\"\nname = \"other\"\n\
                 signals.position = { column = \"other_{channel}\", optional = [\"Z\"] }\n";
    scratch.file("other.toml", other);
    let silent = run(&scratch, &[&swap(&scratch, "3000s", "other.toml")]).ended(0);
    silent.tells(&[
        "other.toml gives no `predicted.Z` over the past",
        "that it was warmed by",
    ]);
    let own = run(&scratch, &[&swap(&scratch, "3000s", "still.toml")]).ended(0);
    assert!(!own.told.contains("gives no"), "{}", own.told);

    // What runs gives none either: that is how this machine is.
    scratch.file(
        "graph.toml",
        shown().replace(
            "channels = [\"Z\"]",
            "channels = [\"Z\"]\noptional = [\"Z\"]\ncolumn = \"none\"",
        ),
    );
    let slower = "schema = 1\nextends = \"graph.toml\"\nname = \"slower\"\nnodes.drift = { windows = [\"40s\"] }\n";
    scratch.file("slower.toml", slower);
    let same = run(&scratch, &[&swap(&scratch, "3000s", "slower.toml")]).ended(0);
    same.tells(&["warmed by the past", "took over"]);
    assert!(!same.told.contains("gives no"), "{}", same.told);
}

#[test]
fn a_worse_graph_is_refused_with_figures_and_a_margin_lets_it_pass() {
    let scratch = desk("shadow");
    let at = swap(&scratch, "1100", "still.toml");
    let refused = run(&scratch, &[&at, "--shadow", "2min"]).ended(0);
    refused.tells(&[
        "in the shadow:\n  predicted.Z: RMSE ",
        " new, in nm/min, over 9 instants\n  new to running: ",
        "still.toml does not take over: its error is larger",
    ]);
    let revisions = |finished: &Finished| {
        let mut revisions: Vec<_> = table(finished).into_iter().map(|row| row.2).collect();
        revisions.dedup();
        revisions.len()
    };
    assert_eq!(revisions(&refused), 1);
    let taken = run(&scratch, &[&at, "--shadow", "2min", "--margin", "10000%"]).ended(0);
    taken.tells(&["took over before tick 23"]);
    assert_eq!(revisions(&taken), 2);
    let early = run(&scratch, &[&at, "--shadow", "10s"]).ended(0);
    early.tells(&["does not take over: there was nothing to compare"]);
    let late = run(&scratch, &[&at, "--shadow", "1h"]).ended(0);
    late.tells(&["still.toml did not take over: the data ended before"]);
}

#[test]
fn a_graph_that_is_due_when_another_takes_over_follows_it() {
    let scratch = desk("due");
    scratch.file("data.csv", format!("time_s,Z\n{}", rows(1000, 61)));
    let (first, second) = (
        swap(&scratch, "1100", "still.toml"),
        swap(&scratch, "1110", "graph.toml"),
    );
    let both = [&*first, &second, "--shadow", "2min", "--margin", "10000%"];
    let finished = run(&scratch, &both).ended(0);
    assert_eq!(finished.told.matches("took over before").count(), 2);
    assert_eq!(table(&finished).len(), 61, "no row is lost");
}

#[test]
fn samples_far_outside_of_those_of_the_fit_are_told_though_another_graph_has_taken_over() {
    let scratch = desk("beyond");
    let model = scratch.path("shown.json");
    let usual = scratch.file("usual.csv", format!("time_s,Z\n{}", rows(1000, 31)));
    athermal(&[
        &"fit",
        &scratch.path("graph.toml"),
        &"--data",
        &usual,
        &"-o",
        &model,
    ])
    .ended(0);
    let text = format!(
        "time_s,Z\n{}",
        rows(1000, 61).replacen("1050,", "1050,99", 1)
    );
    let data = scratch.file("data.csv", text);
    let told = |more: &[&str]| {
        let mut all: Vec<&dyn AsRef<std::ffi::OsStr>> = vec![&"run", &model, &"--input", &data];
        all.extend(more.iter().map(|argument| argument as &dyn AsRef<_>));
        athermal(&all).ended(0).told
    };
    let beyond = "position.Z is between";
    assert!(told(&[]).contains(beyond));
    assert!(told(&[&swap(&scratch, "1300", "still.toml")]).contains(beyond));
}

#[test]
fn what_cannot_be_swapped_is_told_before_the_first_row() {
    let scratch = desk("refused");
    let other_time = "schema = 1\nextends = \"still.toml\"\ntime = { unit = \"ms\" }\n";
    scratch.file("other-time.toml", other_time);
    for (arguments, told) in [
        (
            vec![swap(&scratch, "1200", "other-time.toml")],
            "the new graph reads time from the column `time_s` in steps of 1ms and what runs from the column `time_s` in steps of 1s",
        ),
        (
            vec![swap(&scratch, "noon", "still.toml")],
            "\"noon\" is no time of these data: write it as they do, or as a duration such as 6h",
        ),
        (
            vec!["--swap-at=1200".to_owned()],
            "--swap-at takes TIME=GRAPH, such as 3600=new.toml or 1h=new.toml, found \"1200\"",
        ),
        (
            vec![
                swap(&scratch, "1200", "still.toml"),
                "--margin=5".to_owned(),
            ],
            "expected a percentage such as \"5%\", found \"5\"",
        ),
        (
            vec![
                swap(&scratch, "1200", "still.toml"),
                "--shadow=0s".to_owned(),
            ],
            "expected some time such as \"30min\", found \"0s\"",
        ),
    ] {
        let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
        let finished = run(&scratch, &arguments).ended(2);
        finished.tells(&[told]);
        assert_eq!(finished.out, "", "{told}");
    }
    let nowhere = run(&scratch, &[&swap(&scratch, "1200", "nowhere.toml")]).ended(3);
    nowhere.tells(&["nowhere.toml"]);
    assert_eq!(nowhere.out, "");
}

#[test]
fn a_graph_that_gives_a_column_in_another_unit_is_refused() {
    let scratch = desk("unit");
    let other = "schema = 1\nextends = \"graph.toml\"\nname = \"other\"\nnodes.drift = { unit = \"um/min\" }\n";
    scratch.file("other.toml", other);
    let finished = run(&scratch, &[&swap(&scratch, "1200", "other.toml")]).ended(2);
    finished.tells(&["gives the output `predicted.Z` in um/min and what runs in nm/min"]);
    let mut live = Live::new(&scratch.path("graph.toml"));
    let before = live.revision();
    let graph = shown().replace("nm/min", "um/min");
    scratch.file("graph.toml", graph.replace("\"shown\"", "\"other\""));
    live.stays(&before);
    assert!(live.told().contains("in um/min and what runs in nm/min: "));
}

#[test]
fn a_time_after_the_data_is_told_at_the_end() {
    let scratch = desk("never");
    let finished = run(&scratch, &[&swap(&scratch, "9000", "still.toml")]).ended(0);
    finished.tells(&["still.toml did not take over: the data ended before"]);
}

#[test]
fn a_watched_graph_is_taken_over_when_any_of_its_files_changes() {
    let scratch = desk("watch");
    let own = scratch.file(
        "own.toml",
        "schema = 1\nextends = \"graph.toml\"\nname = \"own\"\n",
    );
    let mut live = Live::new(&own);
    let first = live.revision();
    // The file that it extends; then one from which that takes a module; then its own.
    let slower = shown().replace("windows = [\"30s\"]", "windows = [\"20s\"]");
    scratch.file("graph.toml", &slower);
    let second = live.until_swapped(&first);
    scratch.file("model.toml", module("still"));
    let third = live.until_swapped(&second);
    // A mistake is told, and putting it right is noticed.
    scratch.file("model.toml", "schema = 1\n[modules.model\n");
    live.stays(&third);
    scratch.file("model.toml", module("same"));
    assert_eq!(live.until_swapped(&third), second, "the same graph again");
    scratch.file(
        "own.toml",
        "schema = 1\nextends = \"graph.toml\"\n[outputs]\nmore = \"drift\"\n",
    );
    live.stays(&second);
    let told = live.told();
    for part in [
        "error[A001]",
        "own.toml is not taken over; what runs goes on",
        "own.toml has the output `more.Z`, for which there is no column; what runs goes on",
    ] {
        assert!(told.contains(part), "`{part}` is not in\n{told}");
    }
}

#[test]
fn what_took_over_in_a_run_goes_on_in_the_next() {
    let scratch = desk("kept");
    let (graph, state) = (scratch.path("graph.toml"), scratch.path("state"));
    let kept = ["--state", state.to_str().unwrap()];
    let mut live = Live::going_on(&graph, &kept, 0);
    let first = live.revision();
    let slower = shown().replace("windows = [\"30s\"]", "windows = [\"40s\"]");
    scratch.file("graph.toml", slower);
    let second = live.until_swapped(&first);
    let time = live.time;
    live.told();

    // Forty seconds would have to pass before the first slope of a run that begins cold.
    let mut live = Live::going_on(&graph, &kept, time);
    live.row();
    let line = live.line();
    let [time, slope, revision] = *line.split(',').collect::<Vec<_>>() else {
        panic!("{line}");
    };
    assert_eq!((time, revision), (&*live.time.to_string(), &*second));
    // How many rows passed before the change decides the last digits.
    assert!(
        (slope.parse::<f64>().unwrap() - 60.0).abs() < 1e-9,
        "{line}"
    );

    // Another graph that stands in the file then is a change, as it would be while the run goes on.
    scratch.file("model.toml", module("still"));
    let time = live.time;
    live.told();
    let mut live = Live::going_on(&graph, &kept, time);
    let third = live.until_swapped(&second);
    assert_ne!(third, first);
    let told = live.told();
    for part in [
        "graph.toml is not what ran last: that goes on, and the file is taken as a change of it",
        "took over before",
    ] {
        assert!(told.contains(part), "`{part}` is not in\n{told}");
    }
}

#[test]
fn what_took_over_goes_on_after_a_kill_though_its_file_is_broken_since() {
    let scratch = desk("killed");
    let (graph, state) = (scratch.path("graph.toml"), scratch.path("state"));
    let kept = ["--state", state.to_str().unwrap()];
    let mut live = Live::going_on(&graph, &kept, 0);
    let first = live.revision();
    let slower = shown().replace("windows = [\"30s\"]", "windows = [\"40s\"]");
    scratch.file("graph.toml", &slower);
    let second = live.until_swapped(&first);
    // What took over is kept after its first row has been put out.
    assert_eq!(live.revision(), second);
    let time = live.killed();

    let mut live = Live::going_on(&graph, &kept, time);
    assert_eq!(live.revision(), second);
    let time = live.killed();

    scratch.file("graph.toml", slower.replace("[outputs]", "[outputs"));
    let mut live = Live::going_on(&graph, &kept, time);
    live.stays(&second);
    let told = live.told();
    for part in [
        "error[A001]",
        "graph.toml is not taken over; what ran last goes on",
    ] {
        assert!(told.contains(part), "`{part}` is not in\n{told}");
    }

    // Without what is watched, nothing else than the file is run.
    let refused = run(&scratch, &kept).ended(2);
    refused.tells(&["error[A001]"]);
}

#[test]
fn the_output_of_a_graph_with_fewer_outputs_is_gone_on_with_in_the_columns_that_it_has() {
    let scratch = desk("fewer");
    let (state, out) = (scratch.path("state"), scratch.path("out.csv"));
    let more = shown().to_string() + "still = \"model:still\"\n";
    let graph = scratch.file("graph.toml", &more);
    let arguments: [&dyn AsRef<std::ffi::OsStr>; 9] = [
        &"run", &graph, &"-i", &"-", &"-o", &out, &"--watch", &"--state", &state,
    ];
    let mut child = Command::new(env!("CARGO_BIN_EXE_athermal"))
        .args(arguments.map(|argument| argument.as_ref()))
        .stdin(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let mut feed = child.stdin.take().unwrap();
    feed.write_all(b"time_s,Z\n").unwrap();
    let last = || {
        let text = std::fs::read_to_string(&out).unwrap_or_default();
        text.lines().last().unwrap_or_default().to_owned()
    };
    let (began, mut time) = (Instant::now(), 0);
    while !last().contains(",,") || time < 100 {
        assert!(began.elapsed() < Duration::from_secs(60), "{}", last());
        time += 10;
        feed.write_all(format!("{time},{time}\n").as_bytes())
            .unwrap();
        std::thread::sleep(Duration::from_millis(20));
        if time == 100 {
            scratch.file("graph.toml", shown());
        }
    }
    drop(feed);
    assert!(child.wait().unwrap().success());
    let before = std::fs::read_to_string(&out).unwrap();
    let rows = format!("time_s,Z\n{},1\n", time + 10);
    athermal_fed(&arguments, rows.as_bytes()).ended(0);
    let after = std::fs::read_to_string(&out).unwrap();
    let row = after.strip_prefix(&before).unwrap();
    let cells: Vec<_> = row.trim_end().split(',').collect();
    assert_eq!((cells.len(), cells[2]), (4, ""), "{row}");
}
