//! `sparkplug` as a sink: what a machine file says of it, and its thread.

use std::collections::VecDeque;
use std::path::PathBuf;
use std::pin::pin;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{Builder, JoinHandle};
use std::time::{Duration as Wait, Instant as Clock};

use athermal_mqtt::broker::{Broker, ClientId, Identity, Way, keep_alive};
use athermal_mqtt::client::{Connection, Ended, Event, Message, Sender, Settings, Will};
use athermal_serve::connector::{
    BackOff, ConnectorError, Kept, OutRow, Outlet, ParameterRemark, Place, Sink, SinkWiring, Stop,
};
use athermal_serve::deployment::Login;
use athermal_serve::host::time_of_day as now;
use athermal_serve::register_sink;
use schemars::JsonSchema;
use serde::Deserialize;
use serde_json::Value;
use tokio::sync::Notify;
use tokio::time::timeout;

use crate::edge::{Edge, Row, asks_for_birth};
use crate::{LEAVE, level_remarks, words};

/// Outputs as metrics of an edge node of Sparkplug B: `correction.Z1` is the metric `correction/Z1`, with its unit as `engUnit`. Beside them
/// are `revision`, that of the graph, and `degraded`.
///
/// Data say what has changed; what is absent is null. It is a log: ticks that come while there is no broker, or no primary host, are made
/// again from the journal and published as historical. Data have QoS 0: what was on its way when the connection ended is lost.
#[derive(Debug, Deserialize, JsonSchema)]
pub struct SparkplugSink {
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
    /// The client id, if not `athermal-`, the names of machine and sink, and `-sink`.
    #[serde(default)]
    client_id: Option<ClientId>,
    /// The group of the edge node.
    group: String,
    /// Its name in the group; that of the machine without it.
    #[serde(default)]
    edge: Option<String>,
    /// The id of the primary host: without its STATE nothing is published.
    #[serde(default)]
    host: Option<String>,
}

register_sink!(SparkplugSink, "sparkplug");

impl SparkplugSink {
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

impl Sink for SparkplugSink {
    fn remarks(&self) -> Vec<ParameterRemark> {
        let mut all = self.way().remarks();
        all.extend(level_remarks(&[
            ("group", Some(&self.group)),
            ("edge", self.edge.as_ref()),
            ("host", self.host.as_ref()),
        ]));
        all
    }

    fn open(&self, wiring: SinkWiring) -> Result<Box<dyn Outlet>, ConnectorError> {
        let machine = wiring.machine.as_deref();
        let settings = self.way().settings(machine, &wiring.name, &wiring.folder);
        let mut settings = Settings {
            keeps_session: false,
            ..settings.map_err(ConnectorError::new)?
        };
        // A source may have the same name, and each has a session of its own.
        if self.client_id.is_none() {
            settings.client_id += "-sink";
        }
        Connection::new(&settings).map_err(ConnectorError::new)?;
        let edge = self.edge.clone().or(wiring.machine);
        let edge = edge.ok_or_else(|| {
            ConnectorError::new("the edge node has no name: write `edge`, or a `name` of the graph")
        })?;
        // Another one than that of the run before, as the death that a broker may still publish of it has.
        let birth = (now().as_ns() / 1_000_000_000 % 256) as u8;
        let topic = |verb: &str| format!("spBv1.0/{}/{verb}/{edge}", self.group);
        let work = Work {
            shared: Arc::default(),
            stop: Stop::default(),
            edge: Edge::new(&wiring.outputs, birth),
            topics: ["NBIRTH", "NDATA", "NDEATH", "NCMD"].map(topic),
            state: self.host.as_ref().map(|of| format!("spBv1.0/STATE/{of}")),
            settings,
            retry: wiring.retry,
        };
        Ok(Box::new(SparkplugOutlet::start(work)?))
    }
}

/// How many ticks wait for a connection that is slow.
const WAITING: usize = 1000;

/// What waits, and how the connection is.
#[derive(Debug, Default)]
struct Waiting {
    rows: VecDeque<Row>,
    /// How many of them, from the front on, are on their way.
    sent: usize,
    /// Whether hosts are given what is published.
    is_born: bool,
    /// Why not.
    away: String,
}

/// What both threads share.
#[derive(Debug, Default)]
struct Shared {
    waiting: Mutex<Waiting>,
    /// Something has left.
    left: Condvar,
    /// Something has come.
    came: Notify,
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, Waiting> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn is_away(&self, why: &str) {
        let mut waiting = self.lock();
        waiting.is_born = false;
        why.clone_into(&mut waiting.away);
    }
}

/// A sink at work.
struct SparkplugOutlet {
    shared: Arc<Shared>,
    broker: String,
    stop: Stop,
    thread: Option<JoinHandle<()>>,
}

impl SparkplugOutlet {
    fn start(mut work: Work) -> Result<Self, ConnectorError> {
        let failed = |error| {
            ConnectorError::new(format_args!(
                "the system has no resources for a connection: {error}"
            ))
        };
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .build()
            .map_err(failed)?;
        work.shared.is_away("not yet connected");
        let (shared, stop) = (Arc::clone(&work.shared), work.stop.clone());
        let broker = work.settings.broker.to_string();
        let thread = Builder::new()
            .name("sparkplug".to_owned())
            .spawn(move || runtime.block_on(work.run()))
            .map_err(failed)?;
        Ok(Self {
            shared,
            broker,
            stop,
            thread: Some(thread),
        })
    }

    fn ready(&self, waiting: &Waiting) -> Result<(), ConnectorError> {
        match waiting.is_born {
            true => Ok(()),
            false => Err(ConnectorError::new(format_args!(
                "not connected to {}: {}",
                self.broker, waiting.away
            ))),
        }
    }
}

impl Outlet for SparkplugOutlet {
    fn put(&mut self, row: &OutRow<'_>) -> Result<(), ConnectorError> {
        let mut waiting = self.shared.lock();
        self.ready(&waiting)?;
        if waiting.rows.len() >= WAITING {
            return Err(ConnectorError::new(format_args!(
                "{} does not take {WAITING} ticks that wait",
                self.broker
            )));
        }
        waiting.rows.push_back(Row::of(row));
        drop(waiting);
        self.shared.came.notify_one();
        Ok(())
    }

    fn state(&mut self) -> Result<(), ConnectorError> {
        self.ready(&self.shared.lock())
    }

    fn held(&self) -> u64 {
        self.shared.lock().rows.len() as u64
    }

    fn kept(&mut self) -> Option<&mut dyn Kept> {
        Some(self)
    }
}

/// Hosts cannot be asked which ticks they have: those behind the last place that was kept are published again.
impl Kept for SparkplugOutlet {
    fn end(&mut self) -> Result<Place, ConnectorError> {
        let mut waiting = self.shared.lock();
        let until = Clock::now() + Wait::from_secs(1);
        while !waiting.rows.is_empty() {
            let left = until.saturating_duration_since(Clock::now());
            if left.is_zero() || !waiting.is_born {
                let rows = waiting.rows.len();
                let broker = &self.broker;
                return Err(ConnectorError::new(format_args!(
                    "{rows} ticks wait for {broker}"
                )));
            }
            let waited = self.shared.left.wait_timeout(waiting, left);
            waiting = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
        Ok(Place::default())
    }

    fn rows_after(&mut self, _: Place) -> Result<Option<u64>, ConnectorError> {
        Ok(Some(0))
    }

    fn cut(&mut self, _: Place, _: u64) -> Result<(), ConnectorError> {
        Ok(())
    }
}

impl Drop for SparkplugOutlet {
    /// What still waits is sent, if that is done within a moment.
    fn drop(&mut self) {
        let _ = self.end();
        self.stop.ask();
        self.shared.came.notify_one();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// The thread's own.
struct Work {
    shared: Arc<Shared>,
    stop: Stop,
    edge: Edge,
    /// Of births, data, deaths and orders.
    topics: [String; 4],
    /// Where the primary host says whether it is there, if there is one.
    state: Option<String>,
    settings: Settings,
    retry: Wait,
}

/// What is on its way on a connection.
#[derive(Default)]
struct OnItsWay {
    /// Of each message, how many ticks are published with it.
    rows: VecDeque<usize>,
    /// Data that the connection had no room for.
    data: Option<Vec<u8>>,
}

impl Work {
    async fn run(&mut self) {
        let mut back_off = BackOff::up_to(self.retry);
        while !self.stop.is_asked() {
            let began = Clock::now();
            let Err(ended) = self.connection().await else {
                return;
            };
            self.shared.is_away(&words(ended));
            self.shared.lock().sent = 0;
            let mut left = back_off.after(began.elapsed());
            let until = Clock::now() + left;
            while !left.is_zero() && !self.stop.is_asked() {
                let _ = timeout(left, self.shared.came.notified()).await;
                left = until.saturating_duration_since(Clock::now());
            }
        }
    }

    async fn connection(&mut self) -> Result<(), Ended> {
        self.settings.last_will = Some(Will {
            topic: self.topics[2].clone(),
            payload: self.edge.connects(now()),
            is_retained: false,
        });
        let mut connection = Connection::new(&self.settings).map_err(Ended::Other)?;
        let sender = connection.sender();
        let mut on_its_way = OnItsWay::default();
        // Whether orders are heard, and whether the primary host is there.
        let (mut hears, mut has_host) = (false, self.state.is_none());
        let mut ended = Ok(());
        while !self.stop.is_asked() {
            let mut next = pin!(connection.next());
            let event = loop {
                tokio::select! {
                    event = &mut next => break Some(event?),
                    () = self.shared.came.notified() => {
                        if self.stop.is_asked() {
                            break None;
                        }
                        self.send(&sender, &mut on_its_way);
                    }
                }
            };
            match event {
                Some(Event::Connected { .. }) => {
                    let mut topics = vec![self.topics[3].clone()];
                    topics.extend(self.state.clone());
                    sender.subscribe(&topics);
                    if let Some(state) = &self.state {
                        self.shared
                            .is_away(&format!("the primary host is not there by `{state}`"));
                    }
                }
                Some(Event::Subscribed(_, codes)) => {
                    if let Some(why) = codes.into_iter().find_map(Result::err) {
                        return Err(Ended::Other(format!("the broker refuses a topic: {why}")));
                    }
                    hears = true;
                }
                Some(Event::Message(message)) => {
                    let was_there = has_host;
                    let asks = self.heard(message, &sender, &mut has_host);
                    if was_there && !has_host {
                        ended = Err(Ended::Other("the primary host is gone".to_owned()));
                        break;
                    }
                    if asks && self.shared.lock().is_born {
                        self.be_born(&sender, &mut on_its_way);
                    }
                }
                Some(Event::PublishSent(_)) => {
                    let rows = on_its_way.rows.pop_front().unwrap_or(0);
                    self.has_left(rows);
                }
                Some(_) => {}
                None => break,
            }
            if hears && has_host && !self.shared.lock().is_born {
                self.be_born(&sender, &mut on_its_way);
            }
            self.send(&sender, &mut on_its_way);
        }
        self.leave(connection, &sender).await;
        ended
    }

    /// Its end is its death, which the broker does not publish of those who take leave.
    async fn leave(&self, mut connection: Connection, sender: &Sender) {
        sender.publish(&self.topics[2], true, false, &self.edge.death(now()));
        sender.disconnect();
        let leave = async { while connection.next().await.is_ok() {} };
        let _ = timeout(LEAVE, leave).await;
    }

    /// Hears a message: whether it asks for a birth.
    fn heard(&self, message: Message, sender: &Sender, has_host: &mut bool) -> bool {
        if let Some(packet) = message.packet {
            sender.acknowledge(packet);
        }
        if self.state.as_ref() == Some(&message.topic) {
            let said: Value = serde_json::from_slice(&message.payload).unwrap_or_default();
            *has_host = said["online"] == true;
            return false;
        }
        asks_for_birth(&message.payload)
    }

    fn be_born(&mut self, sender: &Sender, on_its_way: &mut OnItsWay) {
        // What had no room was numbered after the birth before: its tick is published again.
        self.shared.lock().sent -= usize::from(on_its_way.data.take().is_some());
        let birth = self.edge.birth(now());
        if sender.publish(&self.topics[0], false, false, &birth) {
            on_its_way.rows.push_back(0);
            self.shared.lock().is_born = true;
        }
    }

    /// Publishes what waits, as far as there is room.
    fn send(&mut self, sender: &Sender, on_its_way: &mut OnItsWay) {
        let mut waiting = self.shared.lock();
        if !waiting.is_born {
            return;
        }
        let mut gone = 0;
        loop {
            let is_left = on_its_way.data.is_some();
            let Some(row) = waiting.rows.get(waiting.sent).filter(|_| !is_left) else {
                match &on_its_way.data {
                    Some(data) if sender.publish(&self.topics[1], false, false, data) => {
                        on_its_way.data = None;
                        on_its_way.rows.push_back(1);
                        continue;
                    }
                    _ => break,
                }
            };
            on_its_way.data = self.edge.data(row);
            waiting.sent += 1;
            if on_its_way.data.is_none() {
                // Nothing has changed: it has left with the one before.
                match on_its_way.rows.back_mut() {
                    Some(rows) => *rows += 1,
                    None => gone += 1,
                }
            }
        }
        drop(waiting);
        self.has_left(gone);
    }

    fn has_left(&self, rows: usize) {
        let mut waiting = self.shared.lock();
        waiting.rows.drain(..rows);
        waiting.sent -= rows;
        drop(waiting);
        self.shared.left.notify_all();
    }
}
