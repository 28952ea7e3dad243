//! Five hundred nodes, ten times a second.

use std::time::{Duration, Instant};

use athermal_serve::testkit::SourceTrial;
use serde_json::json;

use crate::plant::{Folder, Plant, until};
use crate::service::{GRAPH, declared};

/// CPU and memory of this process: seconds, and megabytes at most.
fn used() -> (f64, f64) {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let fields: Vec<_> = stat
        .rsplit(')')
        .next()
        .unwrap_or_default()
        .split_whitespace()
        .collect();
    let ticks = |nth: usize| {
        fields
            .get(nth)
            .and_then(|of| of.parse::<f64>().ok())
            .unwrap_or(0.0)
    };
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let most = status.lines().find_map(|of| of.strip_prefix("VmHWM:"));
    let most = most.and_then(|of| of.split_whitespace().next()?.parse::<f64>().ok());
    (
        (ticks(11) + ticks(12)) / 100.0,
        most.unwrap_or(0.0) / 1024.0,
    )
}

fn load(nodes: usize, seconds: u64) {
    let count = nodes.to_string();
    let Some(mut plant) = Plant::start(&["--nodes", &count, "--hz", "10"]) else {
        return;
    };
    let folder = Folder::new("load");
    let machine = format!(
        "{GRAPH}[sources.plc]\ntype = \"opcua\"\nendpoint = \"opc.tcp://127.0.0.1:{}\"\nnamespace = \"urn:plant\"\nqueue = 100\n\
         channels = {{ \"temperature.plate\" = \"s=Therm.0\" }}\n",
        plant.port
    );
    let (_, deployment) = declared(&folder, &machine).unwrap_or_else(|of| panic!("{of}"));
    let names: Vec<_> = (0..nodes)
        .map(|of| (format!("c{of}"), format!("s=Therm.{of}")))
        .collect();
    let channels: Vec<_> = names
        .iter()
        .map(|(a, b)| (a.as_str(), b.as_str()))
        .collect();
    let trial = SourceTrial::new(&*deployment.sources[0].parameters, &folder.0, &channels);
    let mut tried = trial.start().unwrap();
    let mut values = vec![Vec::new(); nodes];
    let mut take = |tried: &mut athermal_serve::testkit::Tried| {
        for of in tried.take() {
            values[of.channel].push(of.value);
        }
        values.iter().filter(|of| !of.is_empty()).count()
    };
    until("all nodes", Duration::from_secs(60), || {
        take(&mut tried) == nodes
    });
    let counted = |plant: &mut Plant| plant.order(&json!({ "do": "count" }));
    let (theirs, (cpu, _)) = (counted(&mut plant), used());
    let began = Instant::now();
    while began.elapsed() < Duration::from_secs(seconds) {
        take(&mut tried);
        std::thread::sleep(Duration::from_millis(20));
    }
    let (after, took) = (counted(&mut plant), began.elapsed().as_secs_f64());
    plant.order(&json!({ "do": "run", "runs": false }));
    std::thread::sleep(Duration::from_secs(2));
    take(&mut tried);
    let last = counted(&mut plant)["count"].as_f64().unwrap();
    let counts = std::sync::Arc::clone(&tried.counts);
    let remarks = tried.remarks();
    tried.end(&mut Vec::new()).unwrap().unwrap();
    let missing = values.iter().enumerate().filter(|(_, of)| {
        let whole = of.windows(2).all(|of| of[1] == of[0] + 1.0);
        !whole || of.last() != Some(&last)
    });
    let missing: Vec<_> = missing
        .map(|(nth, of)| (nth, of.len(), of.last().copied()))
        .collect();
    let all: usize = values.iter().map(Vec::len).sum();
    let of = |key: &str| after[key].as_f64().unwrap() - theirs[key].as_f64().unwrap();
    let (ours, most) = used();
    let asked = 10.0 * took;
    println!(
        "{nodes} nodes at 10 Hz for {took:.0} s: {all} values came, of all that were written; the server wrote {} rounds of {asked:.0} asked, \
         {} of them late, with {:.0} % of a core and {:.0} MB; we took {:.0} % of a core and {most:.0} MB",
        of("count"),
        of("late"),
        100.0 * of("cpu_s") / took,
        after["mb"].as_f64().unwrap(),
        100.0 * (ours - cpu) / took,
    );
    assert!(missing.is_empty(), "of {last}: {missing:?} {remarks:?}");
    assert_eq!(counts.dropped.load(std::sync::atomic::Ordering::Relaxed), 0);
    assert!(!remarks.iter().any(|of| of.contains("gap")), "{remarks:?}");
}

#[test]
fn every_change_that_the_server_queued_arrives() {
    load(100, 4);
}

#[test]
#[ignore = "a minute, and five of them in the long mode"]
fn five_hundred_nodes_at_ten_hertz() {
    load(
        500,
        if std::env::var_os("ATHERMAL_LONG").is_some() {
            300
        } else {
            60
        },
    );
}
