//! The commands that ask a service that runs.

use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::workbench::{Scratch, athermal};

const GRAPH: &str = r#"schema = 1
name = "asked"
time = { column = "time_s", unit = "s" }
signals.temperature = { unit = "Cel", channels = ["plate", "room"], max_age = "3s" }
nodes.trend = { type = "slope", inputs.signal = "temperature", windows = ["2s", "7s"] }
nodes.masses = { type = "first_order", inputs.signal = "temperature", time_constants = ["3s", "1min"] }
outputs.trend = "trend"
outputs.masses = "masses"
"#;

const SERVICE: &str = r#"
[runtime]
wait = "0 s"
settle = "0 s"
checkpoint = "200 ms"
[sources.log]
type = "replay"
path = "log.csv"
speed = 20
[sinks.history]
type = "csv"
path = "history.csv"
"#;

fn desk(name: &str) -> Scratch {
    let scratch = Scratch::new(&format!("asked-{name}"));
    let row = |nth: u32| {
        format!(
            "{}.{},{},{}\n",
            nth / 10,
            nth % 10,
            20 + nth % 3,
            21 + nth % 5
        )
    };
    // More than the slowest machine gets through meanwhile.
    let rows: String = (0..200_000).map(row).collect();
    scratch.file("log.csv", &("time_s,plate,room\n".to_owned() + &rows));
    scratch.file("line.toml", format!("{GRAPH}{SERVICE}"));
    scratch
}

fn serve(scratch: &Scratch) -> Child {
    let child = Command::new(env!("CARGO_BIN_EXE_athermal"))
        .arg("serve")
        .arg(scratch.path("line.toml"))
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    until(scratch, "ticks", |status| {
        status["ticks"].as_u64() > Some(20)
    });
    child
}

fn until(scratch: &Scratch, what: &str, holds: impl Fn(&Value) -> bool) -> Value {
    let (began, machine) = (Instant::now(), scratch.path("line.toml"));
    loop {
        let asked = athermal(&[&"status", &machine, &"--format", &"json"]);
        if let Ok(status) = serde_json::from_str::<Value>(&asked.out)
            && holds(&status)
        {
            return status;
        }
        assert!(
            began.elapsed() < Duration::from_secs(30),
            "{what}: {} {}",
            asked.out,
            asked.told
        );
        std::thread::sleep(Duration::from_millis(50));
    }
}

#[test]
fn a_service_is_asked_given_another_graph_and_ended_from_the_command_line() {
    let scratch = desk("all");
    let machine = scratch.path("line.toml");
    let mut child = serve(&scratch);
    let first = until(&scratch, "a revision", |of| of["revision"].is_string());
    let shown = athermal(&[&"status", &machine]).ended(0);
    assert!(
        shown.out.contains("asked: running") && shown.out.contains("temperature.plate: "),
        "{}",
        shown.out
    );

    // Six mistakes are six diagnostics at their places, and what runs is untouched.
    let wrong = GRAPH
        .replace("\"s\" }", "\"fortnights\" }")
        .replace("\"Cel\"", "\"Cell\"")
        .replace("type = \"slope\"", "type = \"slop\"")
        .replace("\"1min\"", "\"1 apple\"")
        .replace("outputs.trend = \"trend\"", "outputs.trend = \"trent\"")
        .replace("outputs.masses = \"masses\"", "outputs.masses = \"mases\"");
    let wrong_path = scratch.path("wrong.toml");
    scratch.file("wrong.toml", &wrong);
    let refused = athermal(&[&"swap", &machine, &wrong_path, &"--commit"]).ended(2);
    println!("{}", refused.told);
    let carets = refused.told.matches("wrong.toml:").count();
    assert!(
        carets == 6 && refused.told.contains("^^^"),
        "{}",
        refused.told
    );
    let as_json = athermal(&[&"swap", &machine, &wrong_path, &"--format", &"json"]).ended(2);
    let as_json: Value = serde_json::from_str(&as_json.out).unwrap();
    assert_eq!(
        as_json["diagnostics"].as_array().unwrap().len(),
        6,
        "{as_json:#}"
    );
    let same = until(&scratch, "the same", |of| of["staged"].is_null());
    assert_eq!(same["revision"], first["revision"]);

    let next = scratch.path("next.toml");
    scratch.file("next.toml", GRAPH.replace("\"7s\"]", "\"9s\"]"));
    let staged = athermal(&[&"swap", &machine, &next, &"--shadow", &"1s"]).ended(0);
    assert!(
        staged.out.contains("nodes go on as they were")
            && staged.out.contains("in the shadow for 1s"),
        "{}",
        staged.out
    );
    athermal(&[&"discard", &machine]).ended(0);
    athermal(&[&"discard", &machine]).ended(2);
    athermal(&[&"swap", &machine, &next]).ended(0);
    athermal(&[&"commit", &machine]).ended(0);
    until(&scratch, "the swap", |of| {
        of["previous"] == first["revision"]
    });
    athermal(&[&"rollback", &machine]).ended(0);
    until(&scratch, "the old one", |of| {
        of["revision"] == first["revision"]
    });
    for order in ["freeze", "thaw", "snapshot"] {
        athermal(&[&order, &machine]).ended(0);
    }
    let tapped = athermal(&[
        &"tap",
        &machine,
        &"--count",
        &"5",
        &"--channel",
        &"temperature.room",
        &"--format",
        &"json",
    ])
    .ended(0);
    let ticks = tapped
        .out
        .lines()
        .filter(|line| line.contains("\"event\":\"tick\""));
    assert_eq!(ticks.count(), 5, "{}", tapped.out);
    assert!(
        tapped.out.contains("\"temperature.room\":"),
        "{}",
        tapped.out
    );

    // Killed after a swap, it goes on with the graph that took over, and its journal has the same bits.
    athermal(&[&"swap", &machine, &next, &"--commit"]).ended(0);
    let swapped = until(&scratch, "the swap", |of| {
        of["revision"] != first["revision"]
    });
    child.kill().unwrap();
    child.wait().unwrap();
    let gone = athermal(&[&"status", &machine]).ended(3);
    assert!(gone.told.contains("does not answer"), "{}", gone.told);
    let mut child = serve(&scratch);
    let again = until(&scratch, "a revision", |of| of["revision"].is_string());
    assert_eq!(again["revision"], swapped["revision"]);
    athermal(&[&"stop", &machine]).ended(0);
    assert_eq!(child.wait().unwrap().code(), Some(0));
    let state = scratch.path("line.state");
    athermal(&[&"replay", &state, &"--check"]).ended(0);
    let nowhere = athermal(&[&"status", &scratch.path("other.toml")]).ended(2);
    assert!(
        nowhere.told.contains("no service is found"),
        "{}",
        nowhere.told
    );
}

#[test]
fn a_service_is_found_by_its_machine_file_wherever_it_keeps_its_state() {
    let scratch = desk("elsewhere");
    let (machine, plain) = (scratch.path("line.toml"), format!("{GRAPH}{SERVICE}"));
    std::fs::create_dir_all(scratch.path("base")).unwrap();
    let kept = "schema = 1\n[runtime]\nstate = \"kept\"\n";
    scratch.file("base/kept.toml", kept);
    let named = plain.replace("[runtime]", "[runtime]\nstate = \"here/state\"");
    let inherited = plain.replace("schema = 1", "schema = 1\nextends = \"base/kept.toml\"");
    let aside = scratch.path("aside").display().to_string();
    for (text, more, state) in [
        (&plain, &[][..], "line.state"),
        (&named, &[], "here/state"),
        (&inherited, &[], "base/kept"),
        (&inherited, &["--state", &*aside], "aside"),
    ] {
        scratch.file("line.toml", text);
        let mut child = Command::new(env!("CARGO_BIN_EXE_athermal"))
            .arg("serve")
            .arg(&machine)
            .args(more)
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        until(&scratch, state, |status| status["ticks"].as_u64() > Some(5));
        assert!(scratch.path(state).join("journal").is_dir(), "{state}");
        // Killed, it leaves its sockets behind, and the next one is found all the same.
        child.kill().unwrap();
        child.wait().unwrap();
        std::fs::remove_file(scratch.path("history.csv")).unwrap();
    }
    let gone = athermal(&[&"status", &machine]);
    assert_ne!(gone.status, 0, "{}", gone.out);
}
