//! What a service publishes, and what becomes of it in outages.

use std::collections::BTreeSet;
use std::fs;
use std::thread::sleep;
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::peer::{Peer, Received};
use crate::server::{Broker, Folder, SAFE};
use crate::service::{Process, Running, TOGETHER, both, history, machine};

const SECOND: Duration = Duration::from_secs(1);

fn sink(broker: &Broker, keys: &str) -> String {
    let port = broker.port;
    format!("[sinks.out]\ntype = \"mqtt\"\nbroker = \"mqtt://127.0.0.1:{port}\"\n{keys}\n")
}

fn json(of: &Received) -> Value {
    serde_json::from_slice(&of.payload).unwrap()
}

/// Receives until something is true of all that came.
pub fn receive(peer: &mut Peer, mut is: impl FnMut(&[Received]) -> bool) -> Vec<Received> {
    let (mut all, began) = (Vec::new(), Instant::now());
    while !is(&all) {
        assert!(began.elapsed() < 30 * SECOND, "so far: {all:?}");
        all.extend(peer.receive(Duration::from_millis(100)).unwrap());
    }
    all
}

fn times(all: &[Received]) -> Vec<i64> {
    let rows = all.iter().filter(|of| of.topic == "out/tick");
    rows.map(|of| json(of)["time_ns"].as_i64().unwrap())
        .collect()
}

#[test]
fn each_output_has_a_topic_and_the_service_says_that_it_lives() {
    let Some(broker) = Broker::mosquitto(SAFE) else {
        return;
    };
    let folder = Folder::new("outputs");
    let keys =
        "topic = \"out/{output}\"\noutputs = [\"masses\"]\nevery = \"100 ms\"\nretain = true";
    let mut listener = Peer::connect(broker.port, "listener", true).unwrap();
    listener.subscribe("out/#");
    listener.subscribe("athermal-tester-out/alive");
    let mut service = Running::start(
        &folder,
        &machine(broker.port, TOGETHER, &sink(&broker, keys)),
    );
    service.settle();
    let now = std::time::SystemTime::UNIX_EPOCH
        .elapsed()
        .unwrap()
        .as_millis() as u64;
    let mut peer = Peer::connect(broker.port, "peer", true).unwrap();
    for nth in 0..5 {
        peer.publish_safely("plant/all", both(now + 10 * nth).as_bytes(), false);
    }
    service.until("five ticks", |_| history(&folder).len() == 5);
    // Of ticks that are due at once only the newest is a command.
    let all = receive(&mut listener, |all| {
        let alive = all.iter().filter(|of| of.topic.ends_with("/alive")).count();
        let rows = all.iter().filter(|of| of.topic.starts_with("out/"));
        let last = rows.filter(|of| json(of)["time_ns"] == (now + 40) * 1_000_000);
        alive >= 5 && last.count() == 4
    });
    let topics: BTreeSet<_> = all.iter().map(|of| of.topic.clone()).collect();
    assert_eq!(topics.len(), 5, "{topics:?}");
    let row = all
        .iter()
        .rfind(|of| of.topic == "out/masses.plate@3s")
        .map(json)
        .unwrap();
    assert_eq!(row["unit"], "K");
    assert!(
        row["value"].is_f64() && row["behind_s"].as_f64().unwrap() < 5.0,
        "{row}"
    );
    assert_eq!(row["time_ns"], (now + 40) * 1_000_000);
    assert_eq!(row["revision"].as_str().unwrap().len(), 16);
    let alive = all.iter().filter(|of| of.topic.ends_with("/alive"));
    let counts: Vec<_> = alive
        .map(|of| json(of)["count"].as_u64().unwrap())
        .collect();
    assert!(counts.windows(2).all(|of| of[1] == of[0] + 1), "{counts:?}");
    service.stop();
    let last = receive(&mut listener, |all| {
        all.iter().any(|of| json(of)["alive"] == false)
    });
    assert_eq!(json(last.last().unwrap())["alive"], false, "it takes leave");
    // What is retained is there for whoever comes later.
    let mut later = Peer::connect(broker.port, "later", true).unwrap();
    later.subscribe("out/masses.plate@3s");
    assert!(later.receive(SECOND).unwrap().is_some());
}

#[test]
fn a_source_and_a_sink_of_one_name_are_two_clients() {
    let Some(broker) = Broker::mosquitto(SAFE) else {
        return;
    };
    let folder = Folder::new("names");
    let sink = sink(&broker, "topic = \"out/tick\"").replace("sinks.out", "sinks.line");
    let mut listener = Peer::connect(broker.port, "listener", true).unwrap();
    listener.subscribe("athermal-tester-line/alive");
    let mut service = Running::start(&folder, &machine(broker.port, TOGETHER, &sink));
    receive(&mut listener, |all| all.len() >= 3);
    service.pump();
    assert!(!service.heard("SourceFailed"), "{:?}", service.events);
    assert!(!service.heard("SinkFailed"), "{:?}", service.events);
    service.stop();
}

#[test]
fn a_service_that_is_killed_has_a_last_will() {
    let Some(broker) = Broker::mosquitto(SAFE) else {
        return;
    };
    let folder = Folder::new("will");
    let keys = "topic = \"out/tick\"\nalive = \"out/lives\"\nevery = \"50 ms\"";
    let text = machine(broker.port, TOGETHER, &sink(&broker, keys));
    fs::write(folder.0.join("machine.toml"), text).unwrap();
    let mut listener = Peer::connect(broker.port, "listener", true).unwrap();
    listener.subscribe("out/lives");
    let mut service = Process::start(&folder);
    receive(&mut listener, |all| {
        all.iter().any(|of| json(of)["alive"] == true)
    });
    service.kill();
    receive(&mut listener, |all| {
        all.iter().any(|of| json(of)["alive"] == false)
    });
}

#[test]
fn behaviour_23_a_log_is_stored_while_the_broker_is_away_and_published_in_order_also_after_a_restart()
 {
    let Some(source) = Broker::mosquitto(SAFE) else {
        return;
    };
    let Some(mut target) = Broker::mosquitto(SAFE) else {
        return;
    };
    let folder = Folder::new("spool");
    let keys = "topic = \"out/tick\"\nspool = \"1 MB\"";
    let text = machine(source.port, TOGETHER, &sink(&target, keys));
    let mut listener = Peer::connect(target.port, "listener", false).unwrap();
    listener.subscribe("out/tick");
    let mut service = Running::start(&folder, &text);
    service.settle();
    let mut peer = Peer::connect(source.port, "peer", true).unwrap();
    let mut publish = |from: u64, to: u64| {
        for nth in from..to {
            peer.publish_safely("plant/all", both(10 * nth).as_bytes(), false);
        }
    };
    publish(0, 20);
    service.until("ticks", |_| history(&folder).len() == 20);
    let mut all = receive(&mut listener, |all| times(all).len() >= 20);
    listener.leave();
    // By then the broker has saved that all were acknowledged.
    sleep(2 * SECOND);
    target.kill();
    publish(20, 60);
    service.until("that it is reported", |of| {
        of.heard("SinkFailed") && history(&folder).len() == 60
    });
    service.until("the spool", |of| of.spooled("out") == 40);
    // The service ends while the broker is away, and comes back before it does.
    service.stop();
    let mut service = Running::start(&folder, &text);
    service.settle();
    publish(60, 80);
    service.until("ticks", |_| history(&folder).len() == 80);
    target.start();
    let mut listener = Peer::connect(target.port, "listener", false).unwrap();
    assert!(listener.session_present);
    let missing = |all: &[Received]| {
        let found: BTreeSet<_> = times(all).into_iter().collect();
        (0..80).any(|nth| !found.contains(&(nth * 10_000_000)))
    };
    let first = all.clone();
    all.extend(receive(&mut listener, |more| {
        !missing(&[&first, more].concat())
    }));
    service.until("that it is back", |of| of.heard("SinkBack"));
    service.until("an empty spool", |of| of.spooled("out") == 0);
    service.stop();
    // At least once, and in order but for what is published again after a start.
    let times = times(&all);
    let falls = times.windows(2).filter(|of| of[1] < of[0]).count();
    assert!(falls <= 1, "{times:?}");
}

#[test]
fn an_old_command_is_not_sent_once_the_broker_is_back() {
    let Some(source) = Broker::mosquitto(SAFE) else {
        return;
    };
    let Some(mut target) = Broker::mosquitto(SAFE) else {
        return;
    };
    let folder = Folder::new("command");
    let text = machine(
        source.port,
        TOGETHER,
        &sink(&target, "topic = \"out/tick\""),
    );
    let mut listener = Peer::connect(target.port, "listener", false).unwrap();
    listener.subscribe("out/tick");
    drop(listener);
    let mut service = Running::start(&folder, &text);
    service.settle();
    let mut peer = Peer::connect(source.port, "peer", true).unwrap();
    let mut publish = |from: u64, to: u64| {
        for nth in from..to {
            peer.publish_safely("plant/all", both(10 * nth).as_bytes(), false);
        }
    };
    publish(0, 5);
    service.until("ticks", |_| history(&folder).len() == 5);
    sleep(SECOND);
    target.kill();
    publish(5, 10);
    service.until("that it is reported", |of| {
        of.heard("SinkFailed") && history(&folder).len() == 10
    });
    target.start();
    service.until("that it is back", |of| of.heard("SinkBack"));
    let mut listener = Peer::connect(target.port, "listener", false).unwrap();
    let (mut all, mut nth) = (Vec::new(), 10);
    // On a machine in full use it may be back for a moment only.
    while !times(&all).iter().any(|of| *of >= 100_000_000) {
        assert!(nth < 300, "{:?}", times(&all));
        publish(nth, nth + 1);
        nth += 1;
        all.extend(listener.receive(Duration::from_millis(200)).unwrap());
    }
    // Those that were published while the connection came may have been too old by then; from here on none is.
    publish(nth, nth + 5);
    let last = 10_000_000 * (i64::try_from(nth).unwrap() + 4);
    all.extend(receive(&mut listener, |more| times(more).contains(&last)));
    service.stop();
    let found = times(&all);
    assert!(
        (5..10).all(|nth| !found.contains(&(nth * 10_000_000))),
        "{found:?}"
    );
    let nth = i64::try_from(nth).unwrap();
    // Of those that were due at once only the newest is a command.
    assert!(
        [4, nth + 4]
            .iter()
            .all(|nth| found.contains(&(nth * 10_000_000))),
        "{found:?}"
    );
}
