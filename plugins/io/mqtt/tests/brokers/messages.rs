//! Messages in forms that many gateways send, by real brokers.

use athermal_core::prng::Prng;

use crate::peer::Peer;
use crate::server::{Broker, Folder, SAFE};
use crate::service::{Running, TOGETHER, both, machine, one};

/// Publishes these, and waits for so many samples. What was reported.
fn given(broker: &Broker, text: &str, published: &[(&str, String)], samples: u64) -> Vec<String> {
    let folder = Folder::new("messages");
    let mut service = Running::start(&folder, text);
    service.settle();
    let mut peer = Peer::connect(broker.port, "peer", true).unwrap();
    for (topic, payload) in published {
        peer.publish_safely(topic, payload.as_bytes(), false);
    }
    service.until_given(samples);
    service.settle();
    service.stop()
}

#[test]
fn a_shared_subscription_gives_the_messages_of_its_topic() {
    let Some(broker) = Broker::mosquitto(SAFE) else {
        return;
    };
    let shared = "messages = [{ topic = \"$share/line/plant/{channel}\", value = \"/value\", channel = \"temperature.*\" }]\n";
    let addressed = "channels = { \"temperature.*\" = \"$share/line/plain/{channel}\" }\n";
    for version in ["5", "3.1.1"] {
        let source = format!("version = \"{version}\"\n{shared}");
        let published = [("plant/plate", one(10)), ("plant/room", one(20))];
        let events = given(&broker, &machine(broker.port, &source, ""), &published, 2);
        assert!(
            !events.iter().any(|of| of.contains("SourceRemark")),
            "{events:#?}"
        );
        let source = format!("version = \"{version}\"\n{addressed}");
        let published = [("plain/plate", "21.5".to_owned())];
        given(&broker, &machine(broker.port, &source, ""), &published, 1);
    }
}

#[test]
fn plain_numbers_of_a_topic_each_are_read_where_the_source_says_when_they_are() {
    let Some(broker) = Broker::mosquitto(SAFE) else {
        return;
    };
    let source = "messages = [{ topic = \"tele/{channel}\", channel = \"temperature.*\" }]\n";
    let text = machine(broker.port, source, "");
    let text = text.replace(
        "time = { at = \"/time\", unit = \"ms\" }",
        "time = \"arrival\"",
    );
    let published = [
        ("tele/plate", "21.5".to_owned()),
        ("tele/room", " 22\n".to_owned()),
    ];
    let events = given(&broker, &text, &published, 2);
    assert!(
        !events.iter().any(|of| of.contains("SourceRemark")),
        "{events:#?}"
    );
}

#[test]
fn what_cannot_be_used_is_counted_by_channel_and_reason() {
    let Some(broker) = Broker::mosquitto(SAFE) else {
        return;
    };
    let folder = Folder::new("reasons");
    let source = r#"messages = [
  { topic = "list", each = "/all", name = "/id", value = "/v", quality = { at = "/q", good = ["ok"] }, channels = { plate = "temperature.plate" } },
  { topic = "plant/all", channels = { "/T/room" = "temperature.room" } },
]
"#;
    let mut service = Running::start(&folder, &machine(broker.port, source, ""));
    service.settle();
    let mut peer = Peer::connect(broker.port, "peer", true).unwrap();
    let list = r#"{"time": 10, "all": [{"id": "plate", "v": 20, "q": "ok"}, {"id": "other", "v": 1, "q": "ok"}, {"id": "plate", "q": "ok"}, {"id": "plate", "v": 3, "q": "bad"}, {"id": "plate", "v": "x", "q": "ok"}]}"#;
    for (topic, payload) in [
        ("list", list),
        ("plant/all", r#"{"time": 20, "T": {"room": null}}"#),
        ("plant/all", r#"{"T": {"room": 21}}"#),
        ("plant/all", "no JSON"),
        ("plant/all", r#"{"time": 30, "T": {"room": 21}}"#),
    ] {
        peer.publish_safely(topic, payload.as_bytes(), false);
    }
    service.until_given(2);
    service.settle();
    let plate = service.left_out(Some("temperature.plate"));
    assert_eq!(plate, [("no_number", 2), ("bad_quality", 1)]);
    let room = service.left_out(Some("temperature.room"));
    assert_eq!(room, [("no_number", 1), ("no_time", 1), ("unreadable", 1)]);
    assert_eq!(service.left_out(None), [("no_such_name", 1)]);
    // Each is shown the first time, whatever was left out of other channels.
    let events = service.stop();
    let shown = |what: &str| events.iter().filter(|of| of.contains(what)).count();
    assert_eq!(shown("the value is no number"), 1, "{events:#?}");
    assert_eq!(shown("the value is null"), 1, "{events:#?}");
}

#[test]
fn behaviour_19_a_publisher_that_is_not_on_time_is_no_gap_and_a_restart_is_one_at_most() {
    let Some(broker) = Broker::mosquitto(SAFE) else {
        return;
    };
    let folder = Folder::new("jitter");
    let source = TOGETHER.replace("sequence = \"/n\", ", "");
    let text = machine(broker.port, &source, "").replace("wait = \"20 ms\"", "wait = \"0 ms\"");
    let mut prng = Prng::stream(3, "jitter");
    let mut ms = 1_000;
    for run in 0..2 {
        let mut service = Running::start(&folder, &text);
        service.settle();
        let mut peer = Peer::connect(broker.port, "peer", true).unwrap();
        for _ in 0..3_000 {
            let is_held_up = prng.uniform() < 0.03;
            ms += prng.between(1.0, if is_held_up { 60.0 } else { 3.0 }) as u64;
            peer.publish("plant/all", both(ms).as_bytes(), 0).unwrap();
        }
        service.until("all", |of| of.given() >= 5_900);
        let events = service.stop();
        let gaps = events.iter().filter(|of| of.contains("gap from")).count();
        assert!(gaps <= run, "{events:#?}");
        ms += 60_000;
    }
}
