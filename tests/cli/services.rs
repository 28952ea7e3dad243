//! A service as a user runs it: `athermal serve`, killed, restarted, given bad rows, replayed, and its journal as data.

use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::RecvTimeoutError;
use std::time::{Duration, Instant};

use athermal::core::prng::Prng;

use crate::workbench::{Scratch, athermal, athermal_fed, graph, simulated};

const GRAPH: &str = r#"
schema = 1
name = "line"
time = { column = "time_s", unit = "s" }
signals.temperature = { unit = "Cel", channels = ["plate", "room"], max_age = "3s" }
signals.position = { unit = "nm", channels = ["Z"], max_age = "3s" }
nodes.trend = { type = "slope", inputs.signal = "temperature", windows = ["2s", "7s"] }
nodes.masses = { type = "first_order", inputs.signal = "temperature", time_constants = ["3s", "1min"] }
nodes.drift = { type = "slope", inputs.signal = "position", windows = ["7s"], unit = "nm/min" }
outputs.trend = "trend"
outputs.masses = "masses"
outputs.drift = "drift"
"#;

pub const SERVICE: &str = r#"
[runtime]
wait = "20 ms"
settle = "0 s"
checkpoint = "100 ms"

[sources.log]
type = "csv"
path = "log.csv"

[sinks.history]
type = "csv"
path = "history.csv"
"#;

pub const HEADER: &str = "time_s,plate,room,Z\n";

/// Rows of a log, some with holes, from one number to before another.
pub fn rows(from: usize, to: usize) -> String {
    let mut text = String::new();
    for nth in from..to {
        let mut prng = Prng::stream(nth as u64, "services");
        let cell = |value: f64, hole: bool| match hole {
            true => String::new(),
            false => format!("{value:.4}"),
        };
        let plate = cell(20.0 + prng.uniform(), nth % 7 == 3);
        let room = cell(21.0 + prng.uniform(), nth % 11 == 5);
        let z = cell(100.0 * prng.uniform(), nth % 5 == 1);
        text += &format!("{}.{},{plate},{room},{z}\n", nth / 10, nth % 10);
    }
    text
}

pub fn desk(name: &str, service: &str) -> Scratch {
    let scratch = Scratch::new(&format!("service-{name}"));
    scratch.file("graph.toml", GRAPH);
    scratch.file(
        "line.toml",
        format!("schema = 1\nextends = \"graph.toml\"\n{service}"),
    );
    scratch
}

pub fn serve(scratch: &Scratch, more: &[&str]) -> Child {
    Command::new(env!("CARGO_BIN_EXE_athermal"))
        .args(["serve"])
        .arg(scratch.path("line.toml"))
        .args(more)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

/// How many whole rows stand in a file.
pub fn lines(path: &Path) -> usize {
    let text = std::fs::read(path).unwrap_or_default();
    let ends = text.iter().filter(|byte| **byte == b'\n').count();
    ends.saturating_sub(1)
}

/// Waits until so many rows stand in a file.
pub fn until_rows(path: &Path, rows: usize, child: &mut Child) {
    let began = Instant::now();
    while lines(path) < rows {
        let ended = child.try_wait().unwrap();
        assert!(ended.is_none(), "{}", told(child));
        let so_far = lines(path);
        assert!(began.elapsed() < Duration::from_secs(60), "{so_far} rows");
        std::thread::sleep(Duration::from_millis(2));
    }
}

fn told(child: &mut Child) -> String {
    let mut text = String::new();
    if let Some(mut stderr) = child.stderr.take() {
        let _ = std::io::Read::read_to_string(&mut stderr, &mut text);
    }
    text
}

/// What a service reports, up to given words.
pub fn until_reported(child: &mut Child, words: &str) -> String {
    // One that never reports it is ended, so that the test does not wait for ever.
    let (id, (_reported, is_reported)) = (child.id().to_string(), std::sync::mpsc::channel::<()>());
    std::thread::spawn(move || {
        let patience = Duration::from_secs(60);
        if is_reported.recv_timeout(patience) == Err(RecvTimeoutError::Timeout) {
            let _ = Command::new("kill").args(["-s", "KILL", &id]).status();
        }
    });
    let stderr = child.stderr.as_mut().unwrap();
    let (mut text, mut byte) = (Vec::new(), [0]);
    while !String::from_utf8_lossy(&text).contains(words) {
        let came = std::io::Read::read(stderr, &mut byte).unwrap();
        assert!(came == 1, "{}", String::from_utf8_lossy(&text));
        text.push(byte[0]);
    }
    String::from_utf8(text).unwrap()
}

/// Asks a service to end, and gives what it reported.
pub fn end(mut child: Child) -> String {
    let status = Command::new("kill")
        .args(["-s", "INT", &child.id().to_string()])
        .status();
    assert!(status.unwrap().success());
    let text = told(&mut child);
    assert_eq!(child.wait().unwrap().code(), Some(0), "{text}");
    text
}

/// What `run` gives of the same rows, with the column of revisions left out.
pub fn by_run(scratch: &Scratch) -> String {
    let (graph, log) = (scratch.path("graph.toml"), scratch.path("log.csv"));
    plain(&athermal(&[&"run", &graph, &"--input", &log]).ended(0).out)
}

/// Rows with times as plain numbers: a run writes them as the log has them.
fn plain(text: &str) -> String {
    let line = |line: &str| {
        let (time, rest) = line.split_once(',').unwrap();
        let time = time
            .parse()
            .map_or(time.to_owned(), |of: f64| of.to_string());
        format!("{time},{rest}\n")
    };
    text.lines().map(line).collect()
}

/// What a service wrote, without the column of revisions.
pub fn history(scratch: &Scratch) -> String {
    without_revisions(&std::fs::read_to_string(scratch.path("history.csv")).unwrap())
}

fn without_revisions(text: &str) -> String {
    let line = |line: &str| line.rsplit_once(',').unwrap().0.to_owned() + "\n";
    plain(&text.lines().map(line).collect::<String>())
}

#[test]
fn a_service_gives_what_a_run_gives_and_its_journal_what_the_log_gives() {
    let scratch = desk("run", SERVICE);
    scratch.file("log.csv", &(HEADER.to_owned() + &rows(0, 600)));
    let mut child = serve(&scratch, &[]);
    until_rows(&scratch.path("history.csv"), 600, &mut child);
    let text = end(child);
    assert!(text.contains("the service begins cold"), "{text}");
    assert!(text.contains("600 ticks so far"), "{text}");
    assert!(history(&scratch) == by_run(&scratch));

    let state = scratch.path("line.state");
    let replayed = athermal(&[&"replay", &state, &"--check"]).ended(0);
    let words = "600 ticks stepped again, to the same bits";
    assert!(replayed.told.contains(words), "{}", replayed.told);

    // The journal is a recording: what is diagnosed of it is what is diagnosed of the log.
    let (graph, log) = (scratch.path("graph.toml"), scratch.path("log.csv"));
    let journal = format!("journal:{}", state.display());
    let of = |data: &dyn AsRef<std::ffi::OsStr>| {
        let arguments: &[&dyn AsRef<std::ffi::OsStr>] =
            &[&"diagnose", &graph, &"--data", data, &"--format", &"json"];
        let text = athermal(arguments).out;
        text.replace(&journal, "DATA")
            .replace(&*log.to_string_lossy(), "DATA")
    };
    assert_eq!(of(&journal), of(&log));
}

#[test]
fn a_service_of_standard_input_and_output_gives_the_rows_of_a_run_bit_for_bit() {
    let pipes = "[runtime]\nwait = \"0 s\"\nsettle = \"0 s\"\n[sources.in]\ntype = \"stdin\"\n[sinks.out]\ntype = \"stdout\"\n";
    let scratch = desk("pipes", pipes);
    // More than a sink has room for.
    let log = HEADER.to_owned() + &rows(0, 20_000);
    scratch.file("log.csv", &log);
    let served = athermal_fed(&[&"serve", &scratch.path("line.toml")], log.as_bytes()).ended(0);
    let rows = without_revisions(&served.out);
    assert_eq!(rows.lines().count(), 20_001);
    assert!(rows == by_run(&scratch));
    let graph = scratch.path("graph.toml");
    let piped = athermal_fed(&[&"run", &graph, &"--input", &"-"], log.as_bytes()).ended(0);
    assert!(rows == plain(&piped.out));
}

/// An hour of a simulated machine, measured by a service, replayed, evaluated, and run from the same hour as a file.
#[test]
fn the_ticks_of_a_simulated_live_hour_are_those_of_its_replay_its_evaluation_and_a_run() {
    let scratch = Scratch::new("service-hour");
    let service = "[runtime]\nwait = \"0 s\"\nsettle = \"0 s\"\n\
        [sources.machine]\ntype = \"simulation\"\nmachine = \"die-tester\"\nspeed = \"fastest\"\nseed = 3\ndays = 0.0416666667\n\
        [sinks.history]\ntype = \"csv\"\npath = \"history.csv\"\n";
    let week = simulated(&scratch, "week.csv", "die-tester", 3.0, 2);
    let hour = simulated(&scratch, "log.csv", "die-tester", 1.0 / 24.0, 3);
    let model = scratch.path("model.json");
    athermal(&[
        &"fit",
        &graph("die-tester"),
        &"--data",
        &week,
        &"--output",
        &model,
    ])
    .ended(0);
    let machine = scratch.path("line.toml");
    let text = format!(
        "schema = 1\nextends = {:?}\nmodel = \"model.json\"\n{service}",
        graph("die-tester")
    );
    scratch.file("line.toml", text);
    athermal(&[&"serve", &machine]).ended(0);
    let ran = athermal(&[&"run", &model, &"--input", &hour]).ended(0).out;
    assert_eq!(ran.lines().count(), 361);
    assert!(history(&scratch) == plain(&ran));

    let (state, again) = (scratch.path("line.state"), scratch.path("again.csv"));
    athermal(&[&"replay", &state, &"--check", &"--output", &again]).ended(0);
    assert!(plain(&std::fs::read_to_string(&again).unwrap()) == plain(&ran));

    let journal = format!("journal:{}", state.display());
    let evaluated = |data: &dyn AsRef<std::ffi::OsStr>| {
        let arguments: &[&dyn AsRef<std::ffi::OsStr>] =
            &[&"evaluate", &model, &"--data", data, &"--format", &"json"];
        let text = athermal(arguments).ended(0).out;
        text.replace(&journal, "DATA")
            .replace(&*hour.to_string_lossy(), "DATA")
    };
    let of_the_file = evaluated(&hour);
    assert!(of_the_file.contains("rmse"), "{of_the_file}");
    assert_eq!(evaluated(&journal), of_the_file);
}

#[test]
fn a_service_that_is_killed_at_random_instants_loses_no_row_and_puts_none_out_twice() {
    killed("kills", SERVICE, 30);
}

#[test]
fn a_service_that_is_killed_while_its_sink_changes_files_has_each_row_once_over_all_of_them() {
    killed_while_rotating("kills-rotated", 15);
}

#[test]
#[ignore = "runs alone, for a minute: `cargo test --test cli often_killed -- --ignored`"]
fn an_often_killed_service_loses_no_row_and_puts_none_out_twice() {
    killed("often-killed", SERVICE, often(200));
    killed_while_rotating("often-killed-rotated", often(100));
}

/// So many kills, or ten times as many in the long mode.
fn often(kills: usize) -> usize {
    match std::env::var_os("ATHERMAL_LONG") {
        Some(_) => 10 * kills,
        None => kills,
    }
}

/// A service whose log has a new file each few rows.
fn killed_while_rotating(name: &str, kills: usize) {
    let rotated = SERVICE.replace("history.csv\"", "history.csv\"\nrotate = \"2 kB\"");
    let scratch = killed(name, &rotated, kills);
    let full = all_of(&scratch).len() - 1;
    println!("{full} files were full");
    assert!(full > 2 * kills, "{full}");
}

/// The files of a sink, in order, the one that is written last.
fn all_of(scratch: &Scratch) -> Vec<std::path::PathBuf> {
    let folder = scratch.path("history.csv").parent().unwrap().to_owned();
    let files = std::fs::read_dir(folder)
        .unwrap()
        .map(|of| of.unwrap().path());
    let is_of_it = |of: &std::path::PathBuf| {
        let name = of.file_name().unwrap().to_string_lossy();
        name.starts_with("history") && name.ends_with(".csv")
    };
    let mut files: Vec<_> = files.filter(is_of_it).collect();
    files.sort();
    files
}

/// All that a service wrote, as one file.
fn whole_history(scratch: &Scratch) -> String {
    let texts = all_of(scratch)
        .into_iter()
        .map(|of| std::fs::read_to_string(of).unwrap());
    let mut whole = String::new();
    for text in texts {
        let rows = text.find('\n').map_or(0, |end| end + 1);
        whole += if whole.is_empty() {
            &text
        } else {
            &text[rows..]
        };
    }
    without_revisions(&whole)
}

/// Kills a service so often, and compares all that it wrote with what a run writes.
fn killed(name: &str, service: &str, kills: usize) -> Scratch {
    let scratch = desk(name, service);
    let log = scratch.path("log.csv");
    let lines = |scratch: &Scratch| all_of(scratch).iter().map(|of| lines(of)).sum::<usize>();
    let (mut prng, mut written) = (Prng::stream(1, "kills"), 0);
    scratch.file("log.csv", HEADER);
    let mut at_work = 0;
    let mut add = |count: usize| {
        let mut file = std::fs::OpenOptions::new().append(true).open(&log).unwrap();
        std::io::Write::write_all(&mut file, rows(written, written + count).as_bytes()).unwrap();
        written += count;
    };
    for nth in 0..kills {
        let before = lines(&scratch);
        add(20);
        let mut child = serve(&scratch, &[]);
        // Three of four are killed at work, the others anywhere.
        let began = Instant::now();
        while nth % 4 != 0 && lines(&scratch) <= before && began.elapsed() < Duration::from_secs(20)
        {
            std::thread::sleep(Duration::from_millis(1));
        }
        add(20);
        std::thread::sleep(Duration::from_micros(prng.between(0.0, 30e3) as u64));
        let _ = child.kill();
        let _ = child.wait();
        at_work += usize::from(lines(&scratch) > before);
    }
    let written = 40 * kills;
    let mut child = serve(&scratch, &[]);
    // All rows may stand there already, and then it would be asked to end before it is up.
    until_reported(&mut child, "goes on where it ended");
    let began = Instant::now();
    while lines(&scratch) < written && began.elapsed() < Duration::from_secs(60) {
        std::thread::sleep(Duration::from_millis(2));
    }
    end(child);
    assert!(whole_history(&scratch) == by_run(&scratch));
    let state = scratch.path("line.state");
    athermal(&[&"replay", &state, &"--check"]).ended(0);
    println!("{kills} kills, {at_work} of them at work, {written} rows");
    assert!(at_work * 2 > kills, "{at_work}");
    scratch
}

#[test]
fn a_service_that_only_froze_between_two_runs_has_all_rows_and_reports_none_as_lost() {
    let scratch = desk("froze", SERVICE);
    let out = scratch.path("history.csv");
    scratch.file("log.csv", &(HEADER.to_owned() + &rows(0, 50)));
    let mut child = serve(&scratch, &[]);
    until_rows(&out, 50, &mut child);
    end(child);
    let mut child = serve(&scratch, &["--frozen"]);
    let before = until_reported(&mut child, "goes on where it ended");
    let frozen = before + &end(child);
    scratch.file("log.csv", &(HEADER.to_owned() + &rows(0, 100)));
    let mut child = serve(&scratch, &[]);
    until_rows(&out, 100, &mut child);
    let text = frozen + &end(child);
    assert!(!text.contains("lost"), "{text}");
    assert!(history(&scratch) == by_run(&scratch));
}

#[test]
fn bad_rows_are_counted_and_named_and_a_file_that_is_not_there_is_waited_for() {
    let scratch = desk("bad", SERVICE);
    let mut child = serve(&scratch, &[]);
    let before = until_reported(&mut child, "source `log`: cannot open");
    let mut text = HEADER.to_owned() + &rows(0, 20);
    text += "oops,1,2,3\n2.0,x,21,5\n";
    text += &rows(21, 40);
    scratch.file("log.csv", &text);
    until_rows(&scratch.path("history.csv"), 40, &mut child);
    let text = before + &end(child);
    assert!(
        text.contains("oops") && text.contains("others like it are counted"),
        "{text}"
    );
}

#[test]
fn a_second_service_on_one_state_is_refused_and_a_damaged_journal_too() {
    let scratch = desk("second", SERVICE);
    scratch.file("log.csv", &(HEADER.to_owned() + &rows(0, 50)));
    let mut child = serve(&scratch, &[]);
    until_rows(&scratch.path("history.csv"), 50, &mut child);
    let second = athermal(&[&"serve", &scratch.path("line.toml")]).ended(3);
    assert!(
        second
            .told
            .contains("another service keeps its state there"),
        "{}",
        second.told
    );
    end(child);
    let state = athermal(&[&"replay", &scratch.path("nowhere")]).ended(2);
    assert!(state.told.contains("there is no journal"), "{}", state.told);
}

#[test]
fn another_graph_takes_over_at_the_start_and_the_journal_knows_when() {
    let scratch = desk("swap", SERVICE);
    scratch.file("log.csv", &(HEADER.to_owned() + &rows(0, 100)));
    let mut child = serve(&scratch, &[]);
    until_rows(&scratch.path("history.csv"), 100, &mut child);
    end(child);
    let other = GRAPH.replace("max_age = \"3s\"", "max_age = \"4s\"");
    scratch.file("graph.toml", &other);
    scratch.file("log.csv", &(HEADER.to_owned() + &rows(0, 200)));
    let mut child = serve(&scratch, &[]);
    until_rows(&scratch.path("history.csv"), 200, &mut child);
    let text = end(child);
    assert!(
        text.contains("another graph than the one that ran last"),
        "{text}"
    );
    assert!(text.contains("took over"), "{text}");
    let revisions: std::collections::BTreeSet<_> =
        std::fs::read_to_string(scratch.path("history.csv"))
            .unwrap()
            .lines()
            .skip(1)
            .map(|line| line.rsplit_once(',').unwrap().1.to_owned())
            .collect();
    assert_eq!(revisions.len(), 2);
}
