//! A run that is restarted where its source gives only what is new, as a controller does: what it reads then, and what it tells. What a
//! node keeps is decided elsewhere.

use std::path::Path;

use crate::workbench::{Finished, Scratch, athermal, athermal_fed};

/// A temperature, by the clock on a wall in Berlin.
const BERLIN: &str = r#"
schema = 1
name = "berlin"
time = { column = "t", format = "%Y-%m-%d %H:%M:%S", zone = "Europe/Berlin" }
signals.room = { unit = "Cel", channels = ["a"], max_age = "1h" }
outputs.room = "room"
"#;

/// The same by a clock of seconds.
const SECONDS: &str = r#"
schema = 1
name = "seconds"
signals.room = { unit = "Cel", channels = ["a"], max_age = "1min" }
outputs.room = "room"
"#;

/// Two temperatures, of which a line may have either.
const BOTH: &str = r#"
schema = 1
name = "both"
signals.room = { unit = "Cel", channels = ["a", "b"], max_age = "1min" }
outputs.room = "room"
"#;

/// Runs a graph on rows of a pipe, with a state and more options.
fn run(graph: &Path, state: &Path, more: &[&dyn AsRef<std::ffi::OsStr>], text: &str) -> Finished {
    let mut arguments: Vec<&dyn AsRef<std::ffi::OsStr>> =
        vec![&"run", &graph, &"-i", &"-", &"--state", &state];
    arguments.extend(more);
    athermal_fed(&arguments, text.as_bytes())
}

/// Rows below the name of the time, which are numbered in their only value.
fn log(time: &str, times: &[&str]) -> String {
    let rows = times.iter().enumerate();
    let rows = rows.map(|(nth, at)| format!("{at},{nth}\n"));
    format!("{time},a\n{}", rows.collect::<String>())
}

/// Times of the night in which the clocks go back from three to two.
fn night(clock: &[&str]) -> Vec<String> {
    let clock = clock.iter();
    clock.map(|at| format!("2026-10-25 {at}:00")).collect()
}

/// The times of the rows that came out.
fn times(out: &str) -> Vec<&str> {
    let rows = out.lines().skip(1);
    rows.map(|row| row.split_once(',').unwrap().0).collect()
}

#[test]
fn in_the_hour_that_comes_twice_a_run_goes_on_where_it_was() {
    let scratch = Scratch::new("restarted-pipes-twice");
    let (graph, state) = (scratch.file("g.toml", BERLIN), scratch.path("state"));
    let clock = [
        "02:52", "02:56", "02:00", "02:04", "02:08", "02:12", "02:16",
    ];
    let all = night(&clock);
    let all: Vec<&str> = all.iter().map(String::as_str).collect();
    // In the first pass of the hour, at its end, and in the second.
    for cut in 1..all.len() {
        let _ = std::fs::remove_file(&state);
        let first = run(&graph, &state, &[], &log("t", &all[..cut])).ended(0);
        let second = run(&graph, &state, &[], &log("t", &all[cut..])).ended(0);
        assert_eq!(times(&first.out), all[..cut]);
        assert_eq!(times(&second.out), all[cut..], "{cut}: {}", second.told);
        assert!(!second.told.contains("warning"), "{}", second.told);
    }
}

#[test]
fn an_output_that_ends_in_the_hour_that_comes_twice_gets_no_row_again_nor_lacks_one() {
    let scratch = Scratch::new("restarted-pipes-twice-output");
    let graph = scratch.file("g.toml", BERLIN);
    let clock = [
        "01:56", "02:00", "02:04", "02:56", "02:00", "02:04", "02:08", "03:00",
    ];
    let all = night(&clock);
    let all: Vec<&str> = all.iter().map(String::as_str).collect();
    // From what begins before the hour and in its first pass.
    for (begin, ending) in [(0, "csv"), (1, "csv"), (0, "jsonl")] {
        let all = &all[begin..];
        let state = scratch.path("state");
        let out = scratch.path(&format!("out.{ending}"));
        let to: [&dyn AsRef<std::ffi::OsStr>; 2] = [&"-o", &out];
        let read = || std::fs::read_to_string(&out).unwrap();
        for cut in 2..all.len() {
            let _ = (std::fs::remove_file(&state), std::fs::remove_file(&out));
            run(&graph, &state, &to, &log("t", &all[..1])).ended(0);
            let kept = std::fs::read(&state).unwrap();
            run(&graph, &state, &to, &log("t", &all[1..cut])).ended(0);
            // As after a kill: the state is from after the first row, and the whole log is given again.
            std::fs::write(&state, kept).unwrap();
            if begin == 0 {
                run(&graph, &state, &to, &log("t", all)).ended(0);
            } else {
                let whole = scratch.file("log.csv", log("t", all));
                athermal(&[
                    &"run", &graph, &"-i", &whole, &"-o", &out, &"--state", &state,
                ])
                .ended(0);
            }
            let rows = read();
            let written: Vec<&str> = rows
                .lines()
                .filter_map(|row| row.find("2026").map(|at| &row[at..at + all[0].len()]))
                .collect();
            assert_eq!(written, all, "{begin} {ending} {cut}");
        }
    }
}

#[test]
fn the_first_row_after_a_restart_is_guarded_against_a_wrong_time_as_any_other() {
    let scratch = Scratch::new("restarted-pipes-leap");
    let graph = scratch.file("g.toml", SECONDS);
    for more in [&[][..], &[&"--watch" as &dyn AsRef<std::ffi::OsStr>]] {
        let state = scratch.path(&format!("state{}", more.len()));
        run(&graph, &state, more, &log("time_s", &["0", "10"])).ended(0);
        let second = run(&graph, &state, more, &log("time_s", &["99999", "30", "40"])).ended(0);
        assert_eq!(times(&second.out), ["30", "40"]);
        second.tells(&["the time `99999` is far after `10 s`, and the next one, `30`, is not"]);
        let third = run(&graph, &state, more, &log("time_s", &["50", "60"])).ended(0);
        assert_eq!(times(&third.out), ["50", "60"]);
        // After a gap the rows say the same.
        let after = run(&graph, &state, more, &log("time_s", &["9000", "9010"])).ended(0);
        assert_eq!(times(&after.out), ["9000", "9010"]);
        // A single row does not say how far apart rows are.
        let single = run(&graph, &state, more, &log("time_s", &["9900"])).ended(0);
        assert_eq!(times(&single.out), ["9900"]);
        // A log that is given again from its beginning tells nothing of its time.
        let again = ["0", "10", "30", "9900", "9910"];
        let again = run(&graph, &state, more, &log("time_s", &again)).ended(0);
        assert_eq!(times(&again.out), ["9910"]);
        assert!(!again.told.contains("warning"), "{}", again.told);
    }
}

#[test]
fn lines_that_end_before_each_key_has_come_once_end_a_live_run_in_order() {
    let scratch = Scratch::new("restarted-pipes-keys");
    let graph = scratch.file("g.toml", BOTH);
    for more in [&[][..], &[&"--watch" as &dyn AsRef<std::ffi::OsStr>]] {
        let state = scratch.path(&format!("state{}", more.len()));
        let first = "{\"time_s\":0,\"a\":1}\n{\"time_s\":1,\"a\":2}\n";
        let first = run(&graph, &state, more, first).ended(0);
        assert_eq!(times(&first.out), ["0", "1"]);
        assert_eq!(first.told.matches("there is no column `b`").count(), 1);
        first.tells(&["(missing until a line has it)"]);
        let second = "{\"time_s\":1,\"a\":2}\n{\"time_s\":2,\"b\":2}\n";
        let second = run(&graph, &state, more, second).ended(0);
        assert_eq!(times(&second.out), ["2"], "{}", second.told);
    }
    // A file has an end by which to tell that the key is misspelt.
    let file = scratch.file("log.jsonl", "{\"time_s\":0,\"a\":1,\"bb\":1}\n");
    let told = athermal(&[&"run", &graph, &"-i", &file]).ended(2);
    told.tells(&["there is no column `b`", "did you mean `bb`?"]);
}

#[test]
fn a_run_that_ends_on_a_row_that_cannot_be_read_keeps_what_it_knows() {
    let scratch = Scratch::new("restarted-pipes-unreadable");
    let graph = scratch.file("g.toml", SECONDS);
    for more in [&[][..], &[&"--watch" as &dyn AsRef<std::ffi::OsStr>]] {
        let (state, out) = (scratch.path("state"), scratch.path("out.csv"));
        let _ = (std::fs::remove_file(&state), std::fs::remove_file(&out));
        let mut arguments: Vec<&dyn AsRef<std::ffi::OsStr>> = vec![&"-o", &out];
        arguments.extend(more);
        let first = "time_s,a\n0,1\n1,1\n2,1\nnever,1\n3,1\n";
        let first = run(&graph, &state, &arguments, first).ended(2);
        first.tells(&["expected a decimal number, found `never`"]);
        assert_eq!(
            times(&std::fs::read_to_string(&out).unwrap()),
            ["0", "1", "2"]
        );
        let second = run(&graph, &state, &arguments, "time_s,a\n1,1\n2,1\n3,1\n").ended(0);
        second.tells(&["the row of 1 was seen by the run before"]);
        assert!(!second.told.contains("warning"), "{}", second.told);
        assert_eq!(
            times(&std::fs::read_to_string(&out).unwrap()),
            ["0", "1", "2", "3"]
        );
    }
}

#[test]
fn a_run_tells_that_its_output_does_not_end_where_the_run_before_did() {
    let scratch = Scratch::new("restarted-pipes-apart");
    let graph = scratch.file("g.toml", SECONDS);
    let (state, out) = (scratch.path("state"), scratch.path("out.csv"));
    let to: [&dyn AsRef<std::ffi::OsStr>; 2] = [&"-o", &out];
    run(&graph, &state, &to, "time_s,a\n0,1\n").ended(0);
    let kept = std::fs::read(&state).unwrap();
    run(&graph, &state, &to, "time_s,a\n10,1\n20,1\n").ended(0);
    // As after a kill: rows stand there of which the state knows nothing, and the pipe goes on behind them.
    std::fs::write(&state, &kept).unwrap();
    let ahead = run(&graph, &state, &to, "time_s,a\n30,1\n").ended(0);
    ahead.tells(&[
        "warning: ",
        "out.csv: its last row is 20s after what the run before kept: what this run does not read again of that time it does not know",
    ]);
    // A file is read again.
    std::fs::write(&state, kept).unwrap();
    let log = scratch.file("log.csv", "time_s,a\n0,1\n10,1\n20,1\n30,1\n40,1\n");
    let whole = athermal(&[&"run", &graph, &"-i", &log, &"--state", &state, &"-o", &out]);
    assert!(!whole.ended(0).told.contains("warning"));
    for gone in [None, Some("time_s,room.a\n")] {
        match gone {
            None => std::fs::remove_file(&out).unwrap(),
            Some(header) => std::fs::write(&out, header).unwrap(),
        }
        let told = run(&graph, &state, &to, "time_s,a\n40,1\n").ended(0);
        told.tells(&[
            "warning: ",
            "out.csv: none of the rows up to 40 s stand there, which the run before saw: what was predicted stands in another file, or \
             is lost",
        ]);
    }
    let elsewhere = run(&graph, &state, &[], "time_s,a\n40,1\n").ended(0);
    assert!(!elsewhere.told.contains("warning"), "{}", elsewhere.told);
}
