//! The control interface of services that run: what it answers, and what it does not let through.

mod attacks;
mod declared;
mod doors;
mod latency;
mod metrics;
mod openapi;
mod swaps;

use std::collections::VecDeque;
use std::fs;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration as Wait, Instant as Clock};

use athermal_connectors as _;
use athermal_core::compile::Wanted;
use athermal_core::diagnostic::{Diagnostics, Sources};
use athermal_core::prng::Prng;
use athermal_core::time::Instant;
use athermal_estimators as _;
use athermal_features as _;
use athermal_run::fit::{FitOptions, fit};
use athermal_run::model::{Card, Model};
use athermal_run::recording::Table;
use athermal_serve::deployment::Deployment;
use athermal_serve::service::{Service, ServiceHandle, ServiceOptions};
use serde_json::Value;

use crate::client::{Address, Reply};

/// A position a second ahead, predicted by an estimator that goes on learning and by one that knows how far it is from its fit.
pub(crate) const GRAPH: &str = r#"schema = 1
name = "line"
time = { column = "time_s", unit = "s" }
signals.temperature = { unit = "Cel", channels = ["plate", "room"], max_age = "3s" }
signals.position = { unit = "nm", channels = ["Z"], max_age = "3s" }
nodes.trend = { type = "slope", inputs.signal = "temperature", windows = ["2s", "7s"] }
nodes.masses = { type = "first_order", inputs.signal = "temperature", time_constants = ["3s", "1min"] }
nodes.learned = { type = "rls", inputs.features = "temperature", inputs.truth = "position.Z", ahead = "1s" }
nodes.steady = { type = "linear", inputs.features = "temperature", inputs.truth = "position.Z", ahead = "1s" }
outputs.trend = "trend"
outputs.masses = "masses"
outputs.learned = "learned"
outputs.steady = "steady"
outputs.novelty = "steady:novelty"
"#;

/// When its model was fitted, in s since 1970 and as its card says.
const FITTED: (&str, &str) = ("1767323045", "2026-01-02T03:04:05Z");

const SECTIONS: &str = r#"
[runtime]
wait = "0 s"
settle = "0 s"
checkpoint = "100 ms"
[sources.log]
type = "replay"
path = "log.csv"
speed = 20
[sinks.history]
type = "csv"
path = "history.csv"
"#;

/// A service in a folder of its own, pumped by a thread.
pub(crate) struct Bench {
    pub(crate) folder: PathBuf,
    pub(crate) handle: ServiceHandle,
    thread: Option<JoinHandle<()>>,
}

impl Bench {
    /// Starts a service of the usual graph with more sections, on a log of so many seconds.
    pub(crate) fn start(graph: &str, sections: &str) -> Self {
        Self::start_with(graph, &format!("{SECTIONS}{sections}"))
    }

    /// Starts a service of a graph with all of its sections.
    pub(crate) fn start_with(graph: &str, sections: &str) -> Self {
        static NUMBER: AtomicU32 = AtomicU32::new(0);
        let number = NUMBER.fetch_add(1, Ordering::Relaxed);
        let name = format!("athermal-http-{}-{number}", std::process::id());
        let folder = std::env::temp_dir().join(name);
        let _ = fs::remove_dir_all(&folder);
        fs::create_dir_all(&folder).unwrap();
        fs::write(folder.join("log.csv"), log(20_000)).unwrap();
        let machine = folder.join("machine.toml");
        fs::write(&machine, format!("{graph}{sections}")).unwrap();
        let (mut sources, mut mistakes) = (Sources::new(), Diagnostics::new());
        let model = Model::load_from(&machine, Wanted::default(), &mut sources, &mut mistakes);
        let model = fitted(model.unwrap_or_else(|error| panic!("{error}")));
        let deployment = Deployment::read(&model.graph, &model.plan, &sources, &mut mistakes);
        let deployment =
            deployment.unwrap_or_else(|| panic!("{}", mistakes.render(&sources, false, 100)));
        // As where it is started in the folder of its file.
        let options = ServiceOptions {
            machine: from_here(&machine),
            ..ServiceOptions::new(from_here(&folder.join("state")))
        };
        let (mut service, _) = Service::start(&model, deployment, &options).unwrap();
        let handle = service.handle();
        let thread = std::thread::spawn(move || {
            while !service.is_over() {
                service.pump();
                std::thread::sleep(Wait::from_millis(5));
            }
            service.stop().unwrap();
        });
        let bench = Self {
            folder,
            handle,
            thread: Some(thread),
        };
        bench.until("the first ticks", |status| {
            status["ticks"].as_u64() > Some(5)
        });
        bench
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    pub(crate) fn address(&self) -> Address {
        Address::of(&self.path("state").to_string_lossy(), None).unwrap()
    }

    pub(crate) fn get(&self, path: &str) -> Reply {
        self.address().get(path).unwrap()
    }

    pub(crate) fn post(&self, path: &str, body: &Value) -> Reply {
        self.address().post(path, body).unwrap()
    }

    pub(crate) fn status(&self) -> Value {
        let reply = self.get("/v1/status");
        assert_eq!(reply.status, 200, "{}", reply.json());
        reply.json()
    }

    pub(crate) fn until(&self, what: &str, holds: impl Fn(&Value) -> bool) -> Value {
        let began = Clock::now();
        loop {
            let status = self.status();
            if holds(&status) {
                return status;
            }
            assert!(began.elapsed() < Wait::from_secs(30), "{what}: {status:#}");
            std::thread::sleep(Wait::from_millis(20));
        }
    }

    pub(crate) fn raw(&self, request: &[u8]) -> String {
        let Address::Socket(path) = self.address() else {
            panic!("it is a socket")
        };
        let stream = UnixStream::connect(path).unwrap();
        exchange(stream, request)
    }

    /// Ends it, and waits for that.
    pub(crate) fn stop(&mut self) {
        let reply = self.post("/v1/stop", &serde_json::json!({}));
        assert_eq!(reply.status, 200);
        self.thread.take().unwrap().join().unwrap();
    }
}

impl Drop for Bench {
    fn drop(&mut self) {
        if let Some(thread) = self.thread.take() {
            let _ = self.address().post("/v1/stop", &serde_json::json!({}));
            let _ = thread.join();
        }
        let _ = fs::remove_dir_all(&self.folder);
    }
}

/// A path as it is from the folder that this process works in.
fn from_here(path: &Path) -> PathBuf {
    let up = std::env::current_dir().unwrap().components().count() - 1;
    let path = std::path::absolute(path).unwrap();
    PathBuf::from("../".repeat(up)).join(path.strip_prefix("/").unwrap())
}

/// Rows of a log, ten a second. The position follows the plate a second later, but for noise of 2.9 nm.
fn rows(count: usize) -> Vec<[f64; 3]> {
    let mut prng = Prng::stream(3, "http");
    let mut plates = VecDeque::from([0.5; 10]);
    let row = |_| {
        plates.push_back(prng.uniform());
        let before = plates.pop_front().unwrap();
        let noise = 10.0 * prng.uniform();
        [
            20.0 + plates[9],
            21.0 + prng.uniform(),
            100.0 * before + noise,
        ]
    };
    (0..count).map(row).collect()
}

fn log(count: usize) -> String {
    let mut text = "time_s,plate,room,Z\n".to_owned();
    for (nth, [plate, room, z]) in rows(count).into_iter().enumerate() {
        text += &format!("{}.{},{plate},{room},{z}\n", nth / 10, nth % 10);
    }
    text
}

/// A model with a fit on a minute of the log.
pub(crate) fn fitted(mut model: Model) -> Model {
    let mut data = Table::default();
    for (nth, row) in rows(600).iter().enumerate() {
        data.push(Instant::from_ns(nth as i64 * 100_000_000), row);
    }
    let fit = fit(&model.plan, &data, &FitOptions::default(), &mut |_| {});
    let (fits, report) = fit.unwrap();
    model.fitted = fits;
    model.card = Some(Card::of(&report, Vec::new(), Some(FITTED.1.to_owned())));
    model
}

/// Sends bytes, and gives what comes back until the other side has had enough.
pub(crate) fn exchange(mut stream: impl Read + Write, request: &[u8]) -> String {
    let _ = stream.write_all(request);
    let mut text = Vec::new();
    let mut buffer = [0; 4096];
    while let Ok(count) = stream.read(&mut buffer) {
        if count == 0 {
            break;
        }
        text.extend_from_slice(&buffer[..count]);
    }
    String::from_utf8_lossy(&text).into_owned()
}

/// A port of the machine itself that is free.
pub(crate) fn free_port() -> u16 {
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    listener.local_addr().unwrap().port()
}

pub(crate) fn tcp(port: u16) -> TcpStream {
    let stream = TcpStream::connect(("127.0.0.1", port)).unwrap();
    stream.set_read_timeout(Some(Wait::from_secs(20))).unwrap();
    stream
}
