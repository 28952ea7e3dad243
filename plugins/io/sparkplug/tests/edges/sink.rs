//! Outputs as an edge node, seen by hosts.

use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant as Clock};

use athermal_core::time::{Duration as Span, Instant};
use athermal_serve::connector::{OutRow, Outlet};
use athermal_serve::testkit::open_sink;
use serde_json::{Value, json};

use crate::host::{Host, declared};
use crate::peers::{Broker, Folder, Make, until};

/// The sink of an edge node `tester` at work, with two outputs.
fn outlet(folder: &Path, port: u16, more: &str) -> Box<dyn Outlet> {
    let broker =
        format!("type = \"sparkplug\"\nbroker = \"mqtt://127.0.0.1:{port}\"\ngroup = \"plant\"");
    let sink = format!(
        "[sources.line]\n{broker}\nchannels = {{ \"temperature.plate\" = \"edge:T\" }}\n[sinks.plant]\n{broker}\nedge = \"tester\"\n{more}\n"
    );
    let (_, mut deployment) = declared(folder, &sink);
    let sink = deployment.sinks.remove(0).parameters;
    open_sink(&*sink, folder, &["correction.X", "correction.Y"]).unwrap()
}

fn now() -> Instant {
    let since = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
    Instant::from_ns(since.unwrap().as_nanos() as i64)
}

fn row(at: Instant, outputs: &[f64; 2]) -> OutRow<'_> {
    OutRow {
        at,
        is_beat: false,
        behind: Span::ZERO,
        revision: 3,
        is_degraded: false,
        outputs,
    }
}

/// Puts a row as a service does: again until it is taken.
fn put(outlet: &mut dyn Outlet, at: Instant, outputs: [f64; 2]) {
    until("a row", || outlet.put(&row(at, &outputs)).is_ok());
}

/// Puts a row of now, once it is taken.
fn put_now(outlet: &mut dyn Outlet, outputs: [f64; 2]) {
    until("a row", || outlet.put(&row(now(), &outputs)).is_ok());
}

/// A host of another make.
struct Scada {
    child: Child,
    orders: ChildStdin,
    messages: Receiver<Value>,
}

impl Scada {
    fn start(port: u16) -> Self {
        let python = std::env::var("ATHERMAL_PYTHON").unwrap_or_else(|_| "python3".to_owned());
        let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/edges/scada.py");
        let mut command = std::process::Command::new(python);
        let command = command.args([script, &port.to_string()]);
        let command = command.stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut child = command.stderr(Stdio::null()).spawn().unwrap();
        let orders = child.stdin.take().unwrap();
        let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
        while lines.next().unwrap().unwrap() != "ready" {}
        let (sends, messages) = channel();
        std::thread::spawn(move || {
            for line in lines.map_while(Result::ok) {
                if let Ok(message @ Value::Object(_)) = serde_json::from_str(&line) {
                    let _ = sends.send(message);
                }
            }
        });
        Self {
            child,
            orders,
            messages,
        }
    }

    /// The next message of a kind.
    fn next(&self, kind: &str) -> Value {
        let until = Clock::now() + Duration::from_secs(20);
        loop {
            let left = until.saturating_duration_since(Clock::now());
            let message = self.messages.recv_timeout(left);
            let message = message.unwrap_or_else(|_| panic!("no {kind}"));
            if message["of"] == kind {
                return message;
            }
        }
    }

    fn ask_for_birth(&mut self) {
        writeln!(self.orders, "rebirth").unwrap();
    }
}

impl Drop for Scada {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A metric of a birth by its name, or of data by its alias, which is a number or the text of one.
fn metric<'a>(message: &'a Value, is: &str) -> &'a Value {
    let metrics = message["metrics"].as_array().unwrap();
    let found = metrics.iter().find(|of| {
        let alias = of["alias"].as_str().map(str::to_owned);
        of["name"] == is || alias.unwrap_or_else(|| of["alias"].to_string()) == is
    });
    found.unwrap_or_else(|| panic!("no {is} in {message:#}"))
}

#[test]
fn a_host_of_another_make_sees_births_changes_rebirths_and_deaths() {
    let Some(mut broker) = Broker::start(Make::Wrapper) else {
        return;
    };
    let folder = Folder::new("edge-node");
    let mut scada = Scada::start(broker.port);
    let mut outlet = outlet(&folder.0, broker.port, "");
    let birth = scada.next("birth");
    let number = metric(&birth, "bdSeq")["value"].clone();
    assert_eq!(metric(&birth, "Node Control/Rebirth")["value"], false);
    let x = metric(&birth, "correction/X");
    assert_eq!(x["isNull"], true);
    assert_eq!(x["properties"]["key_value"]["engUnit"], "nm");
    put_now(&mut *outlet, [1.5, f64::NAN]);
    let data = scada.next("data");
    assert_eq!(metric(&data, "0")["doubleValue"], 1.5);
    // Only what has changed is said; what is absent is null.
    put_now(&mut *outlet, [f64::NAN, 2.5]);
    let data = scada.next("data");
    assert_eq!(data["metrics"].as_array().unwrap().len(), 2);
    assert_eq!(metric(&data, "0")["isNull"], true);
    assert_eq!(metric(&data, "1")["doubleValue"], 2.5);
    assert_eq!(data["seq"], "2");
    // A host that asks is given all of it.
    scada.ask_for_birth();
    let again = scada.next("birth");
    assert_eq!(metric(&again, "correction/Y")["value"], 2.5);
    assert_eq!(metric(&again, "revision")["value"], "0000000000000003");
    assert_eq!(
        (&metric(&again, "bdSeq")["value"], &again["seq"]),
        (&number, &json!("0"))
    );
    // The broker goes: what could not be published comes as historical, with its own time.
    broker.kill();
    until("it is noticed", || outlet.state().is_err());
    let stored = now();
    assert!(outlet.put(&row(stored, &[3.5, 4.5])).is_err());
    broker.again();
    let mut scada = Scada::start(broker.port);
    until("it is born again", || outlet.state().is_ok());
    scada.ask_for_birth();
    let born = scada.next("birth");
    assert_ne!(metric(&born, "bdSeq")["value"], number);
    put(&mut *outlet, stored, [3.5, 4.5]);
    let data = scada.next("data");
    let x = metric(&data, "0");
    assert_eq!(
        (&x["isHistorical"], &x["doubleValue"]),
        (&json!(true), &json!(3.5))
    );
    let ms = (stored.as_ns() / 1_000_000).to_string();
    assert_eq!(x["timestamp"], ms.as_str());
    // Its death is that of this birth.
    let number = metric(&born, "bdSeq")["value"].clone();
    drop(outlet);
    let death = scada.next("death");
    assert_eq!(metric(&death, "bdSeq")["value"], number);
}

#[test]
fn an_edge_node_waits_for_its_primary_host_which_is_given_what_it_missed() {
    let Some(broker) = Broker::start(Make::Wrapper) else {
        return;
    };
    let folder = Folder::new("primary");
    let mut outlet = outlet(&folder.0.join("edge"), broker.port, "host = \"main\"");
    let runtime = "{ wait = \"500 ms\", settle = \"2 s\", heartbeat = \"100 ms\" }";
    let start = |name: &str| {
        let metric = ("tester:correction/X", runtime);
        Host::of(&folder.0.join(name), broker.port, "main", metric)
    };
    let gone = |outlet: &mut Box<dyn Outlet>| {
        let state = outlet.state().map_err(|of| of.to_string());
        state.is_err_and(|of| of.contains("primary host"))
    };
    until("it asks for its host", || gone(&mut outlet));
    let mut host = start("first");
    put_now(&mut *outlet, [1.0, 0.0]);
    until("a value", || host.last() == Some(1.0));
    host.stop();
    until("its host is missed", || gone(&mut outlet));
    let stored: Vec<Instant> = (0..5)
        .map(|_| {
            std::thread::sleep(Duration::from_millis(20));
            now()
        })
        .collect();
    assert!(outlet.put(&row(stored[0], &[2.0, 0.0])).is_err());
    // As a service makes them again.
    let mut host = start("second");
    for (nth, at) in stored.into_iter().enumerate() {
        put(&mut *outlet, at, [2.0 + nth as f64, 0.0]);
    }
    put_now(&mut *outlet, [9.0, 0.0]);
    until("what is live", || host.last() == Some(9.0));
    let values: Vec<f64> = host.rows().into_iter().flatten().collect();
    let mut missed = values.clone();
    missed.dedup();
    assert_eq!(missed, [2.0, 3.0, 4.0, 5.0, 6.0, 9.0]);
    host.stop();
}
