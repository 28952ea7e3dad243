//! `sparkplug` as a source: what a machine file says of it, and its sessions.

use std::path::PathBuf;
use std::pin::pin;
use std::sync::Arc;
use std::time::{Duration as Wait, Instant as Clock};

use athermal_mqtt::broker::{Broker, ClientId, Identity, Way, keep_alive};
use athermal_mqtt::client::{Connection, Ended, Event, Message, Sender, Settings, Will};
use athermal_serve::bell::Bell;
use athermal_serve::connector::{
    ConnectorError, Inlet, Outflow, ParameterRemark, Source, SourceWiring, Stop,
};
use athermal_serve::deployment::Login;
use athermal_serve::host::time_of_day as now;
use athermal_serve::register_source;
use schemars::JsonSchema;
use serde::Deserialize;
use serde_json::{Value, json};
use tokio::runtime::Builder;
use tokio::sync::Notify;
use tokio::time::{sleep, timeout};

use crate::edge::birth_order;
use crate::host::{Host, Out, address};
use crate::{LEAVE, level_remarks, words};

/// Metrics of edge nodes that publish by Sparkplug B: `channels` says which metric gives which channel, such as
/// { "temperature.plate" = "EDGE:Plate/Temperature" }, or "EDGE/DEVICE:METRIC".
///
/// It is a host: it learns aliases from births, and asks for a rebirth where messages are missing or an alias is unknown. The metrics of
/// what is dead are absent. Data have QoS 0: what an edge node without a store publishes while nobody listens is lost, and reported.
#[derive(Debug, Deserialize, JsonSchema)]
pub struct SparkplugSource {
    /// The broker: "mqtt://HOST", with ":PORT" where it is not 1883, or "mqtts://HOST" with TLS.
    broker: Broker,
    /// User and password.
    #[serde(default)]
    login: Option<Login>,
    /// With `mqtts://`: a file of certificates that the broker's own is judged by; those of the system without.
    #[serde(default)]
    authorities: Option<PathBuf>,
    /// With `mqtts://`: by what the broker knows this client: { certificate = "…", key = "…" }, files of PEM.
    #[serde(default)]
    tls: Option<Identity>,
    /// The client id, if not `athermal-` and the names of machine and source.
    #[serde(default)]
    client_id: Option<ClientId>,
    /// The group of the edge nodes.
    group: String,
    /// The id of the primary host, by which edge nodes that store what they cannot publish know that it is there: its STATE is published.
    #[serde(default)]
    host: Option<String>,
}

register_source!(SparkplugSource, "sparkplug");

impl SparkplugSource {
    fn way(&self) -> Way<'_> {
        Way {
            broker: &self.broker,
            authorities: self.authorities.as_ref(),
            identity: self.tls.as_ref(),
            login: self.login.as_ref(),
            client_id: self.client_id.as_ref(),
            keep_alive: keep_alive(),
        }
    }
}

impl Source for SparkplugSource {
    fn needs_addresses(&self) -> bool {
        true
    }

    fn remarks(&self, _: usize) -> Vec<ParameterRemark> {
        let mut all = self.way().remarks();
        all.extend(level_remarks(&[
            ("group", Some(&self.group)),
            ("host", self.host.as_ref()),
        ]));
        all
    }

    fn remark(&self, text: &str) -> Option<ParameterRemark> {
        Some(ParameterRemark {
            at: Vec::new(),
            is_mistake: true,
            words: address(text).err()?,
            help: "the names are those of topics and births".to_owned(),
        })
    }

    fn open(&self, wiring: SourceWiring) -> Result<Box<dyn Inlet>, ConnectorError> {
        let settings = self
            .way()
            .settings(wiring.machine.as_deref(), &wiring.name, &wiring.folder);
        let settings = Settings {
            // A host begins with nothing: what it has missed it is given anew.
            keeps_session: false,
            ..settings.map_err(ConnectorError::new)?
        };
        Connection::new(&settings).map_err(ConnectorError::new)?;
        let channels = wiring.channels.iter().map(|of| address(&of.address));
        let channels: Vec<_> = channels
            .collect::<Result<_, _>>()
            .map_err(ConnectorError::new)?;
        Ok(Box::new(SparkplugInlet {
            settings,
            group: self.group.clone(),
            state: self.host.as_ref().map(|of| format!("spBv1.0/STATE/{of}")),
            host: Host::new(&self.group, self.host.is_some(), channels.into_iter()),
        }))
    }
}

/// A source at work.
struct SparkplugInlet {
    settings: Settings,
    group: String,
    /// The topic of its state, where it is a primary host.
    state: Option<String>,
    host: Host,
}

/// How often is looked at what is due.
const LOOK: Wait = Wait::from_millis(250);

impl Inlet for SparkplugInlet {
    fn run(&mut self, out: &mut Outflow, stop: &Stop) -> Result<(), ConnectorError> {
        let runtime = Builder::new_current_thread().enable_all().build();
        let runtime = runtime.map_err(|error| {
            ConnectorError::new(format_args!(
                "the system has no resources for a connection: {error}"
            ))
        })?;
        let ended = runtime.block_on(self.session(out, stop));
        ended.map_err(|ended| {
            let words = words(ended);
            ConnectorError::new(format_args!("{}: {words}", self.settings.broker))
        })
    }
}

impl SparkplugInlet {
    async fn session(&mut self, out: &mut Outflow, stop: &Stop) -> Result<(), Ended> {
        // The will is of the same time as what is said at the beginning, so that an older one is known as that.
        let ms = now().as_ns() / 1_000_000;
        let said = |is_online: bool| json!({ "online": is_online, "timestamp": ms }).to_string();
        self.settings.last_will = self.state.clone().map(|topic| Will {
            topic,
            payload: said(false).into_bytes(),
            is_retained: true,
        });
        let mut connection = Connection::new(&self.settings).map_err(Ended::Other)?;
        let sender = connection.sender();
        let rung = Arc::new(Notify::new());
        let rings = Arc::clone(&rung);
        let bell = Bell::new(move || rings.notify_one());
        stop.wakes(&bell);
        let mut results = Vec::new();
        while !stop.is_asked() {
            let mut next = pin!(connection.next());
            let event = loop {
                tokio::select! {
                    event = &mut next => break Some(event?),
                    () = rung.notified() => {}
                    () = sleep(LOOK) => {}
                }
                let at = now();
                self.host.pass(Clock::now(), at, &mut results);
                self.give(&mut results, out, &sender);
                if stop.is_asked() {
                    break None;
                }
            };
            match event {
                Some(Event::Connected { .. }) => {
                    let mut topics = self.host.topics();
                    topics.extend(self.state.clone());
                    sender.subscribe(&topics);
                }
                Some(Event::Subscribed(_, codes)) => {
                    for why in codes.iter().filter_map(|of| of.as_ref().err()) {
                        out.remarks()
                            .report(format_args!("the broker refuses a topic: {why}"));
                    }
                    // Only now: what it is answered by is heard.
                    if let Some(topic) = &self.state {
                        sender.publish(topic, true, true, said(true).as_bytes());
                    }
                    self.host.connected(Clock::now(), &mut results);
                    out.connected();
                }
                Some(Event::Message(message)) => {
                    self.take(message, (ms, &said(true)), &sender, &mut results)
                }
                Some(_) | None => {}
            }
            // However often something comes.
            let at = now();
            self.host.pass(Clock::now(), at, &mut results);
            self.give(&mut results, out, &sender);
        }
        if let Some(topic) = &self.state {
            let said =
                json!({ "online": false, "timestamp": now().as_ns() / 1_000_000 }).to_string();
            sender.publish(topic, true, true, said.as_bytes());
        }
        sender.disconnect();
        let leave = async { while connection.next().await.is_ok() {} };
        let _ = timeout(LEAVE, leave).await;
        Ok(())
    }

    fn take(
        &mut self,
        message: Message,
        (ms, online): (i64, &str),
        sender: &Sender,
        results: &mut Vec<Out>,
    ) {
        if let Some(packet) = message.packet {
            sender.acknowledge(packet);
        }
        if self.state.as_ref() == Some(&message.topic) {
            let said: Value = serde_json::from_slice(&message.payload).unwrap_or_default();
            // What the broker kept is of before; what is of this session is our own.
            if message.is_retained {
                return;
            }
            if said["online"] == false {
                sender.publish(&message.topic, true, true, online.as_bytes());
            }
            if said["timestamp"].as_i64() != Some(ms) {
                let words =
                    "another host of this id publishes its STATE; give one of them another `host`";
                results.push(Out::Remark(words.to_owned()));
            }
            return;
        }
        let (now, at) = (Clock::now(), now());
        self.host
            .take(&message.topic, &message.payload, now, at, results);
    }

    fn give(&self, results: &mut Vec<Out>, out: &mut Outflow, sender: &Sender) {
        for of in results.drain(..) {
            match of {
                Out::Sample(channel, stamp, value) => {
                    out.sample(channel, stamp, value);
                }
                Out::Dropped(channel, reason) => out.left_out(channel, reason, 1),
                Out::State(channel, words) => {
                    if out.counts().state(channel).unwrap_or_default() != words {
                        out.state(channel, words);
                    }
                }
                Out::Remark(words) => out.remarks().report(words),
                Out::Rebirth(edge) => {
                    let topic = format!("spBv1.0/{}/NCMD/{edge}", self.group);
                    sender.publish(&topic, false, false, &birth_order(now()));
                }
            }
        }
    }
}
