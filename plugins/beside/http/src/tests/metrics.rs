//! `/metrics`, judged by Prometheus itself.

use std::io::{Read, Write};
use std::process::{Command, Stdio};
use std::time::{Duration as Wait, Instant as Clock};

use super::{Bench, FITTED, GRAPH, exchange, free_port, tcp};

/// Whether a program is there. Without it the test is skipped, or fails where all are required.
fn is_there(program: &str) -> bool {
    let found = Command::new(program).arg("--version").output().is_ok();
    if !found {
        assert!(
            std::env::var_os("ATHERMAL_REQUIRE_SERVERS").is_none(),
            "{program} is not there, and is required"
        );
        println!("skipped: {program} is not there");
    }
    found
}

#[test]
fn promtool_finds_nothing_wrong_with_the_metrics() {
    if !is_there("promtool") {
        return;
    }
    let bench = Bench::start(&ranged(), "");
    // What the engine thread knows it gives out once a second.
    bench.until("counts", |of| of["behind_s"].is_number());
    let rejected = bench.until("a sample out of range", |of| {
        of["watched"]["warnings"]
            .as_array()
            .is_some_and(|of| !of.is_empty())
    });
    let wanted = serde_json::json!({ "kind": "rejected_samples", "channel": "temperature.plate", "count": 1 });
    assert_eq!(rejected["watched"]["warnings"][0], wanted);
    let text = bench.get("/metrics");
    assert_eq!(text.status, 200);
    let mut promtool = Command::new("promtool")
        .args(["check", "metrics"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    promtool
        .stdin
        .take()
        .unwrap()
        .write_all(&text.body)
        .unwrap();
    let out = promtool.wait_with_output().unwrap();
    let words =
        String::from_utf8_lossy(&out.stderr).into_owned() + &String::from_utf8_lossy(&out.stdout);
    assert!(out.status.success() && words.trim().is_empty(), "{words}");
    let text = String::from_utf8(text.body).unwrap();
    for name in [
        "athermal_ticks_total",
        "athermal_behind_seconds",
        "athermal_source_queue_length",
        "athermal_sink_queue_length",
        "athermal_channel_age_seconds",
        "athermal_dropped_samples_total",
        "athermal_beats_total",
        "athermal_undecided_samples",
        "athermal_warnings_total",
        "athermal_no_output",
        "athermal_sink_spooled_rows",
        "athermal_sink_superseded_commands_total",
        "athermal_journal_records_total",
        "athermal_checkpoint_behind_ticks",
        "athermal_swaps_total",
        "athermal_graph_info",
        "athermal_novelty_ratio",
        "athermal_prediction_error_rms",
        "athermal_model_fitted_timestamp_seconds",
    ] {
        assert!(
            text.contains(&format!("\n{name}{{machine=\"line\"")),
            "{name}\n{text}"
        );
    }
}

/// The graph with a range that some samples are not in.
fn ranged() -> String {
    GRAPH.replace(
        "[\"plate\", \"room\"]",
        "[\"plate\", \"room\"], range = [\"20.2 Cel\", \"60 Cel\"]",
    )
}

#[test]
fn what_became_of_samples_is_counted_by_source_channel_and_reason() {
    let bench = Bench::start(&ranged(), "");
    let begin = "athermal_dropped_samples_total{machine=\"line\",source=\"log\",channel=\"temperature.plate\",reason=";
    let accepted =
        "athermal_samples_total{machine=\"line\",source=\"log\",channel=\"temperature.plate\"}";
    bench.until("samples", |of| of["ticks"].as_u64() > Some(200));
    let outside = value(&bench, &format!("{begin}\"out_of_range\"")).unwrap();
    let accepted = value(&bench, accepted).unwrap();
    assert!(
        outside > 20.0 && accepted > 200.0 && outside < accepted / 2.0,
        "{outside} {accepted}"
    );
    for reason in [
        "late",
        "repeated",
        "future",
        "clock",
        "no_number",
        "bad_quality",
        "no_such_name",
    ] {
        assert_eq!(
            value(&bench, &format!("{begin}\"{reason}\"")),
            Some(0.0),
            "{reason}"
        );
    }
    let warnings = "athermal_warnings_total{machine=\"line\",kind=\"rejected_samples\",channel=\"temperature.plate\"}";
    assert_eq!(value(&bench, warnings), Some(1.0));
}

/// The value of a metric in the first line that begins so.
pub(super) fn value(bench: &Bench, begin: &str) -> Option<f64> {
    let text = String::from_utf8(bench.get("/metrics").body).unwrap();
    let line = text.lines().find(|line| line.starts_with(begin))?;
    Some(line.rsplit(' ').next().unwrap().parse().unwrap())
}

#[test]
fn errors_and_novelty_are_those_of_the_predictions() {
    let bench = Bench::start(GRAPH, "");
    bench.until("pairs", |of| of["ticks"].as_u64() > Some(400));
    let nodes = bench.get("/v1/nodes").json();
    let nodes = nodes["nodes"].as_array().unwrap();
    for name in ["learned", "steady"] {
        let node = nodes.iter().find(|of| of["node"] == name).unwrap();
        let [error] = &node["errors"].as_array().unwrap()[..] else {
            panic!("{node:#}")
        };
        // The noise is even over 10 nm. A prediction that was paired with another truth would miss by 40 nm.
        let rmse = error["rmse"].as_f64().unwrap();
        assert!((2.6..3.4).contains(&rmse), "{node:#}");
        assert_eq!(error["unit"], "nm");
        let begin = format!("athermal_prediction_error_rms{{machine=\"line\",prediction=\"{name}");
        let metric = value(&bench, &begin).unwrap();
        assert!((2.6..3.4).contains(&metric), "{begin} {metric}");
        let has_novelty = node["novelty"]
            .as_f64()
            .is_some_and(|of| of > 0.0 && of < 2.0);
        assert_eq!(has_novelty, name == "steady", "{node:#}");
    }
    let steady = "athermal_novelty_ratio{machine=\"line\",node=\"steady\"}";
    assert!(value(&bench, steady).is_some_and(|of| of > 0.0 && of < 2.0));
    assert_eq!(
        value(
            &bench,
            "athermal_novelty_ratio{machine=\"line\",node=\"learned\"}"
        ),
        None
    );
}

#[test]
fn the_model_is_read_once_for_each_revision_and_not_at_each_scrape() {
    let bench = Bench::start(GRAPH, "");
    let fitted = || value(&bench, "athermal_model_fitted_timestamp_seconds");
    let wanted = FITTED.0.parse().ok();
    assert_eq!(fitted(), wanted);
    // It stays known without its file, until another graph runs.
    let models = bench.path("state/models");
    std::fs::rename(&models, bench.path("elsewhere")).unwrap();
    assert_eq!(fitted(), wanted);
    std::fs::rename(bench.path("elsewhere"), &models).unwrap();
    let next = bench.path("next.toml");
    std::fs::write(&next, GRAPH.replace("\"7s\"]", "\"9s\"]")).unwrap();
    let staged = bench.post("/v1/stage", &serde_json::json!({ "path": next }));
    assert_eq!(staged.status, 200, "{:#}", staged.json());
    let committed = bench.post("/v1/commit", &serde_json::json!({}));
    assert_eq!(committed.status, 200, "{:#}", committed.json());
    bench.until("the swap", |of| of["previous"].is_string());
    // A graph that took over with the fits of another has no card of its own.
    assert_eq!(fitted(), None);
}

#[test]
fn the_rules_of_the_guide_are_rules() {
    if !is_there("promtool") {
        return;
    }
    let page = include_str!("../../../../../docs/src/operation.md");
    let rules = page.split("```yaml\ngroups:").nth(1).unwrap();
    let rules = format!("groups:{}", rules.split("```").next().unwrap());
    // A name that no metric has never fires.
    let known = athermal_serve::facts::metric_names();
    let names = rules.split(|c: char| !c.is_ascii_alphanumeric() && c != '_');
    let names: Vec<_> = names.filter(|of| of.starts_with("athermal_")).collect();
    assert!(names.len() > 5);
    for name in names {
        assert!(known.contains(&name), "{name}");
    }
    let path = std::env::temp_dir().join(format!("athermal-rules-{}.yml", std::process::id()));
    std::fs::write(&path, rules).unwrap();
    let out = Command::new("promtool")
        .args(["check", "rules"])
        .arg(&path)
        .output()
        .unwrap();
    std::fs::remove_file(path).unwrap();
    assert!(
        out.status.success(),
        "{}",
        String::from_utf8_lossy(&out.stderr)
    );
}

#[test]
fn a_prometheus_scrapes_a_service() {
    if !is_there("prometheus") {
        return;
    }
    let (port, own) = (free_port(), free_port());
    let bench = Bench::start(
        &ranged(),
        &format!("[control]\nhttp = \"127.0.0.1:{port}\"\n"),
    );
    let config = format!(
        "global: {{ scrape_interval: 1s }}\nscrape_configs:\n- job_name: athermal\n  static_configs:\n  - targets: ['127.0.0.1:{port}']\n"
    );
    let path = bench.path("prometheus.yml");
    std::fs::write(&path, config).unwrap();
    let mut prometheus = Command::new("prometheus")
        .arg(format!("--config.file={}", path.display()))
        .arg(format!(
            "--storage.tsdb.path={}",
            bench.path("tsdb").display()
        ))
        .arg(format!("--web.listen-address=127.0.0.1:{own}"))
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    // What the dashboard asks, as Grafana does.
    let dashboard = include_str!("../../../../../docs/grafana/prometheus.json");
    let dashboard: serde_json::Value = serde_json::from_str(dashboard).unwrap();
    let panels = dashboard["panels"].as_array().unwrap().iter();
    let panels = panels.map(|of| of["targets"][0]["expr"].as_str().unwrap());
    let mut queries: Vec<String> = panels
        .map(|of| {
            of.replace("$machine", "line")
                .replace("$__rate_interval", "10s")
        })
        .collect();
    assert_eq!(queries.len(), 8);
    queries.push("count by (machine) (athermal_ticks_total)".to_owned());
    let (began, mut answer) = (Clock::now(), String::new());
    while let Some(query) = queries.last() {
        let escaped = |of: u8| match of {
            b if b.is_ascii_alphanumeric() || b"_-.".contains(&b) => char::from(b).to_string(),
            b => format!("%{b:02x}"),
        };
        let escaped: String = query.bytes().map(escaped).collect();
        let get = format!(
            "GET /api/v1/query?query={escaped} HTTP/1.1\r\nHost: 127.0.0.1:{own}\r\nConnection: close\r\n\r\n"
        );
        answer = std::net::TcpStream::connect(("127.0.0.1", own))
            .map(|stream| exchange(stream, get.as_bytes()))
            .unwrap_or_default();
        if answer.contains("\"value\":[") {
            queries.pop();
        } else if began.elapsed() > Wait::from_secs(40) {
            break;
        } else {
            std::thread::sleep(Wait::from_millis(200));
        }
    }
    prometheus.kill().unwrap();
    prometheus.wait().unwrap();
    assert!(queries.is_empty(), "{:?}: {answer}", queries.last());
    // The same by hand.
    let mut stream = tcp(port);
    stream
        .write_all(format!("GET /metrics HTTP/1.0\r\nHost: 127.0.0.1:{port}\r\n\r\n").as_bytes())
        .unwrap();
    let mut text = String::new();
    stream.read_to_string(&mut text).unwrap();
    assert!(
        text.starts_with("HTTP/1.0 200") && text.contains("athermal_ticks_total"),
        "{text}"
    );
}
