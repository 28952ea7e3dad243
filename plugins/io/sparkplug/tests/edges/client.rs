//! What edge nodes with aliases, devices and a store send, and what they hear.

use std::thread::sleep;
use std::time::Duration;

use serde_json::{Value, json};

use crate::host::Host;
use crate::peers::{Broker, Edge, Folder, Make, until};

/// Each sample is a row.
const PLAIN: &str = "{ wait = \"0 s\", settle = \"2 s\" }";
/// The same, and nothing but the source holds back what is live: it is known what time it is.
const AT_ONCE: &str = "{ wait = \"0 s\", settle = \"0 s\", future = \"1d\" }";

fn start(arguments: &[&str]) -> Option<(Broker, Edge, Folder)> {
    let broker = Broker::start(Make::Client)?;
    let edge = Edge::start(Make::Client, broker.port, arguments);
    Some((broker, edge, Folder::new("client")))
}

fn look(edge: &mut Edge) -> Value {
    edge.order(&json!({ "do": "look" }))
}

fn asked(edge: &mut Edge) -> u64 {
    look(edge)["asked"].as_u64().unwrap()
}

#[test]
fn values_of_a_device_come_by_their_alias_until_it_is_dead_and_again_after_its_birth() {
    let Some((broker, mut edge, folder)) = start(&[]) else {
        return;
    };
    let port = broker.port;
    let mut host = Host::of(&folder.0, port, "athermal", ("edge/d:A/B", PLAIN));
    until("it is asked for a birth", || asked(&mut edge) == 1);
    let device = |value: f64| json!({ "do": "data", "value": value, "device": "d" });
    edge.order(&device(5.5));
    until("a value", || host.last() == Some(5.5));
    edge.order(&json!({ "do": "packed" }));
    until("it is left out", || host.unreadable() == 1);
    edge.kill();
    until("the death", || host.is_dead() && host.last().is_none());
    let mut edge = Edge::start(Make::Client, port, &[]);
    edge.order(&device(6.5));
    until("a value again", || host.last() == Some(6.5));
    assert_eq!(asked(&mut edge), 0, "it was born by itself");
    host.stop();
}

#[test]
fn data_by_an_alias_before_a_birth_are_given_after_it_and_an_unknown_alias_asks_for_another() {
    let Some((broker, mut edge, folder)) = start(&["--slow"]) else {
        return;
    };
    let mut host = Host::of(&folder.0, broker.port, "athermal", ("edge:T", PLAIN));
    until("it is asked for a birth", || asked(&mut edge) == 1);
    for value in [1.5, 2.5, 3.5] {
        edge.publish(value);
        sleep(Duration::from_millis(20));
    }
    until("all", || host.rows().len() == 3);
    assert_eq!(host.rows(), [Some(1.5), Some(2.5), Some(3.5)]);
    edge.order(&json!({ "do": "unknown" }));
    until("it is asked again", || asked(&mut edge) == 2);
    assert_eq!(look(&mut edge)["births"], 1, "it was born once");
    host.stop();
}

#[test]
fn a_gap_in_each_message_is_reported_and_asks_for_a_birth_each_five_seconds_and_no_value_is_lost() {
    let Some((broker, mut edge, folder)) = start(&[]) else {
        return;
    };
    let mut host = Host::of(&folder.0, broker.port, "athermal", ("edge:T", PLAIN));
    until("it is asked for a birth", || asked(&mut edge) == 1);
    for nth in 1..=60 {
        edge.order(&json!({ "do": "skip" }));
        edge.publish(f64::from(nth));
        sleep(Duration::from_millis(100));
    }
    // Births that another host asks for are none of ours.
    for _ in 0..30 {
        edge.order(&json!({ "do": "birth" }));
    }
    let expected = [20].into_iter().chain(1..=60);
    let expected: Vec<_> = expected.map(|of| Some(f64::from(of))).collect();
    until("all", || host.rows().len() >= expected.len());
    assert_eq!(host.rows(), expected);
    assert!(host.heard("gap: 1 messages of edge node `edge` are missing"));
    let times = asked(&mut edge);
    assert!((2..=3).contains(&times), "it was asked {times} times");
    host.stop();
}

#[test]
fn two_hosts_have_all_values_and_each_says_by_the_time_of_its_session_that_it_is_there() {
    let Some((broker, mut edge, folder)) = start(&["--store"]) else {
        return;
    };
    let of = |id| Host::of(&folder.0.join(id), broker.port, id, ("edge:T", PLAIN));
    let (mut host, mut second) = (of("athermal"), of("second"));
    until("both", || host.is_connected() && second.is_connected());
    until("the edge knows it", || look(&mut edge)["isOnline"] == true);
    edge.publish(1.5);
    until("a value", || {
        host.last() == Some(1.5) && second.last() == Some(1.5)
    });
    // Another host that goes is not the one that the edge node stores for.
    second.stop();
    let states = |edge: &mut Edge, host: &str| -> Vec<(bool, i64)> {
        let all = look(edge)["states"].as_array().unwrap().clone();
        let own = all.iter().filter(|of| of["host"] == host);
        own.map(|of| (of["online"] == true, of["timestamp"].as_i64().unwrap()))
            .collect()
    };
    until("it is gone", || states(&mut edge, "second").len() == 2);
    edge.publish(2.5);
    until("a value of one", || host.last() == Some(2.5));
    // Another of the same id says that it goes: this one has not.
    let topic = "spBv1.0/STATE/athermal";
    let gone = json!({ "online": false, "timestamp": 12345 }).to_string();
    edge.order(&json!({ "do": "publish", "topic": topic, "text": gone }));
    until("it is there", || states(&mut edge, "athermal").len() == 3);
    edge.publish(3.5);
    until("a value after it", || host.last() == Some(3.5));
    // The broker says it where the connection is lost, and the next session has a time of its own.
    edge.order(&json!({ "do": "steal", "id": "host-athermal" }));
    until("the next session", || {
        states(&mut edge, "athermal").len() == 5
    });
    edge.publish(4.5);
    until("a value of it", || host.last() == Some(4.5));
    let own = states(&mut edge, "athermal");
    let (first, next) = (own[0].1, own[4].1);
    let expected = [
        (true, first),
        (false, 12345),
        (true, first),
        (false, first),
        (true, next),
    ];
    assert_eq!(own, expected);
    assert!(next > first && next > states(&mut edge, "second")[0].1);
    let words = "another host of this id publishes its STATE";
    let remarks = host.events.iter().filter(|of| of.contains(words));
    assert_eq!(remarks.count(), 1, "{:#?}", host.events);
    host.stop();
}

#[test]
fn what_an_edge_stores_while_the_host_is_away_comes_once_in_order_and_whole() {
    let Some((broker, mut edge, folder)) = start(&["--store"]) else {
        return;
    };
    let of = || Host::of(&folder.0, broker.port, "athermal", ("edge:T", AT_ONCE));
    let mut host = of();
    let mut value = 0.0;
    let mut publish = |edge: &mut Edge, count| {
        for _ in 0..count {
            value += 1.0;
            edge.publish(value);
            sleep(Duration::from_millis(100));
        }
    };
    until("the edge knows it", || look(&mut edge)["isOnline"] == true);
    publish(&mut edge, 20);
    host.pump();
    host.stop();
    until("the edge knows it", || look(&mut edge)["isOnline"] == false);
    publish(&mut edge, 100);
    let held = look(&mut edge)["stored"].clone();
    assert_eq!(held, 100);
    // What is live goes on while what was stored comes.
    let mut host = of();
    for _ in 0..30 {
        publish(&mut edge, 1);
        host.pump();
    }
    let expected = [20].into_iter().chain(1..=150);
    let expected: Vec<_> = expected.map(|of| Some(f64::from(of))).collect();
    until("all", || host.rows().len() >= expected.len());
    assert_eq!(host.rows(), expected);
    host.stop();
}
