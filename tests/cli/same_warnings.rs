//! What `run` warns of `serve` warns of: the same rows through both, and what a service that runs says of itself.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::workbench::{Finished, Graph, Scratch, athermal, athermal_fed, athermal_on};

/// What monitors report, warnings and notes.
const KINDS: [&str; 6] = [
    "rejected_samples",
    "outside_fit",
    "stuck",
    "silent",
    "changes_again",
    "has_samples_again",
];

/// A correction of which the temperatures have a range.
fn graph() -> Graph {
    Graph::named("stage")
        .time("time")
        .with("unit = 's'")
        .section("signals.temperature", "unit = 'Cel'; channels = ['a', 'b']")
        .with("range = ['-20 Cel', '200 Cel']; max_age = '1min'")
        .signal("position", "nm", "Z", "1min")
        .section("nodes.beside", "type = 'uncorrected'")
        .with("inputs.position = 'position'")
        .slope("drift", "beside", "5min", "nm/min")
        .slope("gradient", "temperature", "5min", "mK/min")
        .model("thermal", "linear", "gradient", "drift.Z", "150s")
        .vote("vote", "auto_weighted", "['thermal']", "drift.Z")
        .with("memory = '15min'")
        .section("nodes.correction", "type = 'compensate'")
        .with("inputs.rate = 'vote'; range = '50 um'; max_rate = '1000 nm/min'")
        .with("max_slew = '50 nm/s'")
        .outputs("predicted = 'vote'; correction = 'correction'")
}

/// One row a minute; `damage` changes the temperatures of some.
fn log(from: i64, rows: i64, damage: impl Fn(i64, &mut [String; 2])) -> String {
    let row = |minute: i64| {
        let time = minute as f64 / 40.0;
        let noise = ((minute * 7919) % 13) as f64;
        let mut cells = [20.0 + time.sin(), 21.0 + time.cos()].map(|of| format!("{of:.4}"));
        let z = 500.0 * (20.0 + time.sin()) + noise;
        damage(minute - from, &mut cells);
        let [a, b] = cells;
        format!("{},{a},{b},{z:.1}\n", 60 * minute)
    };
    let rows = (from..from + rows).map(row);
    std::iter::once("time,a,b,Z\n".to_owned())
        .chain(rows)
        .collect()
}

/// A sensor that is stuck, out of range, silent and far outside of the fit, one after the other, and in order in between.
fn damaged() -> String {
    log(360, 700, |row, [a, b]| match row {
        100..=140 => *a = "20.25".to_owned(),
        200..=224 => *b = "999".to_owned(),
        300..=360 => b.clear(),
        450..=470 => *a = "35.5".to_owned(),
        _ => {}
    })
}

/// A model of the graph, and a machine file with it and these sections.
fn desk(name: &str, sections: &str) -> (Scratch, PathBuf, PathBuf) {
    let scratch = Scratch::new(&format!("same-warnings-{name}"));
    let file = scratch.file("graph.toml", graph());
    let (data, model) = (
        scratch.file("fit.csv", log(0, 360, |_, _| {})),
        scratch.path("model.json"),
    );
    athermal_on("fit", &file, &data, &[&"-o", &model]).ended(0);
    let machine =
        format!("schema = 1\nextends = \"graph.toml\"\nmodel = \"model.json\"\n{sections}");
    let machine = scratch.file("line.toml", machine);
    (scratch, model, machine)
}

/// The reports of these kinds, but for the time as the data have it and the words, which have it too.
fn reported(finished: &Finished, kinds: &[&str]) -> Vec<Value> {
    let lines = finished.told.lines();
    let lines = lines.filter_map(|line| serde_json::from_str::<Value>(line).ok());
    let of_kind = lines.filter(|of| kinds.iter().any(|kind| of["event"] == *kind));
    let bare = of_kind.map(|mut of| {
        let keys = of.as_object_mut().unwrap();
        keys.retain(|key, _| key != "time" && key != "message");
        of
    });
    bare.collect()
}

const PIPES: &str = "[runtime]\nwait = \"0 s\"\nsettle = \"0 s\"\n[sources.in]\ntype = \"stdin\"\n[sinks.out]\ntype = \"csv\"\npath = \"out.csv\"\n";

/// The same rows through a run and through a service.
fn by_both(model: &Path, machine: &Path, out: &Path, rows: &str) -> [Finished; 2] {
    let run: &[&dyn AsRef<std::ffi::OsStr>] = &[
        &"run",
        &model,
        &"--input",
        &"-",
        &"--output",
        &out,
        &"--format",
        &"json",
    ];
    let serve: &[&dyn AsRef<std::ffi::OsStr>] = &[&"serve", &machine, &"--format", &"json"];
    [run, serve].map(|words| athermal_fed(words, rows.as_bytes()).ended(0))
}

#[test]
fn the_same_rows_give_the_same_warnings_by_kind_channel_and_count_in_a_run_and_a_service() {
    let (scratch, model, machine) = desk("pipes", PIPES);
    let (rows, out) = (damaged(), scratch.path("run.csv"));
    let [run, served] = by_both(&model, &machine, &out, &rows);
    let (by_run, by_serve) = (reported(&run, &KINDS), reported(&served, &KINDS));
    let mut count = BTreeMap::new();
    for of in &by_run {
        *count.entry(of["event"].as_str().unwrap()).or_insert(0) += 1;
    }
    // The first sample out of range is reported at once, and how many there were at the end.
    let wanted = KINDS.map(|kind| (kind, if kind == "rejected_samples" { 2 } else { 1 }));
    // What is stuck far outside of the fit is stuck as well.
    let wanted = BTreeMap::from(wanted);
    for (kind, least) in wanted {
        assert!(
            count.get(kind) >= Some(&least),
            "{kind}: {count:?}\n{}",
            run.told
        );
    }
    assert_eq!(by_run, by_serve, "{}\n{}", run.told, served.told);
    let samples = json!({ "event": "rejected_samples", "level": "warning", "channel": "temperature.b", "samples": 25 });
    assert!(by_serve.contains(&samples), "{by_serve:#?}");

    // For people they are in the same words.
    std::fs::remove_dir_all(scratch.path("line.state")).unwrap();
    let words = |of: Finished| {
        let lines = of.told.lines().filter(|line| line.contains("temperature."));
        let lines = lines.map(|line| line.replace(" s: ", ": ").replace(",", ""));
        lines.collect::<Vec<_>>()
    };
    let serve = words(athermal_fed(&[&"serve", &machine], rows.as_bytes()).ended(0));
    let run = words(
        athermal_fed(
            &[&"run", &model, &"--input", &"-", &"--output", &out],
            rows.as_bytes(),
        )
        .ended(0),
    );
    assert_eq!(run, serve);
}

#[test]
fn a_graph_that_never_puts_anything_out_is_reported_by_a_service_as_by_a_run() {
    let scratch = Scratch::new("same-warnings-no-output");
    let graph = Graph::named("empty")
        .time("time")
        .with("unit = 's'")
        .section("signals.temperature", "unit = 'Cel'; channels = ['a', 'b']")
        .with("max_age = '1min'")
        .slope("gradient", "temperature", "5min", "mK/min")
        .outputs("gradient = 'gradient'");
    let model = scratch.file("graph.toml", graph);
    let machine = format!("schema = 1\nextends = \"graph.toml\"\n{PIPES}");
    let machine = scratch.file("line.toml", machine);
    let rows = log(360, 400, |_, cells| {
        cells.iter_mut().for_each(String::clear)
    });
    let out = scratch.path("run.csv");
    let kinds = ["no_output", "silent"];
    let [run, served] = by_both(&model, &machine, &out, &rows);
    let (by_run, by_serve) = (reported(&run, &kinds), reported(&served, &kinds));
    let nothing = by_run
        .iter()
        .filter(|of| of["event"] == "no_output")
        .count();
    assert_eq!(nothing, 1, "{}", run.told);
    assert_eq!(by_run, by_serve, "{}", served.told);
    // A pipe that ends before an hour is over is reported at its end, and once.
    std::fs::remove_dir_all(scratch.path("line.state")).unwrap();
    let few: String = rows
        .lines()
        .take(41)
        .map(|line| format!("{line}\n"))
        .collect();
    let served = athermal_fed(&[&"serve", &machine, &"--format", &"json"], few.as_bytes()).ended(0);
    let none = reported(&served, &["no_output"]);
    assert_eq!(none.len(), 1, "{}", served.told);
    assert_eq!(none[0]["ticks"], 40);
}

fn status(machine: &std::path::Path) -> (i32, Value) {
    let asked = athermal(&[&"status", &machine, &"--format", &"json"]);
    (
        asked.status,
        serde_json::from_str(&asked.out).unwrap_or_default(),
    )
}

/// Waits until a service says something.
fn until(machine: &std::path::Path, what: &str, holds: impl Fn(&Value) -> bool) -> (i32, Value) {
    let began = Instant::now();
    loop {
        let asked = status(machine);
        if holds(&asked.1) {
            return asked;
        }
        let passed = began.elapsed();
        assert!(passed < Duration::from_secs(40), "{what}: {:#}", asked.1);
        std::thread::sleep(Duration::from_millis(100));
    }
}

fn serve(machine: &std::path::Path, more: &[&str]) -> Child {
    let mut command = Command::new(env!("CARGO_BIN_EXE_athermal"));
    command.arg("serve").arg(machine).args(more);
    let quiet = command.stdin(Stdio::null()).stdout(Stdio::null());
    quiet.stderr(Stdio::null()).spawn().unwrap()
}

fn end(machine: &std::path::Path, mut child: Child) {
    athermal(&[&"stop", &machine]).ended(0);
    assert_eq!(child.wait().unwrap().code(), Some(0));
}

const FOLLOWED: &str = "[runtime]\nwait = \"0 s\"\nsettle = \"0 s\"\n[sources.log]\ntype = \"csv\"\npath = \"log.csv\"\n[sinks.out]\ntype = \"csv\"\npath = \"out.csv\"\n";

#[cfg(unix)]
#[test]
fn a_service_says_what_it_watches_and_what_became_of_each_sample_wherever_its_state_is() {
    let (scratch, _, machine) = desk("status", FOLLOWED);
    // A cell and a row that cannot be read, a time that was there, and one before.
    let mut rows = damaged();
    rows += "63600,?,21,9000\nx,1,1,1\n63600,20,21,9000\n60,20,21,9000\n63660,20,21,9000\n63720,20,21,9000\n";
    scratch.file("log.csv", &rows);
    let state = scratch.path("elsewhere").display().to_string();
    let child = serve(&machine, &["--state", &state]);
    let (code, found) = until(&machine, "all rows", |of| of["ticks"] == 703);
    assert_eq!((code, &found["state"]), (0, &json!("running")), "{found:#}");
    let channel = |name: &str| {
        let all = found["channels"].as_array().unwrap();
        all.iter().find(|of| of["channel"] == name).unwrap().clone()
    };
    let (a, b) = (channel("temperature.a"), channel("temperature.b"));
    assert_eq!(
        (&a["source"], &a["no_number"]),
        (&json!("log"), &json!(1)),
        "{a:#}"
    );
    assert_eq!(
        (&b["out_of_range"], &b["accepted"]),
        (&json!(25), &json!(703 - 61)),
        "{b:#}"
    );
    let left_out = &found["sources"][0]["left_out"];
    assert_eq!(
        left_out,
        &json!({ "unreadable": 1, "repeated": 1, "out_of_order": 1 })
    );
    let watched = &found["watched"];
    let outside = &watched["outside_fit"][0];
    assert_eq!(
        (&outside["channel"], &outside["samples"]),
        (&json!("temperature.a"), &json!(21))
    );
    assert_eq!(outside["highest"], 35.5);
    let warnings = watched["warnings"].as_array().unwrap();
    for (kind, name) in [
        ("stuck", "temperature.a"),
        ("silent", "temperature.b"),
        ("rejected_samples", "temperature.b"),
        ("outside_fit", "temperature.a"),
    ] {
        let known = |of: &&Value| of["kind"] == kind && of["channel"] == name;
        assert!(
            warnings.iter().any(|of| known(&of)),
            "{kind}: {warnings:#?}"
        );
    }
    let text = athermal(&[&"status", &machine]).ended(0).out;
    for words in [
        "source log: connected",
        "left out 1 repeated, 1 out of order, 1 unreadable",
        "temperature.b: 642 samples of log",
        "left out 25 out of range",
        "temperature.a: 21 samples far outside of the fit, 35.5",
    ] {
        assert!(text.contains(words), "`{words}` is not in:\n{text}");
    }
    end(&machine, child);
}

#[cfg(unix)]
#[test]
fn a_service_whose_only_source_never_connected_is_degraded_until_it_has() {
    let (scratch, _, machine) = desk("never", FOLLOWED);
    let child = serve(&machine, &[]);
    let (code, found) = until(&machine, "degraded", |of| of["state"] == "degraded");
    assert_eq!(
        (code, &found["sources"][0]["connection"]),
        (1, &json!("never"))
    );
    let text = athermal(&[&"status", &machine]).ended(1).out;
    assert!(text.contains("source log: never connected"), "{text}");
    scratch.file("log.csv", log(360, 50, |_, _| {}));
    let (code, found) = until(&machine, "the rows", |of| of["ticks"] == 50);
    assert_eq!((code, &found["state"]), (0, &json!("running")), "{found:#}");
    assert_eq!(found["sources"][0]["connection"], "connected");
    end(&machine, child);
}

#[cfg(unix)]
#[test]
fn rows_that_a_sink_has_not_put_out_are_in_its_spool_and_ticks_are_ticks() {
    let (scratch, _, machine) = desk("spool", FOLLOWED);
    scratch.file("log.csv", log(360, 50, |_, _| {}));
    // A file with other columns: the sink is tried again, and the correction goes on.
    let wrong = scratch.file("out.csv", "other\n1\n");
    let child = serve(&machine, &[]);
    let (_, found) = until(&machine, "the rows", |of| of["ticks"] == 50);
    let sink = &found["sinks"][0];
    assert_eq!(
        (&sink["put"], &sink["spooled"]),
        (&json!(0), &json!(50)),
        "{sink:#}"
    );
    athermal(&[&"freeze", &machine]).ended(0);
    athermal(&[&"thaw", &machine]).ended(0);
    let (_, found) = until(&machine, "learning", |of| of["happenings"] == 52);
    assert_eq!((&found["ticks"], &found["beats"]), (&json!(50), &json!(0)));
    std::fs::remove_file(wrong).unwrap();
    let (_, found) = until(&machine, "the sink", |of| of["sinks"][0]["put"] == 50);
    let (_, found) = match found["sinks"][0]["spooled"] == 0 {
        true => (0, found),
        false => until(&machine, "the spool", |of| of["sinks"][0]["spooled"] == 0),
    };
    assert_eq!(found["sinks"][0]["waiting"], 0);
    end(&machine, child);
}
