//! A companion of athermal: it looks at the service that it runs beside, warns where that is degraded, and shows its outputs as a page.
//!
//! What it knows and what it reports is declared once: it stands in `status`, in metrics, in the log, and in the description of the
//! control interface.

use std::fmt::Write as _;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration as Wait;

use athermal_command::{Answer, Command, Failure, Group, Terminal, register_command};
use athermal_core::events;
use athermal_core::time::Duration;
use athermal_http::{Asked, Gives, Refused, Reply, mount};
use athermal_serve::companion::{Beside, Companion};
use athermal_serve::connector::{ConnectorError, Stop};
use athermal_serve::facts::{Look, OutputsFacts, State, StatusFacts};
use athermal_serve::service::{Service, ServiceEvent};
use athermal_serve::{facts, register_companion, register_events, register_facts};
use clap::Args;
use schemars::JsonSchema;
use serde::Deserialize;

/// What its page is.
const HTML: &str = "text/html; charset=utf-8";

/// Looks at the service.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct MyNode {
    /// How often.
    pub every: Duration,
}

impl Default for MyNode {
    fn default() -> Self {
        Self {
            every: Duration::from_ns(1_000_000_000),
        }
    }
}

register_companion!(MyNode, "my_node");

facts! {
    /// What the companion knows.
    MyNodeFacts(looks: &AtomicU64) {
        /// How often the companion has looked at the service.
        looks: u64 [counter "my_node_looks_total"] [line "looked at {looks} times"] = looks.load(Ordering::Relaxed);
    }
}

register_facts!(MyNodeFacts, "my_node");

events! {
    /// What the companion reports.
    #[derive(Debug)]
    pub enum MyNodeEvent {
        /// The companion has found the service degraded.
        Degraded => "my_node_degraded", fault, {}, "the service is degraded: `athermal status` has why",
            counts "my_node_degraded_total" "How often the companion has found the service degraded.";
    }
}

register_events!(MyNodeEvent);

impl Companion for MyNode {
    fn start(&self, beside: &Beside) -> Result<Box<dyn Send>, ConnectorError> {
        let every = Wait::from_nanos(self.every.as_ns().max(1) as u64);
        let (stop, handle) = (Stop::default(), beside.handle.clone());
        let stopped = stop.clone();
        std::thread::spawn(move || {
            let looks = Arc::<AtomicU64>::default();
            let known = Arc::clone(&looks);
            // The service answers once it runs.
            let contribute = |of: &mut Service| {
                of.contribute("my_node", move || MyNodeFacts::read(&known));
            };
            let _ = handle.ask(Wait::from_secs(10), contribute);
            let mut was = State::Running;
            while stopped.wait(every) {
                let look = move |of: &mut Service| {
                    let state = StatusFacts::read(&Look::at(of)).state;
                    if state == State::Degraded && was == State::Running {
                        of.report(ServiceEvent::Of(Box::new(MyNodeEvent::Degraded)));
                    }
                    state
                };
                was = handle.ask(every, look).unwrap_or(was);
                looks.fetch_add(1, Ordering::Relaxed);
            }
        });
        Ok(Box::new(Running(stop)))
    }
}

/// Until this is dropped.
struct Running(Stop);

impl Drop for Running {
    fn drop(&mut self) {
        self.0.ask();
    }
}

fn page(service: &mut Service, _: &Asked) -> Result<Reply, Refused> {
    let mut text = format!("<!doctype html><title>{}</title><table>", service.name());
    for of in OutputsFacts::read(&Look::at(service)).outputs {
        let value = of.value.map_or_else(|| "-".to_owned(), |of| of.to_string());
        let _ = write!(text, "<tr><td>{}<td>{value}<td>{}", of.output, of.unit);
    }
    Ok(Reply::text(HTML, text))
}

mount!(
    "/my_node",
    "The outputs, for people.",
    Gives::Text(HTML),
    page
);

/// Show how often a service is looked at, where its file does not say so
#[derive(Debug, Args)]
struct Often {}

impl Command for Often {
    const GROUP: Group = Group::Service;

    fn run(&self, _: &Terminal) -> Result<Answer, Failure> {
        athermal_command::println!("every {}", MyNode::default().every);
        Ok(Answer::Fine)
    }
}

register_command!(Often, "my-node");
