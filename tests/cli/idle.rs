//! A service at rest sleeps: it wakes when something arrives or is due, and not to look whether something has.

use std::collections::HashMap;
use std::io::Write;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use crate::services::{HEADER, desk, end, lines, serve};
use crate::workbench::Scratch;

/// A source of two channels or so, with the times that a machine file has by default.
fn service(source: &str) -> String {
    format!("[sources.in]\n{source}\n[sinks.history]\ntype = \"csv\"\npath = \"history.csv\"\n")
}

/// How often each thread of a process gave its processor up by itself so far.
fn switches(child: &Child) -> HashMap<String, u64> {
    let tasks = std::fs::read_dir(format!("/proc/{}/task", child.id())).unwrap();
    let mut all = HashMap::new();
    for task in tasks.map(|of| of.unwrap().path()) {
        // A thread may end meanwhile.
        let status = std::fs::read_to_string(task.join("status")).unwrap_or_default();
        let of = |key: &str| status.lines().find_map(|line| line.strip_prefix(key));
        if let (Some(name), Some(count)) = (of("Name:"), of("voluntary_ctxt_switches:")) {
            let name = format!("{} {}", name.trim(), task.display());
            all.insert(name, count.trim().parse().unwrap());
        }
    }
    all
}

/// What a process has used of a processor so far, in hundredths of a second.
fn used(child: &Child) -> u64 {
    let stat = std::fs::read_to_string(format!("/proc/{}/stat", child.id())).unwrap();
    let fields: Vec<_> = stat
        .rsplit_once(')')
        .unwrap()
        .1
        .split_whitespace()
        .collect();
    fields[11].parse::<u64>().unwrap() + fields[12].parse::<u64>().unwrap()
}

/// Wake-ups a second by thread, and all of them, while `row` gives one a second.
fn at_rest(child: &Child, scratch: &Scratch, mut row: impl FnMut(usize)) {
    let (before, rest, seconds) = (4, 12, 12.0);
    let mut course = (0..before).chain(before..before + rest);
    let mut give = |count: usize| {
        for nth in course.by_ref().take(count) {
            let began = Instant::now();
            row(nth);
            std::thread::sleep(Duration::from_secs(1).saturating_sub(began.elapsed()));
        }
    };
    give(before);
    let (first, cpu) = (switches(child), used(child));
    give(rest);
    let (last, cpu) = (switches(child), used(child) - cpu);
    let rates = last.into_iter().filter_map(|(name, count)| {
        let count = count - first.get(&name)?;
        Some((name, count as f64 / seconds))
    });
    let mut rates: Vec<_> = rates.collect();
    rates.sort_by(|one, other| other.1.total_cmp(&one.1));
    let all: f64 = rates.iter().map(|(_, rate)| rate).sum();
    let percent = cpu as f64 / seconds;
    println!("{all:.1} wake-ups a second, {percent:.2} % of a processor: {rates:?}");
    assert!(all <= 20.0, "{all:.1} wake-ups a second: {rates:?}");
    assert!(percent <= 0.5, "{percent:.2} % of a processor");
    assert!(lines(&scratch.path("history.csv")) >= before + rest - 2);
}

#[test]
#[ignore = "runs alone, so that what wakes is its own: `cargo test --test cli idle -- --ignored`"]
#[cfg(target_os = "linux")]
fn a_service_that_is_given_a_row_a_second_through_a_pipe_sleeps_until_it_comes() {
    let scratch = desk("idle-pipe", &service("type = \"stdin\""));
    let mut child = Command::new(env!("CARGO_BIN_EXE_athermal"))
        .args(["serve"])
        .arg(scratch.path("line.toml"))
        .stdin(Stdio::piped())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut pipe = child.stdin.take().unwrap();
    pipe.write_all(HEADER.as_bytes()).unwrap();
    at_rest(&child, &scratch, |nth| {
        let row = format!("{nth},20.5,21.{nth},100\n");
        pipe.write_all(row.as_bytes()).unwrap();
    });
    // Nothing more comes, and it is awake at once where it is to end.
    let began = Instant::now();
    end(child);
    assert!(began.elapsed() < Duration::from_secs(3));
}

#[test]
#[ignore = "runs alone, so that what wakes is its own: `cargo test --test cli idle -- --ignored`"]
#[cfg(target_os = "linux")]
fn a_service_that_follows_a_file_sleeps_while_it_does_not_grow() {
    let scratch = desk("idle-file", &service("type = \"csv\"\npath = \"log.csv\""));
    scratch.file("log.csv", HEADER);
    let child = serve(&scratch, &[]);
    at_rest(&child, &scratch, |nth| {
        let file = std::fs::File::options()
            .append(true)
            .open(scratch.path("log.csv"));
        let row = format!("{nth},20.5,21.{nth},100\n");
        file.unwrap().write_all(row.as_bytes()).unwrap();
    });
    end(child);
}
