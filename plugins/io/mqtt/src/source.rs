//! `mqtt` as a source: what a machine file says of it.

use std::collections::{BTreeSet, VecDeque};
use std::path::PathBuf;
use std::time::{Duration as Wait, Instant as Clock};

use athermal_core::time::{Duration, Instant};
use athermal_core::unit::Unit;
use athermal_serve::connector::{
    ConnectorError, Inlet, Mapping, Outflow, ParameterRemark, Seen, Source, SourceWiring, Stop,
    WiredChannel,
};
use athermal_serve::deployment::Login;
use athermal_serve::register_source;
use schemars::JsonSchema;
use serde::Deserialize;
use tokio::runtime::Builder;

use crate::broker::{Broker, ClientId, Identity, Version, Way, keep_alive};
use crate::client::{Ended, Settings};
use crate::look::look;
use crate::session::Session;
use crate::subscriptions::Subscriptions;
use athermal_messages::gap::GapWatch;
use athermal_messages::left_out::LeftOutCounts;
use athermal_messages::message::{Messages, TimeForm};
use athermal_messages::payload::{Form, Time, Values};
use athermal_messages::topic::Topic;

/// Messages of an MQTT broker. Each is acknowledged once its values are in the journal, so that none is lost that a publisher with QoS 1
/// has sent, whatever ends in between.
///
/// The broker keeps a session under a fixed client id, `athermal-` and the names of machine and source. What it sends again is known
/// apart by the time of the value. A message that cannot be read is left out and counted.
#[derive(Debug, Deserialize, JsonSchema)]
pub struct MqttSource {
    /// The broker: "mqtt://HOST", with ":PORT" where it is not 1883, or "mqtts://HOST" with TLS.
    broker: Broker,
    /// The version of the protocol: "5" or "3.1.1". Without it 5, and 3.1.1 where the broker does not speak 5.
    #[serde(default)]
    version: Option<Version>,
    /// User and password.
    #[serde(default)]
    login: Option<Login>,
    /// With `mqtts://`: a file of certificates that the broker's own is judged by; those of the system without.
    #[serde(default)]
    authorities: Option<PathBuf>,
    /// With `mqtts://`: by what the broker knows this client, where it asks for that: { certificate = "…", key = "…" }, files of PEM.
    #[serde(default)]
    tls: Option<Identity>,
    /// Under which id the broker keeps the session, if not the usual one. No two clients may have one.
    #[serde(default)]
    client_id: Option<ClientId>,
    /// How long nothing may come until the broker is asked whether it is there.
    #[serde(default = "keep_alive")]
    #[schemars(extend("minimum" = 5, "maximum" = 65_535))]
    keep_alive: Duration,
    /// How many messages the broker may send that are not acknowledged. Only MQTT 5 asks the broker for it.
    #[serde(default = "receive_maximum")]
    #[schemars(range(min = 1))]
    receive_maximum: u16,
    /// When a message is acknowledged: once its values are "written" to the journal, which survives the end of the program, or "synced",
    /// which survives a power cut.
    #[serde(default)]
    ack: Ack,
    /// What becomes of messages that the broker keeps for its topics: "ignore", since they are not fresh, or "take", if they have a time.
    #[serde(default)]
    retained: Retained,
    /// Where messages have their time: { at = "/timestamp", unit = "ms" }, { at = "/time" } for a text of RFC 3339, or "arrival".
    #[serde(default)]
    time: Option<TimeForm>,
    /// Which topics give which channels.
    #[serde(default)]
    messages: Vec<Messages>,
}

register_source!(MqttSource, "mqtt");

/// When a message is acknowledged.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Ack {
    /// Once its values survive the end of the program.
    #[default]
    Written,
    /// Once they survive a power cut.
    Synced,
}

/// What becomes of retained messages.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Retained {
    /// They are left out.
    #[default]
    Ignore,
    /// They are taken as any other.
    Take,
}

fn receive_maximum() -> u16 {
    500
}

/// What is asked of the messages of some topics.
#[derive(Debug)]
pub(crate) struct Route {
    pub(crate) topic: Topic,
    pub(crate) form: Form,
}

impl MqttSource {
    fn way(&self) -> Way<'_> {
        Way {
            broker: &self.broker,
            authorities: self.authorities.as_ref(),
            identity: self.tls.as_ref(),
            login: self.login.as_ref(),
            client_id: self.client_id.as_ref(),
            keep_alive: self.keep_alive,
        }
    }

    fn settings(&self, wiring: &SourceWiring) -> Result<Settings, ConnectorError> {
        let settings = self
            .way()
            .settings(wiring.machine.as_deref(), &wiring.name, &wiring.folder);
        Ok(Settings {
            version: self.version.unwrap_or(Version::Five),
            receive_maximum: self.receive_maximum,
            ..settings.map_err(ConnectorError::new)?
        })
    }

    /// Messages whose values have the time of their arrival: doubtful, and a mistake where retained ones are taken.
    fn without_time(&self, at: Vec<String>, help: &str) -> ParameterRemark {
        let (is_mistake, words) = match self.retained {
            Retained::Ignore => (
                false,
                "what the broker sends again after an outage cannot be told apart from what is new",
            ),
            Retained::Take => (
                true,
                "a retained message without a time would be taken for a fresh one",
            ),
        };
        ParameterRemark {
            at,
            is_mistake,
            words: words.to_owned(),
            help: help.to_owned(),
        }
    }

    /// Its routes, for these channels.
    fn routes(&self, channels: &[WiredChannel]) -> Vec<Route> {
        let mut routes = Vec::new();
        // Mappings are counted through all messages.
        let mut before = 0;
        for messages in &self.messages {
            let count = messages.mappings(0).len();
            let of_these = channels.iter().enumerate().filter_map(|(nth, of)| {
                let own = of.mapped.as_ref()?.mapping.checked_sub(before)?;
                (own < count).then_some((nth, own, of))
            });
            let forms = messages.forms(self.time.as_ref(), &of_these.collect::<Vec<_>>());
            routes.extend(forms.into_iter().map(|(topic, form)| Route { topic, form }));
            before += count;
        }
        // What `channels` names is a topic whose messages are numbers.
        for (channel, of) in channels
            .iter()
            .enumerate()
            .filter(|(_, of)| of.mapped.is_none())
        {
            routes.push(Route {
                topic: Topic::new(&of.address, &[]),
                form: Form {
                    time: Time::Arrival,
                    sequence: None,
                    quality: None,
                    values: Values::Plain(channel),
                    instants: Box::default(),
                    flags: Box::default(),
                },
            });
        }
        let those = |is: &dyn Fn(&WiredChannel) -> bool| -> Box<[usize]> {
            let all = channels.iter().enumerate();
            all.filter(|(_, of)| is(of)).map(|(nth, _)| nth).collect()
        };
        let (instants, mappings) = (those(&|of| of.channel.is_instant), self.mappings());
        let flags = those(&|of| {
            let mapping = of.mapped.as_ref().and_then(|of| mappings.get(of.mapping));
            let unit = mapping.and_then(|of| of.unit.as_ref());
            let is_as_graph = unit.is_some() || of.conversion.is_none();
            is_as_graph && unit.unwrap_or(&of.unit).factor_to(&Unit::one()) == Some(1.0)
        });
        for route in &mut routes {
            route.form.instants.clone_from(&instants);
            route.form.flags.clone_from(&flags);
        }
        routes
    }
}

impl Source for MqttSource {
    fn needs_addresses(&self) -> bool {
        true
    }

    fn mappings(&self) -> Vec<Mapping> {
        let messages = self.messages.iter().enumerate();
        messages.flat_map(|(nth, of)| of.mappings(nth)).collect()
    }

    fn remarks(&self, addressed: usize) -> Vec<ParameterRemark> {
        let time = self.time.as_ref();
        let remark = |at: Vec<String>, is_mistake, words: String, help: &str| ParameterRemark {
            at,
            is_mistake,
            words,
            help: help.to_owned(),
        };
        let mut all = self.way().remarks();
        if let Some(why) = time.and_then(TimeForm::mistake) {
            let help = "write `time = { at = \"/timestamp\", unit = \"ms\" }`";
            all.push(remark(vec!["time".to_owned()], true, why, help));
        }
        for (nth, messages) in self.messages.iter().enumerate() {
            let own = ["messages".to_owned(), nth.to_string()];
            for (key, why) in messages.mistakes(time) {
                let help = "`athermal nodes mqtt` explains the keys of `messages`";
                all.push(remark([&own[..], &key].concat(), true, why, help));
            }
            if messages.is_stamped_at_arrival(time) {
                let help = "let the publisher add a time, and write where it stands: `time = { at = \"/time\" }`";
                let at = [&own[..], &["time".to_owned()]].concat();
                all.push(self.without_time(at, help));
            }
        }
        if addressed > 0 {
            let help = "the messages of `channels` are numbers without a time: let the publisher add one, and name them in `messages`";
            all.push(self.without_time(vec!["channels".to_owned()], help));
        }
        all
    }

    fn look(&self, wiring: SourceWiring, patience: Wait) -> Result<Vec<Seen>, ConnectorError> {
        let settings = self.settings(&wiring)?;
        let routes = self.routes(&wiring.channels);
        let seen = look(&settings, &routes, &wiring.channels, patience);
        seen.map_err(|why| ConnectorError::new(format_args!("{}: {why}", self.broker)))
    }

    fn open(&self, wiring: SourceWiring) -> Result<Box<dyn Inlet>, ConnectorError> {
        let settings = self.settings(&wiring)?;
        // That it cannot speak to such a broker is known before anything runs.
        crate::client::Connection::new(&settings).map_err(ConnectorError::new)?;
        let routes = self.routes(&wiring.channels);
        let wanted: BTreeSet<_> = routes
            .iter()
            .map(|of| of.topic.filter().to_owned())
            .collect();
        let (broker, id) = (settings.broker.to_string(), &settings.client_id);
        let newest = wiring.channels.iter().map(|of| of.after).max();
        Ok(Box::new(MqttInlet {
            subscriptions: Subscriptions::new(&broker, id, wanted, &wiring.state),
            is_version_open: self.version.is_none(),
            ack: self.ack,
            retained: self.retained,
            channels: wiring.channels.len(),
            routes,
            gaps: GapWatch::after(newest.filter(|of| *of > Instant::MIN)),
            left_out: LeftOutCounts::default(),
            take_overs: VecDeque::new(),
            is_stolen: false,
            settings,
        }))
    }
}

/// A source at work: what it knows from one connection to the next.
#[derive(Debug)]
pub(crate) struct MqttInlet {
    pub(crate) settings: Settings,
    is_version_open: bool,
    pub(crate) ack: Ack,
    pub(crate) retained: Retained,
    pub(crate) channels: usize,
    pub(crate) routes: Vec<Route>,
    pub(crate) subscriptions: Subscriptions,
    pub(crate) gaps: GapWatch,
    pub(crate) left_out: LeftOutCounts,
    /// When another client took the session over, or seems to have.
    take_overs: VecDeque<Clock>,
    is_stolen: bool,
}

/// So many take-overs in such a time are no accident, and are answered by so long a silence.
const STOLEN: (usize, Wait, Wait) = (3, Wait::from_secs(60), Wait::from_secs(60));

impl Inlet for MqttInlet {
    fn run(&mut self, out: &mut Outflow, stop: &Stop) -> Result<(), ConnectorError> {
        if std::mem::take(&mut self.is_stolen) && !stop.wait(STOLEN.2) {
            return Ok(());
        }
        let runtime = Builder::new_current_thread().enable_all().build();
        let runtime = runtime.map_err(|error| {
            ConnectorError::new(format_args!(
                "the system has no resources for a connection: {error}"
            ))
        })?;
        let mut session = Session::new(self, out, stop);
        let ended = runtime.block_on(session.run());
        let was_connected = session.was_connected;
        match ended {
            Ok(()) => Ok(()),
            Err(ended) => Err(self.failure(ended, was_connected)),
        }
    }
}

impl MqttInlet {
    /// Why a connection has ended, in words, and what follows from it for the next one.
    fn failure(&mut self, ended: Ended, was_connected: bool) -> ConnectorError {
        let broker = &self.settings.broker;
        if !was_connected {
            // A broker that was away is why connections ended before, and not another client.
            self.take_overs.clear();
        }
        let is_about_version =
            matches!(ended, Ended::Version(_) | Ended::Closed(_)) && !was_connected;
        if is_about_version && self.is_version_open {
            self.settings.version = match self.settings.version {
                Version::Five => Version::Three,
                Version::Three => Version::Five,
            };
        }
        let words = match ended {
            Ended::TakenOver => {
                self.take_overs.push_back(Clock::now());
                "another client has taken over its session".to_owned()
            }
            Ended::Closed(words) => {
                // Where it is still there, it was not its own end that ended the connection.
                if was_connected && broker.is_there() {
                    self.take_overs.push_back(Clock::now());
                }
                words
            }
            Ended::Version(words) | Ended::Other(words) => words,
        };
        while self
            .take_overs
            .front()
            .is_some_and(|of| of.elapsed() > STOLEN.1)
        {
            self.take_overs.pop_front();
        }
        if self.take_overs.len() < STOLEN.0 {
            return ConnectorError::new(format_args!("{broker}: {words}"));
        }
        self.take_overs.clear();
        self.is_stolen = true;
        let id = &self.settings.client_id;
        ConnectorError::new(format_args!(
            "{broker}: its session was ended {} times in a minute, as where two clients have the id `{id}`: give one of them another `client_id`; nothing is tried for a minute",
            STOLEN.0
        ))
    }
}
