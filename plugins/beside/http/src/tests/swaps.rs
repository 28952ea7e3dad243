//! Graphs that are staged over the interface.

use std::collections::BTreeMap;
use std::fs;

use serde_json::json;

use super::{Bench, GRAPH};

/// Six mistakes in six tables.
const SIX: &str = r#"schema = 1
name = "line"
time = { column = "time_s", unit = "fortnights" }
signals.temperature = { unit = "Cell", channels = ["plate", "room"], max_age = "3s" }
nodes.trend = { type = "slop", inputs.signal = "temperature", windows = ["2s", "7s"] }
nodes.masses = { type = "first_order", inputs.signal = "temperature", time_constants = ["3 apples", "1min"] }
nodes.other = { type = "slope", inputs.signal = "temperatur", windows = ["2s"] }
outputs.trend = "trent"
"#;

#[test]
fn a_graph_with_six_mistakes_is_refused_with_all_of_them_at_their_places_and_what_runs_is_untouched()
 {
    let bench = Bench::start(GRAPH, "");
    let before = bench.status();
    let path = bench.path("six.toml");
    fs::write(&path, SIX).unwrap();
    let reply = bench.post("/v1/stage", &json!({ "path": path }));
    let body = reply.json();
    assert_eq!(reply.status, 422, "{body:#}");
    let errors = body["diagnostics"].as_array().unwrap().iter();
    let errors: Vec<_> = errors.filter(|of| of["severity"] == "error").collect();
    let lines: BTreeMap<_, _> = errors
        .iter()
        .map(|of| (of["line"].as_u64(), &of["message"]))
        .collect();
    assert_eq!(lines.len(), 6, "{lines:#?}");
    assert!(lines.keys().all(Option::is_some), "{lines:#?}");
    let text = body["text"].as_str().unwrap();
    assert!(
        text.contains("six.toml:3") && text.contains("^^^"),
        "{text}"
    );
    let after = bench.until("more ticks", |of| {
        of["ticks"].as_u64() > before["ticks"].as_u64()
    });
    assert_eq!(
        (&after["revision"], &after["staged"]),
        (&before["revision"], &json!(null))
    );
}

#[test]
fn a_good_graph_is_staged_compared_committed_and_taken_back_and_every_tick_is_there() {
    let mut bench = Bench::start(GRAPH, "");
    let first = bench.status()["revision"].clone();
    let path = bench.path("new.toml");
    fs::write(&path, GRAPH.replace("[\"2s\", \"7s\"]", "[\"2s\", \"9s\"]")).unwrap();
    assert_eq!(bench.post("/v1/commit", &json!({})).status, 409);
    let staged = bench.post("/v1/stage", &json!({ "path": path }));
    assert_eq!(staged.status, 200, "{:#}", staged.json());
    let staged = staged.json();
    let second = staged["revision"].clone();
    let nodes = staged["nodes"].as_array().unwrap();
    assert!(
        nodes.iter().any(|node| node["carry"] == "carried"),
        "{staged:#}"
    );
    assert!(
        nodes.iter().any(|node| node["carry"] == "warmed"),
        "{staged:#}"
    );
    let order = json!({ "duration": "2s", "margin": 0.1, "commit": false });
    assert_eq!(bench.post("/v1/shadow", &order).status, 200);
    bench.until("the comparison", |of| of["verdict"]["over"] == true);
    assert_eq!(
        bench.post("/v1/commit", &json!({})).json()["revision"],
        second
    );
    let status = bench.until("the new graph", |of| of["revision"] == second);
    assert_eq!(status["previous"], first);
    assert_eq!(
        bench.post("/v1/rollback", &json!({})).json()["revision"],
        first
    );
    bench.until("the old graph", |of| of["revision"] == first);
    assert_eq!(bench.post("/v1/freeze", &json!({})).status, 200);
    bench.until("a freeze", |of| of["frozen"] == true);
    assert_eq!(bench.post("/v1/thaw", &json!({})).status, 200);
    bench.until("no freeze", |of| of["frozen"] == false);
    assert_eq!(bench.post("/v1/snapshot", &json!({})).status, 200);
    assert_eq!(
        bench.post("/v1/stage", &json!({ "path": path })).status,
        200
    );
    assert_eq!(bench.post("/v1/discard", &json!({})).status, 200);
    assert_eq!(bench.post("/v1/discard", &json!({})).status, 409);
    bench.stop();
    let text = fs::read_to_string(bench.path("history.csv")).unwrap();
    let rows: Vec<_> = text.lines().skip(1).collect();
    let times: Vec<f64> = rows
        .iter()
        .map(|row| row.split(',').next().unwrap().parse().unwrap())
        .collect();
    assert!(
        times
            .windows(2)
            .all(|pair| (pair[1] - pair[0] - 0.1).abs() < 1e-6),
        "a tick is missing"
    );
    let mut revisions: Vec<_> = rows
        .iter()
        .map(|row| row.rsplit(',').next().unwrap())
        .collect();
    revisions.dedup();
    let wanted = [&first, &second, &first].map(|of| of.as_str().unwrap());
    assert_eq!(revisions, wanted);
    // Who did it stands in the journal: the user of the process at the other end of the socket.
    let uid = fs::metadata("/proc/self").map(|of| std::os::unix::fs::MetadataExt::uid(&of));
    let by = format!("uid {}: ", uid.unwrap());
    let notes = notes(&bench.path("state"));
    let own: Vec<_> = notes.iter().filter_map(|of| of.strip_prefix(&by)).collect();
    assert_eq!(own.len(), 11, "{notes:#?}");
    assert!(
        own[0].starts_with("staged ") && own.contains(&"learning frozen"),
        "{own:#?}"
    );
}

#[test]
fn a_service_that_was_started_by_a_relative_path_takes_its_file_again() {
    let bench = Bench::start(GRAPH, "");
    let noted = fs::read_to_string(bench.path("state/socket")).unwrap();
    assert!(noted.starts_with('/'), "{noted}");
    let machine = bench.path("machine.toml");
    let text = fs::read_to_string(&machine).unwrap();
    fs::write(&machine, text.replace("\"7s\"]", "\"9s\"]")).unwrap();
    let answer = bench.raw(b"POST /v1/stage HTTP/1.0\r\nContent-Length: 0\r\n\r\n");
    assert!(answer.starts_with("HTTP/1.0 200"), "{answer}");
    bench.until("a staged graph", |of| of["staged"].is_object());
}

/// The remarks in a journal.
fn notes(state: &std::path::Path) -> Vec<String> {
    use athermal_serve::folder::StatePaths;
    use athermal_serve::journal::{Entry, Log, Record};
    let mut log = Log::open(&StatePaths::new(state).journal()).unwrap();
    let mut notes = Vec::new();
    while let Some(entry) = log.read().unwrap() {
        if let Entry::Record(_, Record::Note(text)) = entry {
            notes.push(text.into());
        }
    }
    notes
}

#[test]
fn a_listener_is_given_every_tick_with_the_channels_that_it_wants() {
    use std::io::BufRead as _;
    let bench = Bench::start(GRAPH, "");
    let path = "/v1/events?channel=temperature.room";
    let (status, lines) = bench.address().listen(path).unwrap();
    assert_eq!(status, 200);
    let data = lines.lines().filter_map(|line| {
        let line = line.unwrap();
        serde_json::from_str::<serde_json::Value>(line.strip_prefix("data: ")?).ok()
    });
    let ticks: Vec<_> = data
        .filter(|of| of["outputs"].is_object())
        .take(50)
        .collect();
    let ns = |of: &serde_json::Value| of["time_ns"].as_i64().unwrap();
    assert!(
        ticks
            .windows(2)
            .all(|pair| ns(&pair[1]) - ns(&pair[0]) == 100_000_000)
    );
    assert!(
        ticks[0]["channels"]["temperature.room"].is_f64(),
        "{:#}",
        ticks[0]
    );
    assert!(ticks[0]["channels"].as_object().unwrap().len() == 1);
}
