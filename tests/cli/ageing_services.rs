//! A machine that ages beside a service: the coefficients of its drift grow by a fifth in a week, and it is fitted anew while it runs.

use std::io::Write as _;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use athermal::core::prng::Prng;
use athermal::serve::folder::StatePaths;
use athermal::serve::journal::{Entry, Log, Record};
use serde_json::Value;

use crate::workbench::{Scratch, athermal};

const GRAPH: &str = r#"schema = 1
name = "ageing"
time = { column = "time_s", unit = "s" }
signals.temperature = { unit = "Cel", channels = ["plate", "room"], max_age = "5min" }
signals.position = { unit = "nm", channels = ["Z"], max_age = "5min" }
nodes.gradients = { type = "slope", inputs.signal = "temperature", windows = ["10min"], unit = "K/min" }
nodes.drift = { type = "slope", inputs.signal = "position", windows = ["10min"], unit = "nm/min" }
nodes.thermal = { type = "linear", inputs.features = "gradients", inputs.truth = "drift.Z", ahead = "0s" }
outputs.drift = "drift"
outputs.thermal = "thermal"
"#;

const SERVICE: &str = r#"
model = "first.json"
[runtime]
wait = "0 s"
settle = "0 s"
checkpoint = "500 ms"
[sources.log]
type = "csv"
path = "log.csv"
[retrain]
every = "8s"
on = "1d"
shadow = "3h"
"#;

const HEADER: &str = "time_s,plate,room,Z\n";
const DAY: usize = 1_440;

/// So many days of the machine, a row a minute.
fn machine(seed: u64, days: usize) -> Vec<String> {
    let mut prng = Prng::stream(seed, "ageing");
    let mut normal = move || (0..12).map(|_| prng.uniform()).sum::<f64>() - 6.0;
    let (mut plate, mut room, mut target, mut z) = (20.0, 20.0, 20.0, 0.0);
    let row = |minute: usize| {
        if minute.is_multiple_of(180) {
            target = 20.0 + 3.0 * normal();
        }
        let age = 1.0 + 0.2 * minute as f64 / (7 * DAY) as f64;
        let before: (f64, f64) = (plate, room);
        plate += (target - plate) / 40.0;
        room += (20.0 + 0.3 * (target - 20.0) - room) / 120.0 + 0.002 * normal();
        z += age * (900.0 * (plate - before.0) - 700.0 * (room - before.1));
        let (a, b) = (plate + 0.002 * normal(), room + 0.002 * normal());
        format!("{},{a:.5},{b:.5},{:.3}\n", 60 * minute, z + 2.0 * normal())
    };
    (0..days * DAY).map(row).collect()
}

/// A service that ends with the test.
struct Serving(Child, Scratch);

impl Drop for Serving {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl Serving {
    /// With the model of the first day of the machine, and the rows of its first week.
    fn start(name: &str, rows: &[String], sections: &str) -> Self {
        let scratch = Scratch::new(&format!("ageing-{name}"));
        scratch.file("graph.toml", GRAPH);
        scratch.file("day.csv", HEADER.to_owned() + &rows[..DAY].concat());
        scratch.file("log.csv", HEADER);
        scratch.file("line.toml", format!("{GRAPH}{sections}"));
        let [graph, data, model] =
            ["graph.toml", "day.csv", "first.json"].map(|of| scratch.path(of));
        athermal(&[&"fit", &graph, &"--data", &data, &"--output", &model]).ended(0);
        let child = Command::new(env!("CARGO_BIN_EXE_athermal"))
            .current_dir(scratch.path("line.toml").parent().unwrap())
            // As a user starts it, in the folder of the file.
            .args(["serve", "line.toml"])
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn();
        let serving = Self(child.unwrap(), scratch);
        // As many at once as a service takes in without missing any.
        for (nth, rows) in rows[..7 * DAY].chunks(1_440).enumerate() {
            serving.append(rows);
            let last_s = (60 * (nth * 1_440 + rows.len() - 1)) as f64;
            serving.until("its first week", |of| of["last_s"].as_f64() == Some(last_s));
        }
        serving
    }

    /// More rows of the machine.
    fn append(&self, rows: &[String]) {
        let mut options = std::fs::OpenOptions::new();
        let mut log = options.append(true).open(self.1.path("log.csv")).unwrap();
        log.write_all(rows.concat().as_bytes()).unwrap();
    }

    fn status(&self) -> Value {
        let asked = athermal(&[&"status", &self.1.path("line.toml"), &"--format", &"json"]);
        serde_json::from_str(&asked.out).unwrap_or_default()
    }

    /// Waits for a status.
    fn until(&self, what: &str, holds: impl Fn(&Value) -> bool) -> Value {
        let began = Instant::now();
        loop {
            let status = self.status();
            if holds(&status) {
                return status;
            }
            assert!(
                began.elapsed() < Duration::from_secs(90),
                "{what}: {status:#}"
            );
            std::thread::sleep(Duration::from_millis(50));
        }
    }
}

#[test]
fn a_service_beside_a_machine_that_ages_proposes_a_better_fit_and_takes_it_when_it_is_ordered_to() {
    let rows = machine(1, 9);
    let serving = Serving::start("better", &rows, SERVICE);
    let first = serving.status();
    // From then on a day takes 28 s, far more than a fit.
    let (log, later) = (serving.1.path("log.csv"), rows[7 * DAY..].to_vec());
    std::thread::spawn(move || {
        let mut log = std::fs::OpenOptions::new().append(true).open(log).unwrap();
        for rows in later.chunks(6) {
            if log.write_all(rows.concat().as_bytes()).is_err() {
                return;
            }
            std::thread::sleep(Duration::from_millis(117));
        }
    });
    let proposed = serving.until("a proposal", |of| of["staged"].is_object());
    let passed_s = proposed["last_s"].as_f64().unwrap() - first["last_s"].as_f64().unwrap();
    println!("proposed {:.1} h after a week", passed_s / 3_600.0);
    assert!(passed_s < 86_400.0, "{passed_s} s");
    let judged = serving.until("a verdict", |of| of["verdict"]["over"] == true);
    println!(
        "error relative to what runs: {}",
        judged["verdict"]["ratio"]
    );
    assert_eq!(judged["verdict"]["passes"], true, "{:#}", judged["verdict"]);
    // It waits for its order.
    assert_eq!(judged["revision"], first["revision"]);
    assert!(judged["previous"].is_null());
    let machine = serving.1.path("line.toml");
    athermal(&[&"commit", &machine]).ended(0);
    let taken = serving.until("the commit", |of| of["previous"] == first["revision"]);
    let listed = athermal(&[&"models", &machine, &"--format", &"json"]).ended(0);
    let listed: Value = serde_json::from_str(&listed.out).unwrap();
    let runs = listed["models"]
        .as_array()
        .unwrap()
        .iter()
        .find(|of| of["runs"] == true);
    assert_eq!(runs.unwrap()["revision"], taken["revision"]);
    let revisions = [&first["revision"], &taken["revision"]].map(|of| of.as_str().unwrap());
    let compared = athermal(&[
        &"models",
        &machine,
        &"--compare",
        &revisions[0],
        &revisions[1],
    ])
    .ended(0);
    assert!(
        compared.out.contains("thermal: RMSE of the fit"),
        "{}",
        compared.out
    );
    // And it can be taken back.
    let back = athermal(&[
        &"models",
        &machine,
        &"--take",
        &revisions[0],
        &"--format",
        &"json",
    ])
    .ended(0);
    assert!(
        serde_json::from_str::<Value>(&back.out)
            .unwrap()
            .is_object(),
        "{}",
        back.out
    );
    serving.until("the first", |of| of["revision"] == first["revision"]);
}

#[test]
fn a_service_whose_sensor_broke_proposes_nothing_and_its_journal_has_the_reason() {
    let mut rows = machine(2, 7);
    // The plate has stood still for half of the last day.
    for row in &mut rows[13 * DAY / 2..] {
        let mut cells: Vec<_> = row.split(',').collect();
        cells[1] = "20.5";
        *row = cells.join(",");
    }
    let serving = Serving::start("broken", &rows, SERVICE);
    let first = serving.status();
    let machine = serving.1.path("line.toml");
    let asked = athermal(&[&"retrain", &machine, &"--on", &"1d", &"--format", &"json"]).ended(1);
    let answer: Value = serde_json::from_str(&asked.out).unwrap();
    let reason = answer["reason"].as_str().unwrap();
    assert!(reason.contains("temperature.plate"), "{reason}");
    // The process of the service finds the same.
    let state = serving.1.path("line.state");
    let noted = || {
        notes(&state).into_iter().find(|of| {
            of.starts_with("retrain: ") && of.contains("nothing is proposed") && of.contains(reason)
        })
    };
    let began = Instant::now();
    while noted().is_none() {
        assert!(
            began.elapsed() < Duration::from_secs(60),
            "{:?}",
            notes(&state)
        );
        std::thread::sleep(Duration::from_millis(200));
    }
    let last = serving.status();
    assert!(
        last["staged"].is_null() && last["revision"] == first["revision"],
        "{last:#}"
    );
}

/// The remarks in a journal.
fn notes(state: &std::path::Path) -> Vec<String> {
    let mut log = Log::open(&StatePaths::new(state).journal()).unwrap();
    let mut notes = Vec::new();
    while let Ok(Some(entry)) = log.read() {
        if let Entry::Record(_, Record::Note(text)) = entry {
            notes.push(text.into());
        }
    }
    notes
}
