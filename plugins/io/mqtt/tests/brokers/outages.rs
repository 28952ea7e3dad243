//! What becomes of messages in outages, and that what is lost is reported.

use std::sync::atomic::{AtomicBool, AtomicU64};
use std::thread::{JoinHandle, sleep};
use std::time::Duration;

use crate::peer::publish_all;
use crate::server::{Broker, DEBIAN, Folder, SAFE};
use crate::service::{APART, Running, TOGETHER, both, history, machine, one};

const COUNT: u64 = 600;

fn publish(broker: &Broker) -> JoinHandle<()> {
    let port = broker.port;
    std::thread::spawn(move || {
        let messages: Vec<_> = (0..COUNT)
            .map(|nth| ("plant/all".to_owned(), both(10 * nth)))
            .collect();
        let (published, stop) = (AtomicU64::new(0), AtomicBool::new(false));
        publish_all(
            port,
            &messages,
            Duration::from_millis(10),
            &published,
            &stop,
        );
    })
}

/// Ends the broker in the middle of what is published, and gives how many ticks there are in the end, and what was reported.
fn outage(
    lines: &str,
    end: impl FnOnce(&mut Broker),
    numbers: bool,
) -> Option<(usize, Vec<String>)> {
    let mut broker = Broker::mosquitto(lines)?;
    let folder = Folder::new("outage");
    let source = if numbers {
        TOGETHER.to_owned()
    } else {
        TOGETHER.replace("sequence = \"/n\", ", "")
    };
    let text = machine(broker.port, &source, "").replace("wait = \"20 ms\"", "wait = \"0 ms\"");
    let mut service = Running::start(&folder, &text);
    service.settle();
    let publisher = publish(&broker);
    service.until_given(COUNT);
    end(&mut broker);
    publisher.join().unwrap();
    for _ in 0..8 {
        service.settle();
    }
    let events = service.stop();
    Some((history(&folder).len(), events))
}

fn restart(broker: &mut Broker) {
    sleep(Duration::from_secs(1));
    broker.start();
}

#[test]
fn a_broker_that_is_ended_as_systemd_does_loses_nothing() {
    let ended = outage(
        SAFE,
        |broker| {
            broker.terminate();
            restart(broker);
        },
        true,
    );
    let Some((ticks, events)) = ended else { return };
    assert_eq!(ticks as u64, COUNT, "{events:#?}");
    assert!(
        !events.iter().any(|of| of.contains("gap from")),
        "{events:#?}"
    );
}

#[test]
fn behaviour_19_what_a_broker_with_debians_configuration_loses_is_reported_as_a_gap() {
    for numbers in [true, false] {
        let ended = outage(
            DEBIAN,
            |broker| {
                broker.kill();
                restart(broker);
            },
            numbers,
        );
        let Some((ticks, events)) = ended else { return };
        assert!(
            events
                .iter()
                .any(|of| of.contains("has forgotten the session")),
            "{events:#?}"
        );
        let gaps: Vec<_> = events.iter().filter(|of| of.contains("gap from")).collect();
        // Only a race decides who is back first.
        assert_eq!(
            gaps.is_empty(),
            ticks as u64 == COUNT,
            "{ticks} ticks, {events:#?}"
        );
        if numbers && !gaps.is_empty() {
            let missing = format!(
                "{} messages of `plant/all` are missing",
                COUNT - ticks as u64
            );
            assert!(
                gaps.iter().any(|of| of.contains(&missing)),
                "{missing}: {gaps:#?}"
            );
            assert!(gaps[0].contains("gap from 1970-01-01T00:00:0"), "{gaps:#?}");
        }
    }
}

#[test]
fn behaviour_19_what_a_full_queue_dropped_while_the_service_was_away_is_reported_as_a_gap() {
    let Some(broker) = Broker::mosquitto("max_queued_messages 100\n") else {
        return;
    };
    let folder = Folder::new("queue");
    let text = machine(broker.port, TOGETHER, "");
    let mut service = Running::start(&folder, &text);
    service.settle();
    let mut peer = crate::peer::Peer::connect(broker.port, "peer", true).unwrap();
    let mut publish = |from: u64, to: u64| {
        for nth in from..to {
            peer.publish_safely("plant/all", both(10 * nth).as_bytes(), false);
        }
    };
    publish(0, 50);
    service.until_given(100);
    service.stop();
    publish(50, 500);
    let mut service = Running::start(&folder, &text);
    service.settle();
    publish(500, 550);
    service.until("the gap", |of| of.heard("gap from"));
    service.settle();
    let events = service.stop();
    let ticks = history(&folder).len();
    assert!(ticks < 550, "nothing was dropped");
    let missing = format!("{} messages of `plant/all` are missing", 550 - ticks);
    assert!(
        events.iter().any(|of| of.contains(&missing)),
        "{missing}: {events:#?}"
    );
}

#[test]
fn an_instant_in_the_middle_of_which_the_broker_was_lost_is_whole() {
    let Some(mut broker) = Broker::mosquitto(SAFE) else {
        return;
    };
    let folder = Folder::new("amid");
    let text = machine(broker.port, APART, "")
        .replace("wait = \"20 ms\"", "wait = \"2 s\"")
        .replace("settle = \"0 s\"", "settle = \"3 s\"");
    let mut service = Running::start(&folder, &text);
    (0..6).for_each(|_| service.settle());
    let publish = |topic: &str| {
        let mut peer = crate::peer::Peer::connect(broker.port, "peer", true).unwrap();
        peer.publish_safely(topic, one(1_000).as_bytes(), false);
    };
    publish("plant/plate");
    service.until_given(1);
    broker.kill();
    // Longer than an instant is held by itself.
    (0..5).for_each(|_| service.settle());
    assert!(history(&folder).is_empty(), "{:?}", history(&folder));
    broker.start();
    let mut peer = crate::peer::Peer::connect(broker.port, "peer", true).unwrap();
    peer.publish_safely("plant/room", one(1_000).as_bytes(), false);
    service.until("the row", |_| history(&folder).len() == 1);
    let events = service.stop();
    assert!(!events.iter().any(|of| of.contains("Late")), "{events:#?}");
    assert_eq!(history(&folder).len(), 1);
}

#[test]
fn a_backlog_with_a_hole_longer_than_future_is_taken_whole_and_so_is_what_is_live() {
    let Some(broker) = Broker::mosquitto(SAFE) else {
        return;
    };
    let folder = Folder::new("hole");
    let text = machine(broker.port, TOGETHER, "");
    let mut service = Running::start(&folder, &text);
    service.settle();
    service.stop();
    let mut peer = crate::peer::Peer::connect(broker.port, "peer", true).unwrap();
    let mut publish = |ms: u64| peer.publish_safely("plant/all", both(ms).as_bytes(), false);
    // A minute ago, then nothing, then now.
    publish(1_000_000);
    (0..20).for_each(|nth| publish(1_030_000 + 10 * nth));
    let mut service = Running::start(&folder, &text);
    service.settle();
    for nth in 0..6 {
        publish(1_060_000 + 500 * nth);
        std::thread::sleep(Duration::from_millis(500));
        service.pump();
    }
    service.until("all rows", |_| history(&folder).len() == 27);
    service.stop();
}
