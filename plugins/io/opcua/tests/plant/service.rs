//! A whole service within this process.

use std::collections::BTreeMap;
use std::fs;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use athermal_connectors as _;
use athermal_core::compile::Wanted;
use athermal_core::diagnostic::{Diagnostics, Sources};
use athermal_features as _;
use athermal_opcua as _;
use athermal_run::model::Model;
use athermal_serve::connector::SourceCounts;
use athermal_serve::deployment::Deployment;
use athermal_serve::service::{ChannelSamples, Service, ServiceOptions};

use crate::plant::Folder;

/// A graph whose first output is what comes in.
pub const GRAPH: &str = r#"schema = 1
name = "tester"
signals.temperature = { unit = "1", channels = ["plate"], max_age = "1min" }
nodes.now = { type = "lag", inputs.signal = "temperature", lags = ["0s"] }
outputs.now = "now"
"#;

/// What a machine file declares.
pub fn declared(folder: &Folder, machine: &str) -> Result<(Model, Deployment), String> {
    let path = folder.0.join("machine.toml");
    fs::write(&path, machine).unwrap();
    let (mut sources, mut doubts) = (Sources::new(), Diagnostics::new());
    let model = Model::load_from(&path, Wanted::default(), &mut sources, &mut doubts);
    let model = model.map_err(|error| error.to_string())?;
    let deployment = Deployment::read(&model.graph, &model.plan, &sources, &mut doubts);
    let shown = doubts.render(&sources, false, 120);
    match deployment {
        Some(of) if !doubts.has_errors() => Ok((model, of)),
        _ => Err(shown),
    }
}

pub struct Running {
    service: Option<Service>,
    pub events: Vec<String>,
}

impl Running {
    pub fn start(folder: &Folder, machine: &str) -> Self {
        let (model, deployment) = declared(folder, machine).unwrap_or_else(|of| panic!("{of}"));
        let options = ServiceOptions::new(folder.0.join("state"));
        let (service, _) = Service::start(&model, deployment, &options).unwrap();
        Self {
            service: Some(service),
            events: Vec::new(),
        }
    }

    pub fn pump(&mut self) {
        let events = self.service.as_mut().unwrap().pump();
        self.events
            .extend(events.iter().map(|of| format!("{of:?}")));
    }

    /// Waits for something to become true.
    pub fn until(&mut self, what: &str, mut is: impl FnMut(&mut Self) -> bool) -> Duration {
        let began = Instant::now();
        loop {
            self.pump();
            if is(self) {
                return began.elapsed();
            }
            let late = began.elapsed() > Duration::from_secs(40);
            assert!(!late, "{what}; so far: {:#?}", self.events);
            std::thread::sleep(Duration::from_millis(10));
        }
    }

    pub fn heard(&self, words: &str) -> bool {
        self.events.iter().any(|of| of.contains(words))
    }

    pub fn counts(&self) -> Arc<SourceCounts> {
        Arc::clone(&self.service.as_ref().unwrap().sources()[0].1)
    }

    pub fn given(&self) -> u64 {
        self.counts().given.load(Ordering::Relaxed)
    }

    pub fn samples(&self) -> BTreeMap<String, ChannelSamples> {
        let all = self.service.as_ref().unwrap().samples().into_iter();
        all.map(|of| (of.channel.clone(), of)).collect()
    }

    pub fn sink_error(&self) -> Option<String> {
        self.service.as_ref().unwrap().sinks()[0].1.error()
    }

    pub fn stop(mut self) {
        self.service.take().unwrap().stop().unwrap();
    }
}

/// The first output of each row that was put out.
pub fn history(folder: &Folder) -> Vec<f64> {
    let text = fs::read_to_string(folder.0.join("history.csv")).unwrap_or_default();
    let value = |line: &str| line.split(',').nth(1)?.parse().ok();
    text.lines().skip(1).filter_map(value).collect()
}
