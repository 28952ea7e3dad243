//! A whole service: within this process, or as a child that can be killed.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use athermal_connectors as _;
use athermal_core::compile::Wanted;
use athermal_core::diagnostic::{Diagnostics, Sources};
use athermal_features as _;
use athermal_mqtt as _;
use athermal_run::model::Model;
use athermal_serve::connector::LeftOut;
use athermal_serve::deployment::Deployment;
use athermal_serve::service::{Service, ServiceEvent, ServiceOptions};

use crate::server::Folder;

const GRAPH: &str = r#"
schema = 1
name = "tester"
time = { column = "time_s", unit = "s" }
signals.temperature = { unit = "Cel", channels = ["plate", "room"], max_age = "1min" }
nodes.trend = { type = "slope", inputs.signal = "temperature", windows = ["2s", "7s"] }
nodes.masses = { type = "first_order", inputs.signal = "temperature", time_constants = ["3s", "1min"] }
outputs.trend = "trend"
outputs.masses = "masses"
"#;

/// A channel each on two topics.
pub const APART: &str = r#"messages = [
  { topic = "plant/{channel}", value = "/value", channel = "temperature.*" },
]
"#;
/// Both channels in one message.
pub const TOGETHER: &str = r#"messages = [
  { topic = "plant/all", sequence = "/n", channels = { "/T/{channel}" = "temperature.*" } },
]
"#;

/// A machine file with a source from a broker, and what else it says.
pub fn machine(port: u16, source: &str, more: &str) -> String {
    format!(
        "{GRAPH}\n[runtime]\nwait = \"20 ms\"\nsettle = \"0 s\"\ncheckpoint = \"500 ms\"\n\
         [sources.line]\ntype = \"mqtt\"\nbroker = \"mqtt://127.0.0.1:{port}\"\n\
         time = {{ at = \"/time\", unit = \"ms\" }}\n{source}\n\
         [sinks.history]\ntype = \"csv\"\npath = \"history.csv\"\n{more}"
    )
}

/// A message with both channels; the time is in ms.
pub fn both(ms: u64) -> String {
    let (plate, room) = values(ms);
    format!(
        "{{\"time\": {ms}, \"n\": {}, \"T\": {{\"plate\": {plate}, \"room\": {room}}}}}",
        ms / 10
    )
}

pub fn one(ms: u64) -> String {
    format!("{{\"time\": {ms}, \"value\": {}}}", values(ms).0)
}

fn values(ms: u64) -> (f64, f64) {
    let x = ms as f64;
    (20.0 + (x / 700.0).sin(), 21.0 + (x / 1100.0).cos())
}

pub struct Running {
    service: Option<Service>,
    pub events: Vec<String>,
}

pub fn deployment(folder: &Path) -> (Model, Deployment) {
    declared(folder).unwrap_or_else(|shown| panic!("{shown}"))
}

/// What a machine file declares, or all of its mistakes.
pub fn declared(folder: &Path) -> Result<(Model, Deployment), String> {
    let (mut sources, mut doubts) = (Sources::new(), Diagnostics::new());
    let path = folder.join("machine.toml");
    let model = Model::load_from(&path, Wanted::default(), &mut sources, &mut doubts).unwrap();
    let deployment = Deployment::read(&model.graph, &model.plan, &sources, &mut doubts);
    let shown = doubts.render(&sources, false, 120);
    Ok((model, deployment.ok_or(shown)?))
}

impl Running {
    pub fn start(folder: &Folder, machine: &str) -> Self {
        fs::write(folder.0.join("machine.toml"), machine).unwrap();
        let (model, deployment) = deployment(&folder.0);
        let options = ServiceOptions::new(folder.0.join("state"));
        let (service, _) = Service::start(&model, deployment, &options).unwrap();
        Self {
            service: Some(service),
            events: Vec::new(),
        }
    }

    pub fn pump(&mut self) -> Vec<ServiceEvent> {
        let events = self.service.as_mut().unwrap().pump();
        self.events
            .extend(events.iter().map(|of| format!("{of:?}")));
        events
    }

    /// Waits for something to become true.
    pub fn until(&mut self, what: &str, mut is: impl FnMut(&mut Self) -> bool) {
        let began = Instant::now();
        loop {
            self.pump();
            if is(self) {
                return;
            }
            assert!(
                began.elapsed() < Duration::from_secs(60),
                "{what}; so far: {:#?}",
                self.events
            );
            std::thread::sleep(Duration::from_millis(10));
        }
    }

    /// Whether something has been reported.
    pub fn heard(&self, words: &str) -> bool {
        self.events.iter().any(|of| of.contains(words))
    }

    /// How many samples the source has given.
    pub fn given(&self) -> u64 {
        let sources = self.service.as_ref().unwrap().sources();
        sources[0]
            .1
            .given
            .load(std::sync::atomic::Ordering::Relaxed)
    }

    /// What was left out of a channel, or of none, as the service counts it.
    pub fn left_out(&self, channel: Option<&str>) -> Vec<(&'static str, u64)> {
        let service = self.service.as_ref().unwrap();
        let all = match channel {
            None => {
                let counts = &service.sources()[0].1.left_out;
                LeftOut::ALL.map(|reason| (reason, counts.of(None, reason)))
            }
            Some(name) => {
                let all = service.samples();
                all.iter().find(|of| of.channel == name).unwrap().left_out
            }
        };
        let some = all.into_iter().filter(|(_, count)| *count > 0);
        some.map(|(reason, count)| (reason.name(), count)).collect()
    }

    /// How many rows of a sink have not left.
    pub fn spooled(&self, sink: &str) -> u64 {
        let sinks = self.service.as_ref().unwrap().sinks();
        sinks
            .iter()
            .find(|(name, _)| name == sink)
            .unwrap()
            .1
            .spooled()
    }

    /// Whether the source is connected.
    pub fn is_connected(&mut self) -> bool {
        self.service.as_ref().unwrap().sources()[0].1.is_connected()
    }

    /// Lets the graph of another machine file take over, if the one before has.
    pub fn swap(&mut self, folder: &Folder, machine: &str) -> bool {
        fs::write(folder.0.join("machine.toml"), machine).unwrap();
        let (model, _) = deployment(&folder.0);
        let service = self.service.as_mut().unwrap();
        service.stage(&model, "a test").is_ok() && service.commit("a test").is_ok()
    }

    /// Waits for so many samples.
    pub fn until_given(&mut self, samples: u64) {
        self.until(&format!("{samples} samples"), |of| of.given() >= samples);
    }

    /// Waits until the source is connected and the broker has confirmed what was asked.
    pub fn settle(&mut self) {
        let until = Instant::now() + Duration::from_millis(700);
        while Instant::now() < until {
            self.pump();
            std::thread::sleep(Duration::from_millis(10));
        }
    }

    pub fn stop(mut self) -> Vec<String> {
        let (_, events) = self.service.take().unwrap().stop().unwrap();
        self.events
            .extend(events.iter().map(|of| format!("{of:?}")));
        self.events
    }
}

const FOLDER: &str = "ATHERMAL_MQTT_FOLDER";

/// A service as a process of its own.
#[test]
#[ignore = "run by other tests, as a child"]
fn child() {
    let Ok(folder) = std::env::var(FOLDER) else {
        return;
    };
    let folder = PathBuf::from(folder);
    let (model, deployment) = deployment(&folder);
    let options = ServiceOptions::new(folder.join("state"));
    let (mut service, _) = Service::start(&model, deployment, &options).unwrap();
    while !folder.join("stop").exists() {
        for event in service.pump() {
            println!("{event:?}");
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    service.stop().unwrap();
    fs::write(folder.join("stopped"), "").unwrap();
}

/// Such a process.
pub struct Process(Child);

impl Process {
    pub fn start(folder: &Folder) -> Self {
        let log = fs::File::options()
            .create(true)
            .append(true)
            .open(folder.0.join("events"))
            .unwrap();
        let child = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "service::child", "--ignored", "--nocapture"])
            .env(FOLDER, &folder.0)
            .stdin(Stdio::null())
            .stdout(log.try_clone().unwrap())
            .stderr(log)
            .spawn();
        Self(child.unwrap())
    }

    pub fn kill(&mut self) {
        self.0.kill().unwrap();
        self.0.wait().unwrap();
    }

    pub fn stop(mut self, folder: &Folder) {
        fs::write(folder.0.join("stop"), "").unwrap();
        let status = self.0.wait().unwrap();
        assert!(
            status.success(),
            "{}",
            crate::server::read(&folder.0.join("events"))
        );
        fs::remove_file(folder.0.join("stop")).unwrap();
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// The rows of a history without the line of names.
pub fn history(folder: &Folder) -> Vec<String> {
    let text = crate::server::read(&folder.0.join("history.csv"));
    text.lines().skip(1).map(str::to_owned).collect()
}
