//! `/metrics`, judged by Prometheus itself.

use std::io::{Read, Write};
use std::process::{Command, Stdio};
use std::time::{Duration as Wait, Instant as Clock};

use super::{Bench, GRAPH, exchange, free_port, tcp};

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
    let bench = Bench::start(GRAPH, "");
    // What the engine thread knows it gives out once a second.
    bench.until("counts", |of| of["behind_s"].is_number());
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
        "athermal_journal_records_total",
        "athermal_checkpoint_behind_ticks",
        "athermal_swaps_total",
        "athermal_graph_info",
    ] {
        assert!(
            text.contains(&format!("\n{name}{{machine=\"line\"")),
            "{name}\n{text}"
        );
    }
}

#[test]
fn the_rules_of_the_guide_are_rules() {
    if !is_there("promtool") {
        return;
    }
    let page = include_str!("../../../../docs/src/operation.md");
    let rules = page.split("```yaml\ngroups:").nth(1).unwrap();
    let rules = format!("groups:{}", rules.split("```").next().unwrap());
    // A name that no metric has never fires.
    let known = include_str!("../metrics.rs");
    let names = rules.split(|c: char| !c.is_ascii_alphanumeric() && c != '_');
    let names: Vec<_> = names.filter(|of| of.starts_with("athermal_")).collect();
    assert!(names.len() > 5);
    for name in names {
        assert!(known.contains(&format!("\"{name}\"")), "{name}");
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
    let bench = Bench::start(GRAPH, &format!("[control]\nhttp = \"127.0.0.1:{port}\"\n"));
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
    let began = Clock::now();
    let query = format!(
        "GET /api/v1/query?query=athermal_ticks_total HTTP/1.1\r\nHost: 127.0.0.1:{own}\r\nConnection: close\r\n\r\n"
    );
    let found = loop {
        std::thread::sleep(Wait::from_millis(200));
        let answer = std::net::TcpStream::connect(("127.0.0.1", own))
            .map(|stream| exchange(stream, query.as_bytes()))
            .unwrap_or_default();
        if answer.contains("\"machine\":\"line\"") || began.elapsed() > Wait::from_secs(40) {
            break answer;
        }
    };
    prometheus.kill().unwrap();
    prometheus.wait().unwrap();
    assert!(found.contains("\"machine\":\"line\""), "{found}");
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
