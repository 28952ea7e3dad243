//! A server that is killed, nodes that come later than its port, and a cable that is cut.

use std::time::{Duration, Instant};

use crate::plant::{Folder, Line, Plant};
use crate::service::{GRAPH, Running, history};

fn machine(port: u16) -> String {
    format!(
        "{GRAPH}[runtime]\nwait = \"0 s\"\nsettle = \"0 s\"\n\
         [sources.plc]\ntype = \"opcua\"\nendpoint = \"opc.tcp://127.0.0.1:{port}\"\nnamespace = \"urn:plant\"\n\
         silent = \"3 s\"\nsampling = \"20 ms\"\nretry = \"2 s\"\nchannels = {{ \"temperature.plate\" = \"s=Therm.0\" }}\n\
         [sinks.history]\ntype = \"csv\"\npath = \"history.csv\"\n"
    )
}

/// How long it takes until there are more data.
fn data_again(service: &mut Running, since: Instant) -> Duration {
    let before = service.given();
    service.until("data again", |of| of.given() > before + 5);
    let took = since.elapsed();
    assert!(
        took < Duration::from_secs(6),
        "{took:?}: {:#?}",
        service.events
    );
    took
}

#[test]
fn a_server_that_is_killed_gives_data_again_within_six_seconds_and_so_do_nodes_that_come_later() {
    let Some(mut plant) = Plant::start(&["--hz", "20"]) else {
        return;
    };
    let folder = Folder::new("killed");
    let mut service = Running::start(&folder, &machine(plant.port));
    service.until("data", |of| of.given() > 20);
    plant.kill();
    service.until("it is noticed", |of| !of.counts().is_connected());
    std::thread::sleep(Duration::from_secs(4));
    // The namespace has another number then.
    let back = plant.again(&["--before", "3"]);
    println!(
        "server killed: data {:?} after it is back",
        data_again(&mut service, back)
    );
    plant.kill();
    // The port is there three seconds before the node.
    let there = plant.again(&["--late", "3", "--before", "1"]);
    println!(
        "nodes late: data {:?} after they are there",
        data_again(&mut service, there)
    );
    assert!(
        service.heard("no namespace urn:plant"),
        "{:#?}",
        service.events
    );
    let state = service.samples()["temperature.plate"].state.clone();
    assert_eq!(state.as_deref(), Some("granted 20ms, queue 500"));
    service.stop();
}

#[test]
fn a_cable_that_is_cut_loses_nothing_and_repeats_nothing() {
    let Some(plant) = Plant::start(&["--hz", "50"]) else {
        return;
    };
    let folder = Folder::new("cut");
    let line = Line::to(plant.port);
    let mut service = Running::start(&folder, &machine(line.port));
    service.until("data", |of| of.given() > 50);
    for _ in 0..2 {
        line.cut(true);
        std::thread::sleep(Duration::from_secs(5));
        line.cut(false);
        println!(
            "cable cut: data {:?} after it is back",
            data_again(&mut service, Instant::now())
        );
        std::thread::sleep(Duration::from_secs(2));
        service.pump();
    }
    let repeated: u64 = service.samples()["temperature.plate"]
        .left_out
        .iter()
        .map(|(_, of)| of)
        .sum();
    assert!(!service.heard("gap"), "{:#?}", service.events);
    assert!(service.heard("no sign of life"), "{:#?}", service.events);
    let events = std::mem::take(&mut service.events);
    service.stop();
    let rows = history(&folder);
    let steps = rows
        .windows(2)
        .filter(|of| of[1] != of[0] + 1.0)
        .collect::<Vec<_>>();
    assert!(
        rows.len() > 500 && steps.is_empty(),
        "{} rows, {steps:?}, {events:#?}",
        rows.len()
    );
    assert_eq!(repeated, 0, "{events:#?}");
}
