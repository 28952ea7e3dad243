//! Broker and service are killed at random instants: nothing is lost, and the outputs are those of an undisturbed run, to the bit.

use std::fs;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use athermal_core::prng::Prng;

use crate::peer::publish_all;
use crate::server::{Broker, Folder, SAFE};
use crate::service::{APART, Process, TOGETHER, both, history, machine, one};

const PACE: Duration = Duration::from_millis(10);

/// Both values in a message, or a message for each.
fn messages(source: &str, count: u64) -> Vec<(String, String)> {
    let all = |nth: u64| match source == APART {
        true => ["plant/plate", "plant/room"]
            .map(|topic| (topic.to_owned(), one(10 * nth)))
            .to_vec(),
        false => vec![("plant/all".to_owned(), both(10 * nth))],
    };
    (0..count).flat_map(all).collect()
}

/// Who is killed.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Victim {
    Broker,
    Service,
    Either,
}

struct Run {
    history: Vec<String>,
    events: String,
}

/// Ten messages are thinned to one; the last ten may yet go on.
fn thinned() -> String {
    format!("mean = \"100 ms\"\n{TOGETHER}")
}

/// How many rows come of so many messages.
fn rows_of(source: &str, count: u64) -> u64 {
    match source.starts_with("mean") {
        true => count / 10,
        false => count,
    }
}

/// Publishes so many messages while somebody is killed so many times.
fn run(
    broker: &mut Broker,
    source: &str,
    count: u64,
    kills: usize,
    victim: Victim,
    seed: u64,
) -> Run {
    let folder = Folder::new("kills");
    // A backlog after an outage is in order: the last before it, again, and those behind.
    let text = machine(broker.port, source, "").replace("wait = \"20 ms\"", "wait = \"0 ms\"");
    // A NATS server gives what was not acknowledged again behind what is new, once its `ack_wait` is over.
    let text = match broker.is_nats() && victim != Victim::Broker {
        true => text.replace("settle = \"0 s\"", "settle = \"5 s\""),
        false => text,
    };
    // The other value of an instant may be given again behind what follows.
    let text = match source == APART {
        true => text
            .replace("wait = \"0 ms\"", "wait = \"2 s\"")
            .replace("settle = \"0 s\"", "settle = \"2 s\""),
        false => text,
    };
    fs::write(folder.0.join("machine.toml"), text).unwrap();
    let mut service = Process::start(&folder);
    // The first connection makes the session; what is published before it is nobody's.
    let began = Instant::now();
    while !folder
        .0
        .join("state/sources/line/subscriptions.json")
        .exists()
    {
        assert!(
            began.elapsed() < Duration::from_secs(30),
            "it does not connect"
        );
        std::thread::sleep(Duration::from_millis(20));
    }
    std::thread::sleep(Duration::from_millis(500));
    let (published, stop) = (
        Arc::new(AtomicU64::new(0)),
        Arc::new(AtomicBool::new(false)),
    );
    let publisher = {
        let (published, stop, port) = (Arc::clone(&published), Arc::clone(&stop), broker.port);
        let messages = messages(source, count);
        std::thread::spawn(move || publish_all(port, &messages, PACE, &published, &stop))
    };
    let mut prng = Prng::stream(seed, "kills");
    for nth in 0..kills {
        // While it settles nothing is stepped, and a broker that saves at each change saves all that waits: what waits is to stay small.
        if nth % 30 == 29 {
            std::thread::sleep(Duration::from_secs(10));
        }
        std::thread::sleep(Duration::from_millis(
            400 + (prng.uniform() * 1200.0) as u64,
        ));
        let is_broker = match victim {
            Victim::Broker => true,
            Victim::Service => false,
            Victim::Either => nth % 2 == 0,
        };
        if is_broker {
            broker.kill();
            std::thread::sleep(Duration::from_millis((prng.uniform() * 300.0) as u64));
            broker.start();
        } else {
            service.kill();
            std::thread::sleep(Duration::from_millis((prng.uniform() * 300.0) as u64));
            service = Process::start(&folder);
        }
    }
    // However long it takes, as long as it goes on.
    let (mut rows, mut grown) = (0, Instant::now());
    while rows < rows_of(source, count) as usize && grown.elapsed() < Duration::from_secs(60) {
        std::thread::sleep(Duration::from_millis(200));
        let now = history(&folder).len();
        if now > rows {
            (rows, grown) = (now, Instant::now());
        }
    }
    stop.store(true, Ordering::Relaxed);
    publisher.join().unwrap();
    service.stop(&folder);
    Run {
        history: history(&folder),
        events: crate::server::read(&folder.0.join("events")),
    }
}

/// Compares a run with one that nobody disturbed.
fn nothing_is_lost(mut broker: Broker, source: &str, count: u64, kills: usize, victim: Victim) {
    let undisturbed = run(&mut broker, source, count, 0, victim, 0);
    assert_eq!(
        undisturbed.history.len() as u64,
        rows_of(source, count),
        "{}",
        undisturbed.events
    );
    broker.kill();
    broker.forget();
    broker.start();
    let disturbed = run(&mut broker, source, count, kills, victim, 1);
    let (found, expected) = (&disturbed.history, &undisturbed.history);
    if let Some(place) = (0..expected.len()).find(|&nth| found.get(nth) != Some(&expected[nth])) {
        panic!(
            "row {place} of {}: {:?} is not {:?}; {} rows came\n{}",
            expected.len(),
            found.get(place),
            expected[place],
            found.len(),
            disturbed.events
        );
    }
    assert_eq!(found.len(), expected.len());
}

fn kills(short: usize, long: usize) -> (usize, u64) {
    let kills = match std::env::var("ATHERMAL_LONG").is_ok_and(|of| of == "1") {
        true => long,
        false => short,
    };
    // As long as the kills take, at 100 messages a second.
    (kills, 120 * kills as u64 + 300)
}

#[test]
fn behaviour_13_a_service_that_is_killed_again_and_again_loses_nothing() {
    let Some(broker) = Broker::mosquitto(SAFE) else {
        return;
    };
    let (kills, count) = kills(15, 500);
    nothing_is_lost(broker, TOGETHER, count, kills, Victim::Service);
}

#[test]
fn behaviour_13_a_service_that_is_killed_loses_no_value_where_each_is_a_message() {
    let Some(broker) = Broker::mosquitto(SAFE) else {
        return;
    };
    let (kills, count) = kills(8, 200);
    nothing_is_lost(broker, APART, count / 2, kills, Victim::Service);
}

#[test]
fn behaviour_13_a_service_that_is_killed_loses_nothing_of_what_it_thins() {
    let Some(broker) = Broker::mosquitto(SAFE) else {
        return;
    };
    let (kills, count) = kills(8, 200);
    nothing_is_lost(broker, &thinned(), count, kills, Victim::Service);
}

#[test]
fn behaviour_13_broker_and_service_are_killed_in_turn_and_no_value_is_lost_where_each_is_a_message()
{
    let Some(broker) = Broker::mosquitto(SAFE) else {
        return;
    };
    let (kills, count) = kills(8, 200);
    nothing_is_lost(broker, APART, count / 2, kills, Victim::Either);
}

#[test]
fn behaviour_13_broker_and_service_are_killed_in_turn_and_nothing_is_lost() {
    let Some(broker) = Broker::mosquitto(SAFE) else {
        return;
    };
    let (kills, count) = kills(30, 1_000);
    nothing_is_lost(broker, TOGETHER, count, kills, Victim::Either);
}

#[test]
fn behaviour_13_acknowledged_after_a_sync_of_the_disk_nothing_is_lost_either() {
    let Some(broker) = Broker::mosquitto(SAFE) else {
        return;
    };
    let source = format!("ack = \"synced\"\nreceive_maximum = 5000\n{TOGETHER}");
    let (kills, count) = kills(5, 200);
    nothing_is_lost(broker, &source, count, kills, Victim::Service);
}

#[test]
fn behaviour_13_with_mqtt_3_1_1_nothing_is_lost_either() {
    let Some(broker) = Broker::mosquitto(SAFE) else {
        return;
    };
    let source = format!("version = \"3.1.1\"\n{TOGETHER}");
    let (kills, count) = kills(5, 200);
    nothing_is_lost(broker, &source, count, kills, Victim::Either);
}

#[test]
fn behaviour_13_a_nats_server_that_is_killed_loses_nothing() {
    let Some(broker) = Broker::nats("2s") else {
        return;
    };
    let (kills, count) = kills(5, 100);
    nothing_is_lost(broker, TOGETHER, count, kills, Victim::Broker);
}

#[test]
fn behaviour_13_a_service_that_is_killed_at_a_nats_server_loses_nothing() {
    let Some(broker) = Broker::nats("2s") else {
        return;
    };
    let source = format!("receive_maximum = 5000\n{TOGETHER}");
    let (kills, count) = kills(5, 100);
    nothing_is_lost(broker, &source, count, kills, Victim::Service);
}
