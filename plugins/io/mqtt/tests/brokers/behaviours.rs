//! What decides whether one trusts it, each on a real broker, or on one by hand where no real one does so.

use std::fs;
use std::io::Read;
use std::net::{TcpListener, TcpStream};
use std::sync::mpsc::{Sender, channel};
use std::thread::sleep;
use std::time::{Duration, Instant};

use athermal_serve::service::ServiceEvent;

use crate::peer::{Peer, cut, write};
use crate::server::{Broker, Folder, Line, SAFE};
use crate::service::{APART, Running, TOGETHER, both, history, machine, one};

const SECOND: Duration = Duration::from_secs(1);

fn peer(broker: &Broker) -> Peer {
    Peer::connect(broker.port, "peer", true).unwrap()
}

#[test]
fn behaviour_01_a_broker_that_is_away_at_the_start_does_not_end_the_service() {
    let Some(mut broker) = Broker::mosquitto_down(SAFE) else {
        return;
    };
    let folder = Folder::new("b01");
    let mut service = Running::start(&folder, &machine(broker.port, TOGETHER, ""));
    service.until("that it fails", |of| of.heard("SourceFailed"));
    broker.start();
    // What is published before it subscribes is nobody's.
    let mut ms = 0;
    let mut peer = peer(&broker);
    service.until("a sample", |of| {
        ms += 10;
        peer.publish_safely("plant/all", both(ms).as_bytes(), false);
        of.given() > 0
    });
    service.stop();
}

#[test]
fn behaviour_03_data_come_back_after_a_cable_was_cut_and_nothing_is_lost() {
    let Some(broker) = Broker::mosquitto(SAFE) else {
        return;
    };
    let (folder, line) = (Folder::new("b03"), Line::to(broker.port));
    let source = format!("keep_alive = \"5 s\"\n{TOGETHER}");
    let mut service = Running::start(&folder, &machine(line.port, &source, ""));
    service.settle();
    let mut peer = peer(&broker);
    let mut publish = |from: u64, to: u64| {
        for nth in from..to {
            peer.publish_safely("plant/all", both(10 * nth).as_bytes(), false);
        }
    };
    publish(0, 50);
    service.until_given(100);
    line.cut(true);
    publish(50, 100);
    service.until("that the line is silent", |of| of.heard("SourceFailed"));
    line.cut(false);
    service.until("all ticks", |_| history(&folder).len() >= 100);
    service.stop();
    assert_eq!(history(&folder).len(), 100);
}

#[test]
fn behaviour_12_a_retained_message_is_no_fresh_sample_unless_it_is_asked_for() {
    let Some(broker) = Broker::mosquitto(SAFE) else {
        return;
    };
    peer(&broker).publish_safely("plant/all", both(10).as_bytes(), true);
    for (retained, samples) in [("ignore", 0), ("take", 2)] {
        let folder = Folder::new("b12");
        let source = format!("retained = \"{retained}\"\nclient_id = \"{retained}\"\n{TOGETHER}");
        let mut service = Running::start(&folder, &machine(broker.port, &source, ""));
        if samples == 0 {
            service.until("that it is left out", |of| of.heard("a retained message"));
        }
        service.settle();
        assert_eq!(service.given(), samples, "{:?}", service.events);
        service.stop();
    }
}

#[test]
fn behaviour_14_changed_topics_take_effect_although_the_session_is_kept() {
    let Some(broker) = Broker::mosquitto(SAFE) else {
        return;
    };
    let folder = Folder::new("b14");
    let old = APART.replace("plant/", "old/");
    let mut service = Running::start(&folder, &machine(broker.port, &old, ""));
    service.settle();
    service.stop();
    let mut service = Running::start(&folder, &machine(broker.port, APART, ""));
    service.settle();
    let mut peer = peer(&broker);
    peer.publish_safely("old/plate", one(10).as_bytes(), false);
    peer.publish_safely("plant/plate", one(20).as_bytes(), false);
    service.until_given(1);
    service.settle();
    assert_eq!(service.given(), 1);
    // Would it still be subscribed to, it would come and be left out.
    assert!(
        !service.heard("nothing is asked of its topic"),
        "{:?}",
        service.events
    );
    let known = fs::read_to_string(folder.0.join("state/sources/line/subscriptions.json")).unwrap();
    assert!(!known.contains("old/"), "{known}");
    service.stop();
}

#[test]
fn behaviour_15_a_broker_without_the_session_is_asked_again() {
    let Some(mut broker) = Broker::mosquitto(SAFE) else {
        return;
    };
    let folder = Folder::new("b15");
    let mut service = Running::start(&folder, &machine(broker.port, TOGETHER, ""));
    service.settle();
    broker.kill();
    broker.forget();
    broker.start();
    service.until("that it is reported", |of| {
        of.heard("has forgotten the session")
    });
    service.settle();
    peer(&broker).publish_safely("plant/all", both(10).as_bytes(), false);
    service.until_given(2);
    service.stop();
}

/// A broker by hand: it answers a SUBSCRIBE as it is asked to, and reports the filters.
fn by_hand(answers: Vec<Option<u8>>) -> (u16, std::sync::mpsc::Receiver<Vec<String>>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = listener.local_addr().unwrap().port();
    let (tell, asked) = channel();
    std::thread::spawn(move || {
        let mut answers = answers.into_iter();
        for stream in listener.incoming().flatten() {
            let _ = serve(stream, &mut answers, &tell);
        }
    });
    (port, asked)
}

fn serve(
    mut stream: TcpStream,
    answers: &mut impl Iterator<Item = Option<u8>>,
    tell: &Sender<Vec<String>>,
) -> std::io::Result<()> {
    let (mut bytes, mut piece) = (Vec::new(), [0; 4096]);
    loop {
        let count = stream.read(&mut piece)?;
        if count == 0 {
            return Ok(());
        }
        bytes.extend_from_slice(&piece[..count]);
        while let Some((first, body)) = cut(&mut bytes) {
            match first >> 4 {
                1 => write(&mut stream, 0x20, &[0, 0])?,
                8 => {
                    let (mut filters, mut at) = (Vec::new(), 2);
                    while at < body.len() {
                        let length = usize::from(u16::from_be_bytes([body[at], body[at + 1]]));
                        let text = body[at + 2..at + 2 + length].to_vec();
                        filters.push(String::from_utf8(text).unwrap());
                        at += 3 + length;
                    }
                    let count = filters.len();
                    let _ = tell.send(filters);
                    // Without an answer the connection ends.
                    let Some(code) = answers.next().unwrap_or(Some(1)) else {
                        return Ok(());
                    };
                    let mut codes = vec![1; count];
                    codes[0] = code;
                    write(&mut stream, 0x90, &[&body[..2], &codes].concat())?;
                }
                12 => write(&mut stream, 0xd0, &[])?,
                _ => {}
            }
        }
    }
}

#[test]
fn behaviour_02_a_refused_topic_is_reported_and_asked_again_and_the_others_are_not() {
    let (port, asked) = by_hand(vec![Some(0x80), Some(0x80), Some(1)]);
    let folder = Folder::new("b02");
    let source = format!("version = \"3.1.1\"\n{APART}");
    let mut service = Running::start(&folder, &machine(port, &source, ""));
    service.until("that it is reported", |of| {
        of.heard("the broker refuses `plant/plate`")
    });
    let mut filters = Vec::new();
    service.until("three requests", |_| {
        filters.extend(asked.try_iter());
        filters.len() == 3
    });
    assert_eq!(filters[0], ["plant/plate", "plant/room"]);
    assert_eq!(filters[1..], [["plant/plate"], ["plant/plate"]]);
    service.settle();
    assert!(
        asked.try_recv().is_err(),
        "it is not asked again once it was granted"
    );
    service.stop();
}

#[test]
fn behaviour_10_a_lower_quality_of_service_than_was_asked_for_is_reported() {
    let (port, _asked) = by_hand(vec![Some(0)]);
    let folder = Folder::new("b10");
    let source = format!("version = \"3.1.1\"\n{APART}");
    let mut service = Running::start(&folder, &machine(port, &source, ""));
    service.until("that it is reported", |of| {
        of.heard("the broker grants `plant/plate` with QoS 0")
    });
    assert!(!service.heard("plant/room"), "{:?}", service.events);
    service.stop();
}

#[test]
fn behaviour_15_a_subscription_without_an_answer_is_made_again_on_the_next_connection() {
    let (port, asked) = by_hand(vec![None, None, Some(1)]);
    let folder = Folder::new("b15b");
    let source = format!("version = \"3.1.1\"\n{TOGETHER}");
    let mut service = Running::start(&folder, &machine(port, &source, ""));
    let mut count = 0;
    service.until("three requests", |_| {
        count += asked.try_iter().count();
        count == 3
    });
    service.stop();
}

#[test]
fn behaviour_16_an_id_that_is_used_twice_is_reported_and_nothing_is_tried_for_a_minute() {
    let Some(broker) = Broker::mosquitto(SAFE) else {
        return;
    };
    for version in ["5", "3.1.1"] {
        let folder = Folder::new("b16");
        let source = format!("version = \"{version}\"\n{TOGETHER}");
        let mut service = Running::start(&folder, &machine(broker.port, &source, ""));
        service.settle();
        // Another one with its id, each time that it comes back.
        let began = Instant::now();
        service.until("that it is reported", |of| {
            let _other = Peer::connect(broker.port, "athermal-tester-line", false);
            sleep(Duration::from_millis(100));
            of.heard("two clients have the id `athermal-tester-line`")
        });
        assert!(began.elapsed() < Duration::from_secs(20));
        let failures = service
            .events
            .iter()
            .filter(|of| of.contains("SourceFailed"))
            .count();
        assert_eq!(failures, 3, "{:#?}", service.events);
        // It would have come back by now.
        let until = Instant::now() + 3 * SECOND;
        while Instant::now() < until {
            service.pump();
            sleep(Duration::from_millis(20));
        }
        let mut other = Peer::connect(broker.port, "athermal-tester-line", false).unwrap();
        assert!(other.packet(SECOND).is_ok(), "nobody takes it over");
        service.stop();
    }
}

#[test]
fn behaviour_17_a_broker_that_is_away_is_tried_ever_more_rarely() {
    let folder = Folder::new("b17");
    let mut service = Running::start(&folder, &machine(crate::server::free_port(), TOGETHER, ""));
    let mut pauses = Vec::new();
    let began = Instant::now();
    while pauses.len() < 4 && began.elapsed() < 30 * SECOND {
        for event in service.pump() {
            if let ServiceEvent::SourceFailed { again_s, .. } = event {
                pauses.push(again_s);
            }
        }
        sleep(Duration::from_millis(10));
    }
    for (pause, about) in pauses.iter().zip([0.5, 1.0, 2.0, 4.0]) {
        assert!((0.8 * about..=1.2 * about).contains(pause), "{pauses:?}");
    }
    assert_eq!(pauses.len(), 4);
    service.stop();
}

#[test]
fn behaviour_18_a_backlog_is_taken_as_fast_as_the_journal_goes_and_the_connection_stays() {
    let Some(broker) = Broker::mosquitto(SAFE) else {
        return;
    };
    let folder = Folder::new("b18");
    let source = format!("receive_maximum = 50\nkeep_alive = \"5 s\"\n{TOGETHER}");
    let text = machine(broker.port, &source, "");
    let mut service = Running::start(&folder, &text);
    service.settle();
    service.stop();
    let mut peer = peer(&broker);
    for nth in 0..5_000 {
        peer.publish("plant/all", both(10 * nth).as_bytes(), 0)
            .unwrap();
    }
    let mut answers = 0;
    while answers < 5_000 {
        answers += usize::from(peer.packet(5 * SECOND).unwrap().unwrap().0 == 0x40);
    }
    let mut service = Running::start(&folder, &text);
    service.until_given(10_000);
    service.until("all ticks", |_| history(&folder).len() == 5_000);
    assert!(!service.heard("SourceFailed"), "{:?}", service.events);
    service.stop();
}

#[test]
fn behaviour_20_a_message_that_is_flagged_as_sent_again_is_taken_as_any_other() {
    let Some(broker) = Broker::mosquitto(SAFE) else {
        return;
    };
    let folder = Folder::new("b20");
    let mut service = Running::start(&folder, &machine(broker.port, TOGETHER, ""));
    service.settle();
    let mut peer = peer(&broker);
    for nth in 1..=10 {
        peer.publish("plant/all", both(10 * nth).as_bytes(), 8)
            .unwrap();
    }
    // One that did come before is known by its time.
    peer.publish("plant/all", both(50).as_bytes(), 0).unwrap();
    service.until_given(22);
    service.until("ten ticks", |_| history(&folder).len() == 10);
    service.settle();
    assert_eq!(history(&folder).len(), 10);
    service.stop();
}

#[test]
fn behaviour_22_hostile_messages_are_counted_by_reason_and_stop_nothing() {
    let Some(broker) = Broker::mosquitto(SAFE) else {
        return;
    };
    let folder = Folder::new("b22");
    let mut service = Running::start(&folder, &machine(broker.port, TOGETHER, ""));
    service.settle();
    let mut peer = peer(&broker);
    let deep = format!("{}{}", "[".repeat(100_000), "]".repeat(100_000));
    let long = vec![b'1'; 2 << 20];
    for payload in [
        &b""[..],
        b"\0",
        b"\xff",
        b"{}",
        b"[1",
        deep.as_bytes(),
        &long,
    ] {
        for _ in 0..3 {
            peer.publish_safely("plant/all", payload, false);
        }
    }
    peer.publish_safely("plant/all", both(10).as_bytes(), false);
    service.until_given(2);
    for words in [
        "it is empty",
        "not UTF-8",
        "not JSON",
        "no time",
        "nested deeper",
        "longer than 1 MiB",
    ] {
        let count = service
            .events
            .iter()
            .filter(|of| of.contains(words))
            .count();
        assert_eq!(count, 1, "{words}: {:#?}", service.events);
    }
    assert!(!service.heard("SourceFailed"), "{:?}", service.events);
    service.stop();
}
