//! A source that is thinned before the graph: a fit, a run and a service of the same raw rows thin alike, as whoever had thinned by hand.

use std::collections::BTreeMap;
use std::io::Write;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::services::{end, history, lines, rows, serve, until_rows};
use crate::workbench::{Scratch, athermal};

const GRAPH: &str = r#"
schema = 1
name = "line"
time = { column = "time_s", unit = "s" }
signals.temperature = { unit = "Cel", channels = ["plate", "room"], max_age = "3s" }
signals.position = { unit = "nm", channels = ["Z"], max_age = "3s" }
nodes.trend = { type = "slope", inputs.signal = "temperature", windows = ["7s"] }
nodes.thermal = { type = "linear", inputs.features = "trend", inputs.truth = "position.Z", ahead = "0s" }
outputs.trend = "trend"
outputs.thermal = "thermal"
"#;
const HEADER: &str = "time_s,plate,room,Z\n";

/// Ten rows a second, thinned to one at the end of each.
fn by_hand(raw: &str, way: &str) -> String {
    let mut seconds: BTreeMap<u64, Vec<Vec<&str>>> = BTreeMap::new();
    for row in raw.lines() {
        let cells: Vec<&str> = row.split(',').collect();
        let tenths: u64 = cells[0].replace('.', "").parse().unwrap();
        seconds.entry(tenths.div_ceil(10)).or_default().push(cells);
    }
    let mut text = HEADER.to_owned();
    for (second, rows) in seconds {
        text += &second.to_string();
        for column in 1..4 {
            let cells = rows.iter().map(|cells| cells[column]);
            let mut values: Vec<f64> = cells.filter_map(|cell| cell.parse().ok()).collect();
            let last = values.last().copied();
            let middle = values.len() / 2;
            let left = last.map(|last| match way {
                "mean" => values.iter().sum::<f64>() / values.len() as f64,
                "last" => last,
                _ => {
                    values.sort_by(f64::total_cmp);
                    match values.len() % 2 {
                        0 => f64::midpoint(values[middle - 1], values[middle]),
                        _ => values[middle],
                    }
                }
            });
            text += &left.map_or(",".to_owned(), |left| format!(",{left}"));
        }
        text += "\n";
    }
    text
}

fn desk(way: &str) -> Scratch {
    let scratch = Scratch::new(&format!("thinned-{way}"));
    scratch.file("graph.toml", GRAPH);
    let machine = format!(
        "schema = 1\nextends = \"graph.toml\"\nmodel = \"line.json\"\n\
         [runtime]\nwait = \"20 ms\"\nsettle = \"0 s\"\n\
         [sources.log]\ntype = \"csv\"\npath = \"log.csv\"\n{way} = \"1s\"\n\
         [sinks.history]\ntype = \"csv\"\npath = \"history.csv\"\n"
    );
    scratch.file("line.toml", machine);
    scratch
}

/// What was fitted, as a model has it.
fn fitted(text: &str) -> &str {
    &text[text.find("\"fitted\"").unwrap()..]
}

#[test]
fn a_fit_a_run_and_a_service_of_the_same_rows_thin_alike_to_the_bit() {
    for way in ["mean", "last", "median"] {
        let (scratch, raw) = (desk(way), rows(0, 600));
        let log = scratch.file("log.csv", HEADER.to_owned() + &raw);
        let thinned = scratch.file("thinned.csv", by_hand(&raw, way));
        let (graph, machine) = (scratch.path("graph.toml"), scratch.path("line.toml"));
        let (plain, model) = (scratch.path("plain.json"), scratch.path("line.json"));
        athermal(&[&"fit", &graph, &"--data", &thinned, &"-o", &plain]).ended(0);
        athermal(&[&"fit", &machine, &"--data", &log, &"-o", &model]).ended(0);
        let text = |path| std::fs::read_to_string(path).unwrap();
        assert!(fitted(&text(&model)) == fitted(&text(&plain)), "{way}");

        let run = |model, input| athermal(&[&"run", model, &"--input", input]).ended(0).out;
        let wanted = run(&plain, &thinned);
        assert_eq!(wanted.lines().count(), 62);
        assert!(run(&machine, &log) == wanted, "{way}");
        assert!(run(&model, &log) == wanted, "{way}");

        // The last second may yet go on; a kill in the middle of one loses nothing of it.
        let mut child = serve(&scratch, &[]);
        until_rows(&scratch.path("history.csv"), 60, &mut child);
        child.kill().unwrap();
        child.wait().unwrap();
        let more = HEADER.to_owned() + &rows(0, 701);
        scratch.file("log.csv", more);
        let mut child = serve(&scratch, &[]);
        until_rows(&scratch.path("history.csv"), 70, &mut child);
        end(child);
        let thinned = scratch.file("thinned.csv", by_hand(&rows(0, 701), way));
        let wanted = run(&plain, &thinned);
        assert_eq!(lines(&scratch.path("history.csv")), 70);
        let wanted: Vec<_> = wanted.lines().take(71).collect();
        assert!(history(&scratch).lines().eq(wanted), "{way}");
    }
}

#[test]
fn a_source_that_is_thinned_in_two_ways_is_a_mistake() {
    let scratch = desk("mean");
    let machine = std::fs::read_to_string(scratch.path("line.toml")).unwrap();
    let machine = machine.replace("model = \"line.json\"\n", "");
    scratch.file(
        "line.toml",
        machine.replace("mean =", "last = \"2s\"\nmean ="),
    );
    let told = athermal(&[&"check", &scratch.path("line.toml")])
        .ended(2)
        .told;
    assert!(told.contains("it is thinned in two ways"), "{told}");
    scratch.file(
        "line.toml",
        machine.replace("mean = \"1s\"", "mean = \"0s\""),
    );
    let told = athermal(&[&"check", &scratch.path("line.toml")])
        .ended(2)
        .told;
    assert!(told.contains("mean"), "{told}");
}

#[test]
fn status_says_what_windows_hold_and_will_hold_before_they_are_full() {
    let scratch = Scratch::new("held");
    let machine = format!(
        "{}[runtime]\nwait = \"0 s\"\nsettle = \"0 s\"\ncheckpoint = \"100 ms\"\n\
         [sources.in]\ntype = \"stdin\"\n[sinks.history]\ntype = \"csv\"\npath = \"history.csv\"\n",
        GRAPH
            .replace("[\"7s\"]", "[\"10min\"]")
            .replace("nodes.thermal", "#")
            .replace("outputs.thermal", "#")
    );
    scratch.file("line.toml", machine);
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
    let state = scratch.path("line.state");
    let mut nth = 0;
    // Ten rows a second of the machine, and what is known once that is shown.
    let mut held = |least: f64| {
        let began = Instant::now();
        loop {
            assert!(began.elapsed() < Duration::from_secs(30), "{least}");
            pipe.write_all(rows(nth, nth + 20).as_bytes()).unwrap();
            nth += 20;
            std::thread::sleep(Duration::from_millis(50));
            let text = athermal(&[&"status", &state, &"--format", &"json"]).out;
            let status: serde_json::Value = serde_json::from_str(&text).unwrap_or_default();
            let of = |key: &str| status["held"][key].as_f64();
            if let (Some(bytes), Some(full)) = (of("bytes"), of("bytes_full"))
                && bytes > least
            {
                return (bytes, full);
            }
        }
    };
    let (first, expected) = held(0.0);
    let (later, still) = held(2.0 * first.max(10_000.0));
    assert!(
        expected > 2.0 * later,
        "{first} then {later}, of {expected}"
    );
    assert!(
        (still / expected - 1.0).abs() < 0.2,
        "{still} of {expected}"
    );
    end(child);
}
