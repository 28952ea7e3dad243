//! A run beside a machine that gets a signal to stop ends as at the end of its input: what came of it is out, and nothing of what it knows is
//! lost.

#![cfg(unix)]
use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::time::{Duration, Instant};

use crate::workbench::{Graph, Scratch, athermal, athermal_fed};

fn drift() -> Graph {
    Graph::named("stopped")
        .time("time_s")
        .signal("position", "nm", "Z", "3min")
        .with("column = '{channel}'")
        .slope("drift", "position", "30s", "nm/min")
        .outputs("now = 'drift'")
}

/// Rows from one number to before another; every tenth cell is none.
fn rows(from: u32, to: u32) -> String {
    let cell = |nth: u32| match nth % 10 {
        9 => "off".to_owned(),
        _ => format!("{}", nth * nth % 17),
    };
    (from..to)
        .map(|nth| format!("{},{}\n", 10 * nth, cell(nth)))
        .collect()
}

/// A run whose input goes on.
struct Live {
    child: Child,
    rows: ChildStdin,
    out: BufReader<ChildStdout>,
}

impl Live {
    fn new(scratch: &Scratch, more: &[&str]) -> Self {
        let program = Command::new(env!("CARGO_BIN_EXE_athermal"));
        Self::by(program, scratch, more)
    }

    fn by(mut program: Command, scratch: &Scratch, more: &[&str]) -> Self {
        let mut child = program
            .arg("run")
            .arg(scratch.path("graph.toml"))
            .args(["--input", "-", "--lenient", "--state"])
            .arg(scratch.path("state"))
            .args(more)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        Self {
            rows: child.stdin.take().unwrap(),
            out: BufReader::new(child.stdout.take().unwrap()),
            child,
        }
    }

    /// Feeds rows, and waits until so many lines have come of them.
    fn feed(&mut self, text: &str, lines: usize) -> String {
        self.rows.write_all(text.as_bytes()).unwrap();
        self.rows.flush().unwrap();
        let mut read = String::new();
        for _ in 0..lines {
            self.out.read_line(&mut read).unwrap();
        }
        read
    }

    fn tell(&self, signal: &str) {
        let told = Command::new("kill")
            .args(["-s", signal, &self.child.id().to_string()])
            .status();
        assert!(told.unwrap().success());
    }

    /// The status, what else was put out, and what was told, while the input is still open.
    fn ended(mut self) -> (Option<i32>, String, String) {
        let (mut rest, mut told) = (String::new(), String::new());
        self.out.read_to_string(&mut rest).unwrap();
        let mut stderr = self.child.stderr.take().unwrap();
        stderr.read_to_string(&mut told).unwrap();
        (self.child.wait().unwrap().code(), rest, told)
    }
}

fn desk(test: &str) -> Scratch {
    let scratch = Scratch::new(&format!("stopped-{test}"));
    scratch.file("graph.toml", drift());
    scratch
}

#[test]
fn a_run_that_is_told_to_stop_ends_in_order_and_the_next_goes_on_from_there() {
    let hangup = cfg!(target_os = "linux").then_some(("HUP", &[][..]));
    let signals = [("TERM", &[][..]), ("INT", &["--watch"][..])];
    for (signal, more) in signals.into_iter().chain(hangup) {
        let scratch = desk(signal);
        let names = "time_s,Z\n".to_owned();
        let mut live = Live::new(&scratch, more);
        let first = live.feed(&(names.clone() + &rows(0, 50)), 51);
        // What is begun is no row yet.
        live.rows.write_all(b"500,1").unwrap();
        live.tell(signal);
        if signal == "HUP" {
            // A session that closes hangs up more than once.
            live.tell(signal);
        }
        let (status, rest, told) = live.ended();
        assert_eq!((status, rest.as_str()), (Some(0), ""), "{told}");
        assert!(told.contains("5 × unreadable cell"), "{told}");
        assert!(told.contains("stopped: what had been read"), "{told}");
        assert!(!told.contains("(`--lenient`)"), "{told}");

        let (graph, state) = (scratch.path("graph.toml"), scratch.path("state"));
        let mut arguments: Vec<&dyn AsRef<std::ffi::OsStr>> =
            vec![&"run", &graph, &"-i", &"-", &"--lenient"];
        arguments.extend(more.iter().map(|more| more as &dyn AsRef<std::ffi::OsStr>));
        let whole = athermal_fed(&arguments, (names.clone() + &rows(0, 100)).as_bytes()).ended(0);
        arguments.extend([&"--state" as &dyn AsRef<std::ffi::OsStr>, &state]);
        let after = athermal_fed(&arguments, (names + &rows(50, 100)).as_bytes()).ended(0);
        let after = after.out.split_once('\n').unwrap().1.to_owned();
        assert_eq!(first + &after, whole.out, "{signal}");
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_run_that_is_told_to_stop_before_anything_came_is_fine() {
    let scratch = desk("early");
    let live = Live::new(&scratch, &[]);
    // One thread runs, one reads and one listens; until then a signal ends the program as it does any other.
    let threads = format!("/proc/{}/task", live.child.id());
    while std::fs::read_dir(&threads).unwrap().count() < 3 {
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    live.tell("TERM");
    let (status, rest, told) = live.ended();
    assert_eq!((status, rest.as_str()), (Some(0), ""), "{told}");
    assert!(!told.contains("error"), "{told}");
}

/// As with `nohup`.
#[test]
fn a_run_that_ignores_a_hangup_goes_on_with_it() {
    let scratch = desk("nohup");
    let mut program = Command::new("sh");
    let ignoring = "trap '' HUP; exec \"$0\" \"$@\"";
    program.args(["-c", ignoring, env!("CARGO_BIN_EXE_athermal")]);
    let mut live = Live::by(program, &scratch, &[]);
    live.feed(&("time_s,Z\n".to_owned() + &rows(0, 10)), 11);
    live.tell("HUP");
    std::thread::sleep(std::time::Duration::from_millis(100));
    live.feed(&rows(10, 20), 10);
    live.tell("TERM");
    let (status, rest, told) = live.ended();
    assert_eq!((status, rest.as_str()), (Some(0), ""), "{told}");
}

#[test]
fn a_file_that_a_run_keeps_or_writes_is_refused_to_another_until_the_first_is_dead() {
    let scratch = desk("held");
    let (graph, state, out) = (
        scratch.path("graph.toml"),
        scratch.path("state"),
        scratch.path("out.csv"),
    );
    let mut live = Live::new(&scratch, &["--watch"]);
    live.feed(&("time_s,Z\n".to_owned() + &rows(0, 10)), 11);
    let more: [&dyn AsRef<std::ffi::OsStr>; 6] = [&"run", &graph, &"-i", &"-", &"--state", &state];
    let refused = athermal_fed(&more, b"time_s,Z\n500,1\n").ended(3);
    refused.tells(&[
        "state: another run keeps its state there",
        "end that one first, or name another file with `--state`",
    ]);
    assert_eq!(refused.out, "");
    live.child.kill().unwrap();
    live.child.wait().unwrap();
    athermal_fed(&more, b"time_s,Z\n500,1\n").ended(0);
    assert!(!scratch.path("state.held").exists());

    let output = out.display().to_string();
    let mut live = Live::new(&scratch, &["-o", &output]);
    live.rows.write_all(b"time_s,Z\n600,1\n").unwrap();
    let begun = || std::fs::read_to_string(&out).is_ok_and(|text| text.contains("600"));
    while !begun() {
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    let other = [&more[..4], &[&"-o" as &dyn AsRef<_>, &out]].concat();
    let refused = athermal_fed(&other, b"time_s,Z\n500,1\n").ended(3);
    refused.tells(&[
        "out.csv: another run writes it",
        "name another file with `--output`",
    ]);
    assert!(begun(), "it stays as it is");
    live.tell("TERM");
    assert_eq!(live.ended().0, Some(0));
    athermal_fed(&other, b"time_s,Z\n500,1\n").ended(0);
}

#[test]
fn an_output_that_is_moved_while_it_is_written_is_told() {
    let scratch = desk("moved");
    let out = scratch.path("out.csv");
    let output = out.display().to_string();
    for is_moved in [true, false] {
        let mut live = Live::new(&scratch, &["-o", &output]);
        let from = if is_moved { 0 } else { 100 };
        let text = "time_s,Z\n".to_owned() + &rows(from, from + 10);
        live.rows.write_all(text.as_bytes()).unwrap();
        let last = format!("\n{},", 10 * (from + 9));
        while !std::fs::read_to_string(&out).is_ok_and(|text| text.contains(&last)) {
            std::thread::sleep(std::time::Duration::from_millis(20));
        }
        if is_moved {
            std::fs::rename(&out, scratch.path("rotated.csv")).unwrap();
            std::fs::write(&out, "").unwrap();
        }
        live.rows
            .write_all(rows(from + 10, from + 12).as_bytes())
            .unwrap();
        live.tell("TERM");
        let (status, _, told) = live.ended();
        assert_eq!(status, Some(0), "{told}");
        let words = "out.csv was removed, moved or replaced while it is written";
        assert_eq!(told.contains(words), is_moved, "{told}");
    }
}

#[test]
fn an_input_that_ends_ends_the_run_as_before() {
    let scratch = desk("whole");
    let log = scratch.file("log.csv", format!("time_s,Z\n{}", rows(0, 100)));
    let graph = scratch.path("graph.toml");
    let of_file = athermal(&[&"run", &graph, &"-i", &log, &"--lenient"]).ended(0);
    let text = std::fs::read(&log).unwrap();
    let piped = athermal_fed(&[&"run", &graph, &"-i", &"-", &"--lenient"], &text).ended(0);
    assert_eq!(of_file.out, piped.out);
}

#[test]
fn what_is_simulated_is_a_whole_file_or_the_one_that_was_there() {
    let scratch = Scratch::new("simulated-whole");
    let log = scratch.file("log.csv", "what was there\n");
    let aside = scratch.path(".part-log.csv");
    let mut child = Command::new(env!("CARGO_BIN_EXE_athermal"))
        .args(["simulate", "die-tester", "--days", "3000", "-q", "-o"])
        .arg(&log)
        .spawn()
        .unwrap();
    let is_begun = || fs::metadata(&aside).is_ok_and(|of| of.len() > 100_000);
    let began = Instant::now();
    while !is_begun() {
        assert!(
            began.elapsed() < Duration::from_secs(60),
            "nothing is written"
        );
        std::thread::sleep(Duration::from_millis(5));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    assert_eq!(fs::read_to_string(&log).unwrap(), "what was there\n");
    athermal(&[&"simulate", &"die-tester", &"--days", &"0.01", &"-o", &log]).ended(0);
    assert!(fs::read_to_string(&log).unwrap().starts_with("time_s,"));
    assert!(!aside.exists());
    let nowhere = scratch.path("nowhere/log.csv");
    let failed = athermal(&[
        &"simulate",
        &"die-tester",
        &"--days",
        &"0.01",
        &"-o",
        &nowhere,
    ]);
    failed.ended(3).tells(&["nowhere/log.csv: No such file"]);
}
