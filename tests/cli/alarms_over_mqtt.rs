//! Alarms over the broker of a declared sink, which may be killed.

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::workbench::{Scratch, athermal};

/// Mosquitto, where it is installed.
fn broker(port: u16) -> Option<Child> {
    let paths = std::env::var("PATH").unwrap_or_default() + ":/usr/sbin";
    let found = paths
        .split(':')
        .map(|of| format!("{of}/mosquitto"))
        .find(|of| std::fs::exists(of).unwrap_or(false));
    let Some(program) = found else {
        assert!(
            std::env::var("ATHERMAL_REQUIRE_SERVERS").is_err(),
            "mosquitto is not installed"
        );
        eprintln!("skipped: mosquitto is not installed");
        return None;
    };
    let mut command = Command::new(program);
    command
        .args(["-p", &port.to_string()])
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    let child = command.spawn().unwrap();
    let began = Instant::now();
    while TcpStream::connect(("127.0.0.1", port)).is_err() {
        assert!(began.elapsed() < Duration::from_secs(10));
        std::thread::sleep(Duration::from_millis(20));
    }
    Some(child)
}

/// What is published under a topic from now on: MQTT 3.1.1, by hand.
struct Subscriber(TcpStream);

impl Subscriber {
    fn new(port: u16, topic: &str) -> Self {
        let mut stream = TcpStream::connect(("127.0.0.1", port)).unwrap();
        stream
            .set_read_timeout(Some(Duration::from_secs(40)))
            .unwrap();
        stream
            .write_all(&[
                0x10, 14, 0, 4, b'M', b'Q', b'T', b'T', 4, 2, 0, 60, 0, 2, b'm', b'e',
            ])
            .unwrap();
        let length = topic.len() as u8;
        let mut subscribe = vec![0x82, length + 5, 0, 1, 0, length];
        subscribe.extend(topic.as_bytes());
        subscribe.push(0);
        stream.write_all(&subscribe).unwrap();
        let mut subscriber = Self(stream);
        while subscriber.packet().0 != 0x90 {}
        subscriber
    }

    /// The first byte of a packet, and what stands behind its length.
    fn packet(&mut self) -> (u8, Vec<u8>) {
        let mut byte = [0];
        self.0.read_exact(&mut byte).unwrap();
        let (kind, mut length) = (byte[0], 0);
        for shift in (0..).step_by(7) {
            self.0.read_exact(&mut byte).unwrap();
            length |= usize::from(byte[0] & 0x7f) << shift;
            if byte[0] & 0x80 == 0 {
                break;
            }
        }
        let mut body = vec![0; length];
        self.0.read_exact(&mut body).unwrap();
        (kind & 0xf0, body)
    }

    fn message(&mut self) -> Value {
        loop {
            if let (0x30, body) = self.packet() {
                let topic = usize::from(body[0]) << 8 | usize::from(body[1]);
                return serde_json::from_slice(&body[2 + topic..]).unwrap();
            }
        }
    }
}

const MACHINE: &str = r#"schema = 1
name = "line"
time = { column = "time_s", unit = "s" }
signals.temperature = { unit = "Cel", channels = ["plate"], max_age = "3s" }
nodes.trend = { type = "slope", inputs.signal = "temperature", windows = ["2s"] }
outputs.trend = "trend"
[runtime]
wait = "0 s"
settle = "0 s"
[sources.log]
type = "replay"
path = "log.csv"
speed = 20
[alarms.hot]
of = "temperature.plate"
above = 25
topic = "plant/alarms"
"#;

#[test]
fn alarms_reach_a_broker_in_order_through_kills_of_it_and_of_the_service() {
    let port = TcpListener::bind("127.0.0.1:0")
        .unwrap()
        .local_addr()
        .unwrap()
        .port();
    let Some(mut mosquitto) = broker(port) else {
        return;
    };
    let scratch = Scratch::new("alarms-over-mqtt");
    let rows =
        (0..100_000).map(|nth| format!("{}.{},{}\n", nth / 10, nth % 10, 20 + nth / 100 % 2 * 10));
    scratch.file(
        "log.csv",
        "time_s,plate\n".to_owned() + &rows.collect::<String>(),
    );
    let sink = format!(
        "[sinks.line]\ntype = \"mqtt\"\nbroker = \"mqtt://127.0.0.1:{port}\"\ntopic = \"plant/out\"\nrate = \"1 K/s2\"\n"
    );
    let machine = scratch.file("line.toml", MACHINE.to_owned() + &sink);
    let start = || {
        let mut command = Command::new(env!("CARGO_BIN_EXE_athermal"));
        command
            .arg("serve")
            .arg(&machine)
            .stdout(Stdio::null())
            .stderr(Stdio::null());
        command.spawn().unwrap()
    };
    let end = |child: &mut Child| {
        child.kill().unwrap();
        child.wait().unwrap();
    };
    let (mut heard, mut last) = (Vec::new(), 0);
    let mut hear = |subscriber: &mut Subscriber, least: u64| {
        while last < least {
            for change in subscriber.message()["changes"].as_array().unwrap() {
                last = change["number"].as_u64().unwrap();
                heard.push(last);
            }
        }
    };
    let mut subscriber = Subscriber::new(port, "plant/alarms");
    let mut service = start();
    hear(&mut subscriber, 2);
    end(&mut mosquitto);
    // Two seconds of data are a tenth of one: some more changes, which wait.
    std::thread::sleep(Duration::from_secs(3));
    end(&mut service);
    mosquitto = broker(port).unwrap();
    let mut subscriber = Subscriber::new(port, "plant/alarms");
    service = start();
    hear(&mut subscriber, 8);
    let tried = athermal(&[&"alarm", &"test", &machine]).ended(0);
    assert!(
        tried.out.contains("mqtt line: plant/alarms: has it"),
        "{} {}",
        tried.out,
        tried.told
    );
    end(&mut service);
    end(&mut mosquitto);
    let mut once = heard.clone();
    once.sort_unstable();
    once.dedup();
    let whole: Vec<u64> = (1..=once.len() as u64).filter(|of| *of > 0).collect();
    assert_eq!(
        once.iter()
            .filter(|of| **of > 0)
            .copied()
            .collect::<Vec<_>>(),
        whole,
        "{heard:?}"
    );
    let firsts: Vec<_> = whole
        .iter()
        .map(|of| heard.iter().position(|it| it == of))
        .collect();
    assert!(firsts.is_sorted(), "{heard:?}");
    // Without a broker it says so.
    let tried = athermal(&[&"alarm", &"test", &machine]).ended(1);
    assert!(
        tried.out.contains("not connected"),
        "{} {}",
        tried.out,
        tried.told
    );
}
