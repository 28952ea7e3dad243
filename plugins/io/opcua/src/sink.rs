//! `opcua` as a sink: outputs are written into variables of a server, as commands.

use std::collections::BTreeMap;
use std::sync::mpsc::{Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{Builder, JoinHandle};
use std::time::{Duration as Wait, Instant as Clock};

use athermal_core::time::Duration;
use athermal_serve::connector::{
    BackOff, ConnectorError, OutRow, Outlet, ParameterRemark, Purpose, Seen, Sink, SinkWiring,
};
use athermal_serve::deployment::Login;
use athermal_serve::register_sink;
use opcua::types::{
    AttributeId, DataValue, NodeId, StatusCode, Variant, VariantScalarTypeId as Kind, WriteValue,
};
use schemars::JsonSchema;
use serde::Deserialize;
use tokio::sync::mpsc::{UnboundedReceiver, UnboundedSender, unbounded_channel};
use tokio::time::{MissedTickBehavior, interval, timeout};

use crate::link::{Event, Link, error_words};
use crate::node::Node;
use crate::server::{Mode, Security, Server, Settings, Way};
use crate::source::{quiet, runtime};
use crate::value::{Uncertain, code, read};

/// Outputs as values of variables of an OPC UA server, each in the type of its node.
///
/// It is a command: only what is recent is written, an output that is absent is not, and where the server cannot be reached nothing is
/// written later. What was written last stays there when the service ends: a controller that goes by it watches `alive`, a number that grows.
#[derive(Debug, Deserialize, JsonSchema)]
pub struct OpcuaSink {
    /// The server: "opc.tcp://HOST", with ":PORT" where it is not 4840, and a path where it has one.
    endpoint: Server,
    /// How messages are secured: "none", "Basic256Sha256", "Aes128_Sha256_RsaOaep" or "Aes256_Sha256_RsaPss".
    #[serde(default)]
    security: Security,
    /// With `security`: whether they are encrypted too, "sign_and_encrypt", or only signed, "sign".
    #[serde(default)]
    mode: Mode,
    /// User and password.
    #[serde(default)]
    login: Option<Login>,
    /// The URI of the namespace of nodes that say none.
    #[serde(default)]
    namespace: Option<String>,
    /// Into which nodes: "s=Drift.{output}", or a table such as { "correction.Z1" = "s=Axis.Z1.Drift" }.
    nodes: Nodes,
    /// From which nodes is read what the machine applies at present, in the same form; without it that is what was written last.
    #[serde(default)]
    applied: Option<Nodes>,
    /// Into which node it writes a number that grows, for as long as the service lives.
    #[serde(default)]
    alive: Option<String>,
    /// How often it does.
    #[serde(default = "second")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    every: Duration,
}

register_sink!(OpcuaSink, "opcua");

/// The nodes of outputs.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(untagged)]
enum Nodes {
    /// One for each, with `{output}` in its name.
    Pattern(String),
    /// Each by itself.
    Each(BTreeMap<String, String>),
}

const fn second() -> Duration {
    Duration::from_ns(1_000_000_000)
}

/// How long an answer may take.
const PATIENCE: Wait = Wait::from_secs(2);
/// How long is waited for the server at the end.
const LEAVE: Wait = Wait::from_millis(300);

/// What is to be written where.
#[derive(Debug, Clone)]
struct Targets {
    settings: Settings,
    outputs: Vec<Node>,
    applied: Option<Vec<Node>>,
    alive: Option<Node>,
    every: Wait,
}

impl OpcuaSink {
    fn way(&self) -> Way<'_> {
        Way {
            server: &self.endpoint,
            security: self.security,
            mode: self.mode,
            login: self.login.as_ref(),
        }
    }

    fn nodes(&self, of: &Nodes, wiring: &SinkWiring) -> Result<Vec<Node>, String> {
        let names = || wiring.outputs.iter().map(|of| &of.name);
        if let Nodes::Each(each) = of
            && let Some(other) = each.keys().find(|key| names().all(|of| of != *key))
        {
            return Err(format!(
                "`{other}` is none of its outputs, which are {}",
                names().cloned().collect::<Vec<_>>().join(", ")
            ));
        }
        let nodes = names().map(|name| {
            let text = match of {
                Nodes::Pattern(text) => text.replace("{output}", name),
                Nodes::Each(each) => each.get(name).cloned().ok_or_else(|| {
                    format!("no node is named for `{name}`: name it in `nodes`, or leave the output out by `outputs`")
                })?,
            };
            Node::parse(&text, self.namespace.as_deref())
        });
        nodes.collect()
    }

    fn targets(&self, wiring: &SinkWiring) -> Result<Targets, String> {
        let settings = self.way().settings(
            (wiring.machine.as_deref(), &wiring.name),
            (&wiring.folder, &wiring.state),
            (PATIENCE, wiring.retry),
        );
        let applied = self.applied.as_ref().map(|of| self.nodes(of, wiring));
        let alive = self.alive.as_ref();
        let alive = alive.map(|of| Node::parse(of, self.namespace.as_deref()));
        Ok(Targets {
            settings: settings?,
            outputs: self.nodes(&self.nodes, wiring)?,
            applied: applied.transpose()?,
            alive: alive.transpose()?,
            every: Wait::from_nanos(self.every.as_ns().max(1) as u64),
        })
    }
}

impl Sink for OpcuaSink {
    fn purpose(&self) -> Purpose {
        Purpose::Command
    }

    fn remarks(&self) -> Vec<ParameterRemark> {
        let mut all = self.way().remarks();
        if let Nodes::Pattern(text) = &self.nodes
            && !text.contains("{output}")
        {
            all.push(ParameterRemark {
                at: vec!["nodes".to_owned()],
                is_mistake: true,
                words: "all outputs would be written into one node".to_owned(),
                help: "write {output} where the name of the output stands, or a table of outputs and nodes".to_owned(),
            });
        }
        if self.alive.is_none() {
            all.push(ParameterRemark {
                at: vec!["nodes".to_owned()],
                is_mistake: false,
                words: "the last value stays there when the service ends, and nothing says that it has".to_owned(),
                help: "name a counter as `alive`, and let the controller go to its safe state when that stands still".to_owned(),
            });
        }
        all
    }

    fn look(
        &self,
        wiring: SinkWiring,
        patience: Wait,
    ) -> Option<Result<Vec<Seen>, ConnectorError>> {
        let look = || {
            let targets = self.targets(&wiring)?;
            let runtime = runtime().map_err(|of| of.to_string())?;
            let _quiet = quiet();
            let found = async {
                let mut link = Link::open(&targets.settings).await?;
                let all = targets.outputs.iter().chain(&targets.alive);
                let found = places(&mut link, all).await?;
                link.leave(LEAVE).await;
                Ok(found)
            };
            let found = runtime.block_on(async { timeout(patience, found).await });
            let found =
                found.unwrap_or_else(|_| Err(format!("no answer in {} s", patience.as_secs())))?;
            // What is wrong with the counter is wrong with all.
            if let Some(Err(why)) = found.get(targets.outputs.len()) {
                return Err(format!("`alive`: {why}"));
            }
            let nodes = targets.outputs.iter().zip(found).enumerate();
            Ok(nodes
                .map(|(channel, (node, found))| seen(channel, node, found))
                .collect())
        };
        let words = |why: String| ConnectorError::new(format_args!("{}: {why}", self.endpoint));
        Some(look().map_err(words))
    }

    fn open(&self, wiring: SinkWiring) -> Result<Box<dyn Outlet>, ConnectorError> {
        let targets = self.targets(&wiring).map_err(ConnectorError::new)?;
        let server = self.endpoint.to_string();
        let shared: Arc<Mutex<Option<String>>> = Arc::default();
        *shared.lock().unwrap_or_else(PoisonError::into_inner) =
            Some("not yet connected".to_owned());
        let runtime = runtime()?;
        let (requests, asked) = unbounded_channel();
        let mut work = Work {
            targets,
            away: Arc::clone(&shared),
            asked,
            count: 0,
        };
        let thread = Builder::new().name("opcua".to_owned()).spawn(move || {
            let _quiet = quiet();
            runtime.block_on(work.run());
        });
        let thread = thread.map_err(|error| {
            ConnectorError::new(format_args!(
                "the system has no resources for a connection: {error}"
            ))
        })?;
        Ok(Box::new(OpcuaOutlet {
            server,
            away: shared,
            requests: Some(requests),
            thread: Some(thread),
        }))
    }
}

fn seen(channel: usize, node: &Node, found: Result<Place, String>) -> Seen {
    let (value, quality) = match found {
        Ok(place) => (
            Some(place.value),
            format!("{:?}, can be written", place.kind),
        ),
        Err(why) => (None, why),
    };
    Seen {
        channel,
        value,
        quality,
        stamp: None,
        offset: None,
        granted: node.to_string(),
    }
}

/// Where something is written.
#[derive(Debug, Clone)]
struct Place {
    id: NodeId,
    kind: Kind,
    /// What is there.
    value: f64,
}

/// Where nodes are, and of which type; or why nothing can be written there.
async fn places(
    link: &mut Link,
    nodes: impl Iterator<Item = &Node>,
) -> Result<Vec<Result<Place, String>>, String> {
    let namespaces = link.namespaces().await?;
    let ids: Vec<_> = nodes.map(|of| of.resolve(&namespaces)).collect();
    let asked = ids.iter().flatten().flat_map(|id| {
        let attributes = [
            AttributeId::Value,
            AttributeId::DataType,
            AttributeId::UserAccessLevel,
        ];
        attributes.map(|of| (id.clone(), of))
    });
    let read = link.read(&asked.collect::<Vec<_>>()).await?;
    let mut read = read.chunks_exact(3);
    let places = ids.into_iter().map(|id| {
        let id = id?;
        let [value, data_type, access] = read.next().unwrap_or_default() else {
            return Err("no answer".to_owned());
        };
        place(id, value, data_type, access)
    });
    Ok(places.collect())
}

fn place(
    id: NodeId,
    value: &DataValue,
    data_type: &DataValue,
    access: &DataValue,
) -> Result<Place, String> {
    if let Some(status) = data_type.status.filter(StatusCode::is_bad) {
        return Err(code(status));
    }
    let current = value.value.as_ref();
    if matches!(current, Some(Variant::Array(_))) {
        return Err("it is an array".to_owned());
    }
    // A type that is derived from a number has its values in that.
    let of_value = current.and_then(Variant::scalar_type_id);
    let of_node = match &data_type.value {
        Some(Variant::NodeId(of)) => Kind::try_from(&**of).ok(),
        _ => None,
    };
    let kind = of_value.or(of_node).ok_or("its type is not known")?;
    if written(kind, 0.0).is_none() {
        return Err(format!("it is a {kind:?}, and no number"));
    }
    // The second bit says that it may be written.
    if let Some(Variant::Byte(access)) = access.value
        && access & 2 == 0
    {
        return Err("it cannot be written by this user".to_owned());
    }
    let value = read(value, Uncertain::Sample, false).unwrap_or(0.0);
    Ok(Place { id, kind, value })
}

/// A number in the type of a node; none where the type is none of a number, or does not have it.
fn written(kind: Kind, value: f64) -> Option<Variant> {
    let whole = value.round();
    macro_rules! whole {
        ($of:ty) => {
            (whole >= <$of>::MIN as f64 && whole <= <$of>::MAX as f64)
                .then(|| (whole as $of).into())
        };
    }
    match kind {
        Kind::Double => Some(value.into()),
        Kind::Float => (value.abs() <= f64::from(f32::MAX)).then(|| (value as f32).into()),
        Kind::SByte => whole!(i8),
        Kind::Byte => whole!(u8),
        Kind::Int16 => whole!(i16),
        Kind::UInt16 => whole!(u16),
        Kind::Int32 => whole!(i32),
        Kind::UInt32 => whole!(u32),
        Kind::Int64 => whole!(i64),
        Kind::UInt64 => whole!(u64),
        _ => None,
    }
}

/// What is asked of the thread.
enum Request {
    /// To write the outputs.
    Write(Vec<f64>, Sender<Result<(), String>>),
    /// What is applied.
    Applied(Sender<Option<Vec<f64>>>),
}

/// A sink at work.
struct OpcuaOutlet {
    server: String,
    /// Why there is no connection; none where there is one.
    away: Arc<Mutex<Option<String>>>,
    requests: Option<UnboundedSender<Request>>,
    thread: Option<JoinHandle<()>>,
}

impl OpcuaOutlet {
    fn ask(&self, request: Request) -> Result<(), ConnectorError> {
        let requests = self.requests.as_ref();
        let sent = requests.is_some_and(|of| of.send(request).is_ok());
        let failed = || ConnectorError::new("its thread has ended");
        sent.then_some(()).ok_or_else(failed)
    }
}

impl Outlet for OpcuaOutlet {
    fn put(&mut self, row: &OutRow<'_>) -> Result<(), ConnectorError> {
        self.state()?;
        let (answer, answered) = channel();
        self.ask(Request::Write(row.outputs.to_vec(), answer))?;
        let none = Err("no answer in time".to_owned());
        let answered = answered.recv_timeout(PATIENCE * 2).unwrap_or(none);
        answered.map_err(|why| ConnectorError::new(format_args!("{}: {why}", self.server)))
    }

    fn state(&mut self) -> Result<(), ConnectorError> {
        match &*self.away.lock().unwrap_or_else(PoisonError::into_inner) {
            None => Ok(()),
            Some(why) => Err(ConnectorError::new(format_args!("{}: {why}", self.server))),
        }
    }

    fn applied(&mut self) -> Option<Vec<f64>> {
        self.state().ok()?;
        let (answer, answered) = channel();
        self.ask(Request::Applied(answer)).ok()?;
        answered.recv_timeout(PATIENCE * 2).ok()?
    }
}

impl Drop for OpcuaOutlet {
    fn drop(&mut self) {
        self.requests = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// The thread's own.
struct Work {
    targets: Targets,
    away: Arc<Mutex<Option<String>>>,
    asked: UnboundedReceiver<Request>,
    count: u64,
}

impl Work {
    async fn run(&mut self) {
        let mut back_off = BackOff::up_to(self.targets.settings.retry);
        loop {
            let began = Clock::now();
            let Err(why) = self.connection().await else {
                return;
            };
            self.is_away(Some(why));
            let until = Clock::now() + back_off.after(began.elapsed());
            // What is asked meanwhile has its answer at once.
            loop {
                let left = until.saturating_duration_since(Clock::now());
                match timeout(left, self.asked.recv()).await {
                    Err(_) => break,
                    Ok(None) => return,
                    Ok(Some(request)) => refuse(request, "not connected"),
                }
            }
        }
    }

    fn is_away(&self, why: Option<String>) {
        *self.away.lock().unwrap_or_else(PoisonError::into_inner) = why;
    }

    async fn connection(&mut self) -> Result<(), String> {
        let mut link = tokio::select! {
            link = Link::open(&self.targets.settings) => link?,
            request = self.asked.recv() => {
                let Some(request) = request else { return Ok(()) };
                refuse(request, "not connected");
                return Err("not connected".to_owned());
            }
        };
        let mut places = self.places(&mut link).await?;
        self.is_away(None);
        let mut beats = interval(self.targets.every);
        beats.set_missed_tick_behavior(MissedTickBehavior::Delay);
        loop {
            tokio::select! {
                request = self.asked.recv() => match request {
                    None => {
                        link.leave(LEAVE).await;
                        return Ok(());
                    }
                    Some(Request::Write(values, answer)) => {
                        let written = write(&mut link, &places, &values).await;
                        let _ = answer.send(written.clone().and_then(|of| of));
                        written?.ok();
                    }
                    Some(Request::Applied(answer)) => {
                        let _ = answer.send(self.applied(&mut link).await);
                    }
                },
                _ = beats.tick() => {
                    if let Some(place) = places.get(self.targets.outputs.len()) {
                        self.count += 1;
                        let place = std::slice::from_ref(place);
                        let value = counted(place[0].kind, self.count);
                        write(&mut link, place, &[value]).await??;
                    }
                }
                event = link.next() => match event? {
                    // An old command is none: what was not answered is not written again.
                    Event::Lost(why) => return Err(why),
                    Event::Begun => places = self.places(&mut link).await?,
                    Event::NotYet(_) | Event::TakenUp | Event::Forgotten => {}
                },
            }
        }
    }

    /// Where outputs are written, and behind them the counter.
    async fn places(&self, link: &mut Link) -> Result<Vec<Place>, String> {
        let nodes = || self.targets.outputs.iter().chain(&self.targets.alive);
        let found = places(link, nodes()).await?;
        let named = nodes().zip(found);
        let found = named.map(|(node, of)| of.map_err(|why| format!("{node}: {why}")));
        found.collect()
    }

    async fn applied(&self, link: &mut Link) -> Option<Vec<f64>> {
        let namespaces = link.namespaces().await.ok()?;
        let nodes = self.targets.applied.iter().flatten();
        let ids = nodes.map(|of| Some((of.resolve(&namespaces).ok()?, AttributeId::Value)));
        let ids: Option<Vec<_>> = ids.collect();
        let ids = ids.filter(|of| !of.is_empty())?;
        let values = link.read(&ids).await.ok()?;
        let value = |of: &DataValue| read(of, Uncertain::Absent, false).unwrap_or(f64::NAN);
        Some(values.iter().map(value).collect())
    }
}

/// A count in a type that ends: it begins anew.
fn counted(kind: Kind, count: u64) -> f64 {
    let (count, most) = match kind {
        Kind::SByte => (count, 1 << 7),
        Kind::Byte => (count, 1 << 8),
        Kind::Int16 => (count, 1 << 15),
        Kind::UInt16 => (count, 1 << 16),
        _ => (count, 1 << 24),
    };
    (count % most) as f64
}

fn refuse(request: Request, why: &str) {
    match request {
        Request::Write(_, answer) => drop(answer.send(Err(why.to_owned()))),
        Request::Applied(answer) => drop(answer.send(None)),
    }
}

/// Writes values; those that are absent are left as they are. Whether the server takes them, if it answers.
async fn write(
    link: &mut Link,
    places: &[Place],
    values: &[f64],
) -> Result<Result<(), String>, String> {
    let (mut all, mut of) = (Vec::new(), Vec::new());
    for (place, value) in places
        .iter()
        .zip(values)
        .filter(|(_, value)| !value.is_nan())
    {
        let Some(value) = written(place.kind, *value) else {
            return Ok(Err(format!("{}: {value} is no {:?}", place.id, place.kind)));
        };
        of.push(&place.id);
        all.push(WriteValue {
            node_id: place.id.clone(),
            attribute_id: AttributeId::Value as u32,
            // With a time or a status many servers take none.
            value: DataValue::value_only(value),
            ..WriteValue::default()
        });
    }
    if all.is_empty() {
        return Ok(Ok(()));
    }
    let session = Arc::clone(&link.session);
    let answers = link.drive(async move { session.write(&all).await }).await?;
    let answers = answers.map_err(|of| error_words(&of))?;
    let bad = of.iter().zip(&answers).find(|(_, status)| status.is_bad());
    match bad {
        Some((id, status)) => Ok(Err(format!("{id}: {}", code(*status)))),
        None if answers.len() == of.len() => Ok(Ok(())),
        None => Err("it answers to another question".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_is_written_in_the_type_of_its_node_or_not_at_all() {
        for (kind, value, expected) in [
            (Kind::Double, 1.5, Some(Variant::Double(1.5))),
            (Kind::Float, 1.5, Some(Variant::Float(1.5))),
            (Kind::Float, 1e39, None),
            (Kind::Int16, -2.6, Some(Variant::Int16(-3))),
            (Kind::Int16, 40_000.0, None),
            (Kind::UInt32, -1.0, None),
            (Kind::Byte, 255.0, Some(Variant::Byte(255))),
            (Kind::String, 1.0, None),
            (Kind::Boolean, 1.0, None),
        ] {
            assert_eq!(written(kind, value), expected, "{kind:?} {value}");
        }
        assert_eq!(counted(Kind::Byte, 257), 1.0);
        assert_eq!(counted(Kind::Int16, 32_768), 0.0);
    }
}
