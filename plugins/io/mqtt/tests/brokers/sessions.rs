//! What the crate offers to others that speak by MQTT: one session, with a will, topics and acknowledgements of its own.

use std::time::Duration;

use athermal_mqtt::broker::{Version, Way};
use athermal_mqtt::client::{Connection, Event, Message, Sender, Settings, Will};
use tokio::time::timeout;

use crate::peer::Peer;
use crate::server::{Broker, SAFE};

fn settings(broker: &Broker, version: Version) -> Settings {
    let at = format!("mqtt://127.0.0.1:{}", broker.port);
    let way = Way {
        broker: &at.parse().unwrap(),
        authorities: None,
        identity: None,
        login: None,
        client_id: None,
        keep_alive: athermal_mqtt::broker::keep_alive(),
    };
    let settings = way.settings(Some("tester"), "host", std::path::Path::new("."));
    Settings {
        version,
        last_will: Some(Will {
            topic: "states/host".to_owned(),
            payload: vec![0, 0xff, 7],
            is_retained: false,
        }),
        ..settings.unwrap()
    }
}

/// Connects, subscribes, and hands on what comes until there are so many messages.
async fn messages(of: &Settings, count: usize) -> (Connection, Sender, bool, Vec<Message>) {
    let mut connection = Connection::new(of).unwrap();
    let sender = connection.sender();
    let (mut had, mut all) = (false, Vec::new());
    let work = async {
        while all.len() < count {
            match connection.next().await.unwrap() {
                Event::Connected { session_present } => {
                    had = session_present;
                    assert!(sender.subscribe(&["edge/+/DATA".to_owned()]));
                }
                Event::Subscribed(_, codes) => {
                    assert_eq!(codes, [Ok(1)]);
                    let mut peer = Peer::connect(of.broker.port, "edge", true).unwrap();
                    for payload in [b"one", b"two"] {
                        peer.publish_safely("edge/a/DATA", payload, false);
                    }
                }
                Event::Message(message) => all.push(message),
                _ => {}
            }
        }
    };
    timeout(Duration::from_secs(20), work).await.unwrap();
    (connection, sender, had, all)
}

#[test]
fn another_crate_has_a_session_with_a_will_and_acknowledges_by_itself() {
    let Some(broker) = Broker::mosquitto(SAFE) else {
        return;
    };
    let mut witness = Peer::connect(broker.port, "witness", true).unwrap();
    witness.subscribe("states/host");
    let runtime = tokio::runtime::Builder::new_current_thread();
    let runtime = { runtime }.enable_all().build().unwrap();
    for version in [Version::Three, Version::Five] {
        let settings = settings(&broker, version);
        // What is not acknowledged comes again on the next connection, and goes without leave before: its will is published.
        let (connection, _, had, all) = runtime.block_on(messages(&settings, 2));
        assert!(!had, "{version:?}");
        assert_eq!(all[0].payload, b"one");
        drop(connection);
        let wills = crate::sinks::receive(&mut witness, |all| !all.is_empty());
        assert_eq!(wills[0].payload, [0, 0xff, 7]);
        let (mut connection, sender, had, all) = runtime.block_on(messages(&settings, 4));
        assert!(had, "{version:?}");
        let texts: Vec<_> = all.iter().map(|of| of.payload.as_slice()).collect();
        assert_eq!(texts[..2], [b"one".as_slice(), b"two"], "{version:?}");
        for of in &all {
            assert!(sender.acknowledge(of.packet.unwrap()));
        }
        // Who takes leave has no will.
        assert!(sender.disconnect());
        runtime.block_on(async {
            let end = async { while connection.next().await.is_ok() {} };
            timeout(Duration::from_secs(5), end).await.unwrap();
        });
        assert!(
            witness
                .receive(Duration::from_millis(300))
                .unwrap()
                .is_none()
        );
        // So that the next version begins with nothing.
        let clean = Settings {
            keeps_session: false,
            last_will: None,
            ..settings
        };
        drop(runtime.block_on(messages(&clean, 2)));
    }
}
