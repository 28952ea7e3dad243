//! A service that is a host.

use std::path::{Path, PathBuf};

use athermal_connectors as _;
use athermal_core::compile::Wanted;
use athermal_core::diagnostic::{Diagnostics, Sources};
use athermal_features as _;
use athermal_run::model::Model;
use athermal_serve::connector::LeftOut;
use athermal_serve::deployment::Deployment;
use athermal_serve::service::{ChannelSamples, Service, ServiceOptions};
use athermal_sparkplug as _;

const GRAPH: &str = r#"schema = 1
name = "tester"
signals.temperature = { unit = "1", channels = ["plate"], max_age = "1min" }
outputs.now = "temperature"
"#;

/// What a machine file declares beside the graph.
pub fn declared(folder: &Path, text: &str) -> (Model, Deployment) {
    std::fs::create_dir_all(folder).unwrap();
    let machine = folder.join("machine.toml");
    std::fs::write(&machine, format!("{GRAPH}{text}")).unwrap();
    let (mut sources, mut doubts) = (Sources::new(), Diagnostics::new());
    let model = Model::load_from(&machine, Wanted::default(), &mut sources, &mut doubts).unwrap();
    let deployment = Deployment::read(&model.graph, &model.plan, &sources, &mut doubts);
    let deployment =
        deployment.unwrap_or_else(|| panic!("{}", doubts.render(&sources, false, 120)));
    (model, deployment)
}

/// A service, and the folder that it works in.
pub struct Host {
    service: Option<Service>,
    folder: PathBuf,
    pub events: Vec<String>,
}

impl Host {
    /// One whose status beats, so that it says what is absent; what is on its way for half a second is not late.
    pub fn start(folder: &Path, port: u16) -> Self {
        let runtime = "{ wait = \"500 ms\", settle = \"2 s\", heartbeat = \"100 ms\" }";
        Self::of(folder, port, "athermal", ("edge:T", runtime))
    }

    /// One with this id, for a metric, by these rules of time.
    pub fn of(folder: &Path, port: u16, id: &str, (metric, runtime): (&str, &str)) -> Self {
        let text = format!(
            "runtime = {runtime}\n[sources.line]\ntype = \"sparkplug\"\nbroker = \"mqtt://127.0.0.1:{port}\"\ngroup = \"plant\"\n\
             host = \"{id}\"\nclient_id = \"host-{id}\"\nretry = \"500 ms\"\n\
             channels = {{ \"temperature.plate\" = \"{metric}\" }}\n[sinks.history]\ntype = \"csv\"\npath = \"history.csv\"\n"
        );
        let (model, deployment) = declared(folder, &text);
        let options = ServiceOptions::new(folder.join("state"));
        Self {
            service: Some(Service::start(&model, deployment, &options).unwrap().0),
            folder: folder.to_owned(),
            events: Vec::new(),
        }
    }

    pub fn pump(&mut self) {
        let events = self.service.as_mut().unwrap().pump();
        self.events
            .extend(events.iter().map(|of| format!("{of:?}")));
    }

    pub fn heard(&mut self, words: &str) -> bool {
        self.pump();
        self.events.iter().any(|of| of.contains(words))
    }

    pub fn is_connected(&mut self) -> bool {
        self.pump();
        self.service.as_ref().unwrap().sources()[0].1.is_connected()
    }

    pub fn channel(&mut self) -> ChannelSamples {
        self.pump();
        self.service.as_ref().unwrap().samples().remove(0)
    }

    /// How many messages were none that can be read.
    pub fn unreadable(&mut self) -> u64 {
        self.pump();
        let counts = &self.service.as_ref().unwrap().sources()[0].1;
        counts.left_out.of(None, LeftOut::Unreadable)
    }

    pub fn is_dead(&mut self) -> bool {
        let state = self.channel().state;
        state.is_some_and(|of| of.starts_with("dead"))
    }

    /// The output of each row; none where it is absent.
    pub fn rows(&mut self) -> Vec<Option<f64>> {
        self.pump();
        let text = std::fs::read_to_string(self.folder.join("history.csv")).unwrap_or_default();
        let value = |line: &str| line.split(',').nth(1)?.parse().ok();
        text.lines().skip(1).map(value).collect()
    }

    /// The last output; none where it is absent.
    pub fn last(&mut self) -> Option<f64> {
        self.rows().last().copied().flatten()
    }

    pub fn stop(mut self) {
        self.service.take().unwrap().stop().unwrap();
    }
}
