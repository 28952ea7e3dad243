//! `mqtt` as a sink: what a machine file says of it.

use std::path::PathBuf;

use athermal_core::time::Duration;
use athermal_serve::connector::{
    ConnectorError, Kept, Messages, OpensMessages, OutRow, Outlet, ParameterRemark, Place, Purpose,
    Sink, SinkWiring,
};
use athermal_serve::deployment::{Login, Size};
use athermal_serve::register_sink;
use schemars::JsonSchema;
use serde::Deserialize;

use crate::broker::{Broker, ClientId, Identity, Version, Way, keep_alive};
use crate::client::{Connection, Settings, Will};
use crate::outgoing::{Form, Outgoing};
use crate::publisher::{Manner, Publisher};
use athermal_messages::topic;

/// Outputs as messages of an MQTT broker: one for each output, or one for each tick.
///
/// Without `spool` it is a command: only what is recent is published, and nothing later that could not be published at once. With a
/// `spool` it is a log: what cannot be published waits, and every tick is published at least once, in order, also after a restart.
/// Whether the service lives is published beside it, and by the broker as a last will where it does not.
#[derive(Debug, Deserialize, JsonSchema)]
pub struct MqttSink {
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
    /// The client id, if not the usual one: `athermal-`, the names of machine and sink, and `-sink`. No two clients may have one.
    #[serde(default)]
    client_id: Option<ClientId>,
    /// How long nothing may come until the broker is asked whether it is there.
    #[serde(default = "keep_alive")]
    #[schemars(extend("minimum" = 5, "maximum" = 65_535))]
    keep_alive: Duration,
    /// The topic: with `{output}` in it one for each output, such as "machine/drift/{output}"; without, a tick is one message.
    topic: String,
    /// The quality of service: 0 is sent once and perhaps lost, 1 until the broker has it.
    #[serde(default = "one")]
    #[schemars(range(max = 1))]
    qos: u8,
    /// Whether the broker keeps the last message for whoever comes later.
    #[serde(default)]
    retain: bool,
    /// How much may wait for a broker that is away; "0 B" for commands.
    #[serde(default = "nothing")]
    spool: Size,
    /// Under which topic it says that it lives: a number that grows. Without it `client_id`, or "athermal-MACHINE-SINK", and "/alive".
    #[serde(default)]
    alive: Option<String>,
    /// How often it says so.
    #[serde(default = "second")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    every: Duration,
}

register_sink!(MqttSink, "mqtt");

fn one() -> u8 {
    1
}

fn nothing() -> Size {
    Size(0)
}

const fn second() -> Duration {
    Duration::from_ns(1_000_000_000)
}

impl MqttSink {
    /// What a connection is made of, without a last will.
    fn settings(&self, wiring: &SinkWiring) -> Result<Settings, ConnectorError> {
        let way = self.way();
        let settings = way.settings(wiring.machine.as_deref(), &wiring.name, &wiring.folder);
        Ok(Settings {
            version: self.version.unwrap_or(Version::Five),
            // What waits is kept here: nothing is left of a connection that has ended.
            keeps_session: false,
            ..settings.map_err(ConnectorError::new)?
        })
    }

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
}

impl Sink for MqttSink {
    fn purpose(&self) -> Purpose {
        match self.spool.0 {
            0 => Purpose::Command,
            _ => Purpose::Log,
        }
    }

    fn remarks(&self) -> Vec<ParameterRemark> {
        let topics = [("topic", Some(&self.topic)), ("alive", self.alive.as_ref())];
        let mistake = |(key, text): (&str, Option<&String>)| {
            let text = text?;
            let many = text.split('/').any(|of| matches!(of, "+" | "#"));
            let many =
                many.then(|| "it is published under one topic, and not under many".to_owned());
            let shared = topic::is_shared(text).then(|| {
                "a shared subscription is of a source: nothing is published under it".to_owned()
            });
            let words = topic::mistake(text).or(many).or(shared)?;
            Some(ParameterRemark {
                at: vec![key.to_owned()],
                is_mistake: true,
                words,
                help: "write a topic such as \"machine/drift/{output}\"".to_owned(),
            })
        };
        let mut all = self.way().remarks();
        all.extend(topics.into_iter().filter_map(mistake));
        all
    }

    fn open(&self, wiring: SinkWiring) -> Result<Box<dyn Outlet>, ConnectorError> {
        let mut settings = self.settings(&wiring)?;
        let alive = self.alive.clone();
        let alive = alive.unwrap_or_else(|| format!("{}/alive", settings.client_id));
        // A source may have the same name, and each has a session of its own.
        if self.client_id.is_none() {
            settings.client_id += "-sink";
        }
        settings.last_will = Some(Will {
            topic: alive.clone(),
            payload: b"{\"alive\":false}".to_vec(),
            is_retained: true,
        });
        Connection::new(&settings).map_err(ConnectorError::new)?;
        let is_command = self.purpose() == Purpose::Command;
        let manner = Manner {
            is_safe: self.qos == 1,
            is_retained: self.retain,
            spool: self.spool.0,
            is_command,
            alive: Some(alive),
            every: self.every,
            is_version_open: self.version.is_none(),
            retry: wiring.retry,
        };
        Ok(Box::new(MqttOutlet {
            form: Form::new(&self.topic, wiring.outputs),
            publisher: Publisher::start(settings, manner)?,
            messages: Vec::new(),
        }))
    }

    fn messages(&self) -> Option<&dyn OpensMessages> {
        Some(self)
    }
}

impl OpensMessages for MqttSink {
    fn open(
        &self,
        wiring: &SinkWiring,
        suffix: &str,
        topic: &str,
    ) -> Result<Box<dyn Messages>, ConnectorError> {
        if let Some(words) = topic::mistake(topic) {
            return Err(ConnectorError::new(format_args!(
                "topic \"{topic}\": {words}"
            )));
        }
        let mut settings = self.settings(wiring)?;
        settings.client_id += suffix;
        let manner = Manner {
            is_safe: true,
            is_retained: false,
            spool: u64::MAX,
            is_command: false,
            alive: None,
            every: self.every,
            is_version_open: self.version.is_none(),
            retry: wiring.retry,
        };
        Ok(Box::new(MqttMessages {
            topic: topic.to_owned(),
            publisher: Publisher::start(settings, manner)?,
            waiting: None,
        }))
    }
}

/// Messages beside the rows, until the broker has each.
struct MqttMessages {
    topic: String,
    publisher: Publisher,
    /// What was put and may not be there yet.
    waiting: Option<String>,
}

impl Messages for MqttMessages {
    fn send(&mut self, text: &str) -> Result<(), ConnectorError> {
        // The same text that is sent again waits already.
        if self.waiting.as_deref() != Some(text) {
            let message = Outgoing {
                topic: self.topic.clone(),
                payload: text.as_bytes().to_vec(),
                ends_row: true,
            };
            self.publisher.put(&mut vec![message])?;
            self.waiting = Some(text.to_owned());
        }
        if let Err(waits) = self.publisher.drained() {
            return Err(self.publisher.state().err().unwrap_or(waits));
        }
        self.waiting = None;
        Ok(())
    }
}

/// A sink at work.
struct MqttOutlet {
    form: Form,
    publisher: Publisher,
    messages: Vec<Outgoing>,
}

impl Outlet for MqttOutlet {
    fn put(&mut self, row: &OutRow<'_>) -> Result<(), ConnectorError> {
        self.messages.clear();
        self.form.messages(row, &mut self.messages);
        self.publisher.put(&mut self.messages)
    }

    fn state(&mut self) -> Result<(), ConnectorError> {
        self.publisher.state()
    }

    fn held(&self) -> u64 {
        self.publisher.rows()
    }

    fn kept(&mut self) -> Option<&mut dyn Kept> {
        self.publisher.keeps().then_some(self)
    }
}

/// A broker cannot be asked which rows it has: those behind the last place that was kept are published again.
impl Kept for MqttOutlet {
    fn end(&mut self) -> Result<Place, ConnectorError> {
        self.publisher.drained()?;
        Ok(Place::default())
    }

    fn rows_after(&mut self, _: Place) -> Result<Option<u64>, ConnectorError> {
        Ok(Some(0))
    }

    fn cut(&mut self, _: Place, _: u64) -> Result<(), ConnectorError> {
        Ok(())
    }
}
