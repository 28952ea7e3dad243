//! `opcua` as a source: what a machine file says of it.

use std::time::Duration as Wait;

use athermal_core::time::{Duration, Instant};
use athermal_core::unit::Unit;
use athermal_serve::connector::{
    ConnectorError, Inlet, Outflow, ParameterRemark, Seen, Source, SourceWiring, Stop,
};
use athermal_serve::deployment::Login;
use athermal_serve::register_source;
use schemars::JsonSchema;
use serde::Deserialize;
use tokio::runtime::{Builder, Runtime};

use crate::look::look;
use crate::node::Node;
use crate::server::{Mode, Security, Server, Settings, Way};
use crate::session::Session;
use crate::subscription::Sampling;
use crate::value::{Time, Uncertain};

/// Variables of an OPC UA server: `channels` says which node gives which channel, such as { "temperature.plate" = "s=Therm.Plate" }.
///
/// The server samples them, and sends what has changed. Nodes that are not there are asked for again; a connection that is lost is taken up
/// again, and what the server had queued comes then. A value that is not good is absent, and counted by reason.
#[derive(Debug, Deserialize, JsonSchema)]
pub struct OpcuaSource {
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
    /// How often the server is to look at each node.
    #[serde(default = "sampling")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    sampling: Duration,
    /// How often it is to send what has changed; as often as it samples without.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0))]
    publishing: Option<Duration>,
    /// How many values of a node it is to keep until they are sent; ten seconds of them without.
    #[serde(default)]
    #[schemars(range(min = 1, max = 100_000))]
    queue: Option<u32>,
    /// By how much a value has to change to be sent, in the unit of the server. Only of nodes that are numbers.
    #[serde(default)]
    #[schemars(range(min = 0.0))]
    deadband: Option<f64>,
    /// How often a value that has not changed counts again, while the server says that it lives; never without.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0))]
    repeat: Option<Duration>,
    /// What becomes of values whose quality is uncertain: they are "absent", or a "sample" like any other.
    #[serde(default)]
    uncertain: Uncertain,
    /// By which clock values are stamped: that of the "source", of the "server", or by their "arrival".
    #[serde(default)]
    time: Time,
}

register_source!(OpcuaSource, "opcua");

const fn sampling() -> Duration {
    Duration::from_ns(100_000_000)
}

fn wait(of: Duration) -> Wait {
    Wait::from_nanos(of.as_ns().max(0) as u64)
}

/// What is asked of a channel.
#[derive(Debug, Clone)]
pub(crate) struct Asked {
    pub(crate) node: Node,
    /// Whether a truth value is a number of it.
    pub(crate) is_plain: bool,
    /// The newest stamp that is known.
    pub(crate) after: Instant,
}

/// All that is asked.
#[derive(Debug, Clone)]
pub(crate) struct Plan {
    pub(crate) settings: Settings,
    pub(crate) channels: Vec<Asked>,
    pub(crate) sampling: Sampling,
    pub(crate) repeat: Option<Wait>,
    pub(crate) uncertain: Uncertain,
    pub(crate) time: Time,
    /// After how long without a sign of life the connection is cut.
    pub(crate) dead: Wait,
}

/// How long an answer may take, at least and at most.
const PATIENCE: (Wait, Wait) = (Wait::from_millis(500), Wait::from_secs(10));
/// After how long without a change the server says that it lives, at most.
const ALIVE: Wait = Wait::from_secs(5);

impl OpcuaSource {
    fn plan(&self, wiring: &SourceWiring) -> Result<Plan, ConnectorError> {
        let way = Way {
            server: &self.endpoint,
            security: self.security,
            mode: self.mode,
            login: self.login.as_ref(),
        };
        // Before `silent` is over: what the server has queued is lost where the session is.
        let dead = wiring.silent.mul_f64(0.6);
        let patience = dead.clamp(PATIENCE.0, PATIENCE.1);
        let settings = way.settings(
            (wiring.machine.as_deref(), &wiring.name),
            (&wiring.folder, &wiring.state),
            (patience, wiring.retry),
        );
        let channels = wiring.channels.iter().map(|of| {
            let node = Node::parse(&of.address, self.namespace.as_deref());
            Ok(Asked {
                node: node.map_err(ConnectorError::new)?,
                is_plain: of.unit == Unit::one(),
                after: of.after,
            })
        });
        let sampling = wait(self.sampling);
        let ten_seconds = (10.0 / sampling.as_secs_f64()).ceil() as u32;
        Ok(Plan {
            settings: settings.map_err(ConnectorError::new)?,
            channels: channels.collect::<Result<_, _>>()?,
            sampling: Sampling {
                sampling,
                publishing: self.publishing.map_or(sampling, wait),
                queue: self.queue.unwrap_or(ten_seconds.clamp(10, 10_000)),
                deadband: self.deadband,
                alive: (dead / 3).min(ALIVE),
            },
            repeat: self.repeat.map(wait),
            uncertain: self.uncertain,
            time: self.time,
            dead,
        })
    }
}

impl Source for OpcuaSource {
    fn needs_addresses(&self) -> bool {
        true
    }

    fn remarks(&self, _: usize) -> Vec<ParameterRemark> {
        let way = Way {
            server: &self.endpoint,
            security: self.security,
            mode: self.mode,
            login: self.login.as_ref(),
        };
        way.remarks()
    }

    fn remark(&self, address: &str) -> Option<ParameterRemark> {
        let (is_mistake, words, help) = match Node::parse(address, self.namespace.as_deref()) {
            Err(words) => (
                true,
                words,
                "`athermal browse opc.tcp://…` writes the nodes of a server",
            ),
            Ok(node) if node.is_by_number() => (
                false,
                "the number of a namespace may be another one after a restart of the server"
                    .to_owned(),
                "name it by its URI, with `namespace` or \"nsu=URI;…\", as `athermal browse opc.tcp://…` writes it",
            ),
            Ok(_) => return None,
        };
        Some(ParameterRemark {
            at: Vec::new(),
            is_mistake,
            words,
            help: help.to_owned(),
        })
    }

    fn look(&self, wiring: SourceWiring, patience: Wait) -> Result<Vec<Seen>, ConnectorError> {
        let plan = self.plan(&wiring)?;
        let seen = runtime()?.block_on(look(&plan, patience));
        seen.map_err(|why| ConnectorError::new(format_args!("{}: {why}", self.endpoint)))
    }

    fn open(&self, wiring: SourceWiring) -> Result<Box<dyn Inlet>, ConnectorError> {
        Ok(Box::new(OpcuaInlet(self.plan(&wiring)?)))
    }
}

/// What the crate that speaks the protocol runs on, and what it says beside ours is not shown.
pub(crate) fn runtime() -> Result<Runtime, ConnectorError> {
    let runtime = Builder::new_current_thread().enable_all().build();
    runtime.map_err(|error| {
        ConnectorError::new(format_args!(
            "the system has no resources for a connection: {error}"
        ))
    })
}

/// What is written of it into a log is not for people.
pub(crate) fn quiet() -> tracing::subscriber::DefaultGuard {
    tracing::subscriber::set_default(tracing::subscriber::NoSubscriber::default())
}

/// A source at work.
struct OpcuaInlet(Plan);

impl Inlet for OpcuaInlet {
    fn run(&mut self, out: &mut Outflow, stop: &Stop) -> Result<(), ConnectorError> {
        let _quiet = quiet();
        let server = self.0.settings.server.clone();
        let ended = runtime()?.block_on(Session::run(&mut self.0, out, stop));
        ended.map_err(|why| ConnectorError::new(format_args!("{server}: {why}")))
    }
}
