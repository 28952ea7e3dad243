//! One connection to a broker, of either version of the protocol. No other module knows the crate that speaks it.
//!
//! A connection lives from its CONNECT to its end; the next one is another [`Connection`]. So nothing of the one before is left: no
//! acknowledgement of a number that has become void, and no command that has become old.

use std::time::Duration;

use rumqttc::v5::mqttbytes::v5 as five;
use rumqttc::{mqttbytes as three, v5};

use crate::broker::{Broker, Version};

/// No packet is refused for its size: one that could not be read would come again with each connection, and nothing behind it.
const LARGEST: usize = 268_435_455;
/// How many packets may wait to be sent.
const REQUESTS: usize = 8192;
/// How many of them may be without an answer.
const IN_FLIGHT: u16 = 1000;

/// What a connection is made of.
#[derive(Debug, Clone)]
pub struct Settings {
    /// Where the broker is.
    pub broker: Broker,
    /// Which version is spoken.
    pub version: Version,
    /// By what the broker knows the client, and its session.
    pub client_id: String,
    /// User and password.
    pub login: Option<(String, String)>,
    /// After how long without a packet the broker is asked whether it is there.
    pub keep_alive: Duration,
    /// How many messages the broker may send that are not acknowledged.
    pub receive_maximum: u16,
    /// Whether the broker is to keep what comes while the client is away.
    pub keeps_session: bool,
    /// What the broker publishes where the client is gone without leave.
    pub last_will: Option<Will>,
}

/// What a broker publishes for a client that is gone, once at least.
#[derive(Debug, Clone)]
pub struct Will {
    /// Its topic.
    pub topic: String,
    /// What it says.
    pub payload: Vec<u8>,
    /// Whether the broker keeps it for whoever comes later.
    pub is_retained: bool,
}

/// What comes of a connection.
#[derive(Debug)]
pub enum Event {
    /// The broker takes the client, and has its session or not.
    Connected {
        /// Whether the broker had kept the session.
        session_present: bool,
    },
    /// A message.
    Message(Message),
    /// Subscriptions were sent under this number…
    SubscribeSent(u16),
    /// …and are answered, one by one in their order: with the QoS that is granted, or why not.
    Subscribed(u16, Vec<Result<u8, String>>),
    /// The same of the ends of subscriptions.
    UnsubscribeSent(u16),
    /// They have ended.
    Unsubscribed(u16),
    /// A message was sent under this number…
    PublishSent(u16),
    /// …and the broker has it, or does not want it.
    Published(u16, Result<(), String>),
    /// Nothing of interest.
    Other,
}

/// A message of a broker.
#[derive(Debug, Clone)]
pub struct Message {
    /// Its topic.
    pub topic: String,
    /// What it says.
    pub payload: Vec<u8>,
    /// Whether it is the one that the broker keeps of the topic, and not one that has just been published.
    pub is_retained: bool,
    /// Under what it is acknowledged; none where it needs none.
    pub packet: Option<u16>,
}

/// Why a connection has ended.
#[derive(Debug)]
pub enum Ended {
    /// Another client has connected with the same id.
    TakenOver,
    /// The broker does not speak this version, or so it seems.
    Version(String),
    /// The broker has closed the connection without a reason.
    Closed(String),
    /// Anything else.
    Other(String),
}

/// A connection to a broker. It is polled by [`next`](Self::next) alone.
#[allow(missing_debug_implementations)] // the crate has none of it
pub enum Connection {
    /// Of MQTT 3.1.1.
    Three(rumqttc::AsyncClient, Box<rumqttc::EventLoop>),
    /// Of MQTT 5.
    Five(v5::AsyncClient, Box<v5::EventLoop>),
}

/// Sends on a connection, without waiting.
#[derive(Debug, Clone)]
pub enum Sender {
    /// Of MQTT 3.1.1.
    Three(rumqttc::AsyncClient),
    /// Of MQTT 5.
    Five(v5::AsyncClient),
}

impl Connection {
    /// Nothing is connected before [`next`](Self::next) is asked.
    ///
    /// # Errors
    /// When this program cannot speak to such a broker.
    pub fn new(settings: &Settings) -> Result<Self, String> {
        match settings.version {
            Version::Three => Self::three(settings),
            Version::Five => Self::five(settings),
        }
    }

    fn three(settings: &Settings) -> Result<Self, String> {
        let broker = &settings.broker;
        let mut options =
            rumqttc::MqttOptions::new(&settings.client_id, broker.host.clone(), broker.port);
        options
            .set_keep_alive(settings.keep_alive)
            .set_clean_session(!settings.keeps_session)
            .set_manual_acks(true)
            .set_inflight(IN_FLIGHT)
            .set_max_packet_size(LARGEST, LARGEST);
        if let Some((name, password)) = &settings.login {
            options.set_credentials(name, password);
        }
        if let Some(Will {
            topic,
            payload,
            is_retained,
        }) = &settings.last_will
        {
            let will = rumqttc::LastWill::new(
                topic,
                payload.as_slice(),
                three::QoS::AtLeastOnce,
                *is_retained,
            );
            options.set_last_will(will);
        }
        if broker.is_secure {
            options.set_transport(secure(broker)?);
        }
        let (client, mut events) = rumqttc::AsyncClient::new(options, REQUESTS);
        let mut network = rumqttc::NetworkOptions::new();
        network.set_tcp_nodelay(true);
        network.set_connection_timeout(5);
        events.set_network_options(network);
        Ok(Self::Three(client, Box::new(events)))
    }

    fn five(settings: &Settings) -> Result<Self, String> {
        let broker = &settings.broker;
        let mut options =
            v5::MqttOptions::new(&settings.client_id, broker.host.clone(), broker.port);
        let mut network = rumqttc::NetworkOptions::new();
        network.set_tcp_nodelay(true);
        options
            .set_keep_alive(settings.keep_alive)
            .set_clean_start(!settings.keeps_session)
            .set_manual_acks(true)
            .set_outgoing_inflight_upper_limit(IN_FLIGHT)
            .set_connection_timeout(5)
            .set_network_options(network)
            .set_receive_maximum(Some(settings.receive_maximum))
            .set_max_packet_size(Some(LARGEST as u32))
            // The broker keeps the session for ever, or as long as it keeps any.
            .set_session_expiry_interval(Some(if settings.keeps_session { u32::MAX } else { 0 }));
        if let Some((name, password)) = &settings.login {
            options.set_credentials(name, password);
        }
        if let Some(Will {
            topic,
            payload,
            is_retained,
        }) = &settings.last_will
        {
            let qos = v5::mqttbytes::QoS::AtLeastOnce;
            let will = five::LastWill::new(topic, payload.clone(), qos, *is_retained, None);
            options.set_last_will(will);
        }
        if broker.is_secure {
            options.set_transport(secure(broker)?);
        }
        let (client, events) = v5::AsyncClient::new(options, REQUESTS);
        Ok(Self::Five(client, Box::new(events)))
    }

    /// What sends on it.
    pub fn sender(&self) -> Sender {
        match self {
            Self::Three(client, _) => Sender::Three(client.clone()),
            Self::Five(client, _) => Sender::Five(client.clone()),
        }
    }

    /// What comes next. Not to be given up before it is there: a connection that is being made would be given up with it.
    ///
    /// # Errors
    /// Why the connection has ended. There is no other one behind it.
    pub async fn next(&mut self) -> Result<Event, Ended> {
        match self {
            Self::Three(_, events) => match events.poll().await {
                Ok(event) => Ok(event_of_three(event)),
                Err(error) => Err(ended_three(&error)),
            },
            Self::Five(_, events) => match events.poll().await {
                Ok(event) => Ok(event_of_five(event)),
                Err(error) => Err(ended_five(&error)),
            },
        }
    }
}

#[cfg(feature = "tls")]
fn secure(broker: &Broker) -> Result<rumqttc::Transport, String> {
    crate::tls::transport(broker)
}

#[cfg(not(feature = "tls"))]
fn secure(broker: &Broker) -> Result<rumqttc::Transport, String> {
    let words = crate::broker::without_tls(broker);
    Err(format!(
        "{words}: build it with the feature `tls`, as release archives are"
    ))
}

fn event_of_three(event: rumqttc::Event) -> Event {
    use rumqttc::{Outgoing, Packet};
    match event {
        rumqttc::Event::Outgoing(Outgoing::Subscribe(packet)) => Event::SubscribeSent(packet),
        rumqttc::Event::Outgoing(Outgoing::Unsubscribe(packet)) => Event::UnsubscribeSent(packet),
        rumqttc::Event::Outgoing(Outgoing::Publish(packet)) => Event::PublishSent(packet),
        rumqttc::Event::Outgoing(_) => Event::Other,
        rumqttc::Event::Incoming(packet) => match packet {
            Packet::ConnAck(of) => Event::Connected {
                session_present: of.session_present,
            },
            Packet::Publish(of) => Event::Message(Message {
                packet: (of.qos != three::QoS::AtMostOnce).then_some(of.pkid),
                is_retained: of.retain,
                payload: of.payload.to_vec(),
                topic: of.topic,
            }),
            Packet::SubAck(of) => {
                let codes = of.return_codes.iter().map(|code| match code {
                    rumqttc::SubscribeReasonCode::Success(qos) => Ok(*qos as u8),
                    rumqttc::SubscribeReasonCode::Failure => Err("refused".to_owned()),
                });
                Event::Subscribed(of.pkid, codes.collect())
            }
            Packet::UnsubAck(of) => Event::Unsubscribed(of.pkid),
            Packet::PubAck(of) => Event::Published(of.pkid, Ok(())),
            _ => Event::Other,
        },
    }
}

fn event_of_five(event: v5::Event) -> Event {
    use five::{Packet, PubAckReason};
    use rumqttc::Outgoing;
    match event {
        v5::Event::Outgoing(Outgoing::Subscribe(packet)) => Event::SubscribeSent(packet),
        v5::Event::Outgoing(Outgoing::Unsubscribe(packet)) => Event::UnsubscribeSent(packet),
        v5::Event::Outgoing(Outgoing::Publish(packet)) => Event::PublishSent(packet),
        v5::Event::Outgoing(_) => Event::Other,
        v5::Event::Incoming(packet) => match packet {
            Packet::ConnAck(of) => Event::Connected {
                session_present: of.session_present,
            },
            Packet::Publish(of) => Event::Message(Message {
                packet: (of.qos != v5::mqttbytes::QoS::AtMostOnce).then_some(of.pkid),
                is_retained: of.retain,
                payload: of.payload.to_vec(),
                topic: String::from_utf8_lossy(&of.topic).into_owned(),
            }),
            Packet::SubAck(of) => {
                let codes = of.return_codes.iter().map(|code| match code {
                    five::SubscribeReasonCode::Success(qos) => Ok(*qos as u8),
                    code => Err(format!("{code:?}")),
                });
                Event::Subscribed(of.pkid, codes.collect())
            }
            Packet::UnsubAck(of) => Event::Unsubscribed(of.pkid),
            Packet::PubAck(of) => {
                let is_taken = matches!(
                    of.reason,
                    PubAckReason::Success | PubAckReason::NoMatchingSubscribers
                );
                let taken = is_taken.then_some(()).ok_or(format!("{:?}", of.reason));
                Event::Published(of.pkid, taken)
            }
            _ => Event::Other,
        },
    }
}

fn ended_three(error: &rumqttc::ConnectionError) -> Ended {
    use rumqttc::{ConnectReturnCode, ConnectionError, StateError};
    let words = error.to_string();
    match error {
        ConnectionError::ConnectionRefused(ConnectReturnCode::RefusedProtocolVersion) => {
            Ended::Version(words)
        }
        ConnectionError::MqttState(StateError::ConnectionAborted) => Ended::Closed(words),
        ConnectionError::MqttState(StateError::Io(_)) => Ended::Closed(words),
        _ => Ended::Other(words),
    }
}

fn ended_five(error: &v5::ConnectionError) -> Ended {
    use five::{ConnectReturnCode, DisconnectReasonCode};
    use v5::{ConnectionError, StateError};
    let words = error.to_string();
    match error {
        ConnectionError::ConnectionRefused(
            ConnectReturnCode::RefusedProtocolVersion
            | ConnectReturnCode::UnsupportedProtocolVersion,
        )
        | ConnectionError::NotConnAck(_)
        | ConnectionError::MqttState(StateError::Deserialization(_)) => Ended::Version(words),
        ConnectionError::MqttState(StateError::ServerDisconnect { reason_code, .. })
            if *reason_code == DisconnectReasonCode::SessionTakenOver =>
        {
            Ended::TakenOver
        }
        ConnectionError::MqttState(StateError::ConnectionAborted | StateError::Io(_)) => {
            Ended::Closed(words)
        }
        _ => Ended::Other(words),
    }
}

impl Sender {
    /// Acknowledges a message; false where so many packets wait that it has to be tried again.
    pub fn acknowledge(&self, packet: u16) -> bool {
        match self {
            Self::Three(client) => {
                let mut of = rumqttc::Publish::new("", three::QoS::AtLeastOnce, "");
                of.pkid = packet;
                client.try_ack(&of).is_ok()
            }
            Self::Five(client) => {
                let qos = v5::mqttbytes::QoS::AtLeastOnce;
                let mut of = five::Publish::new("", qos, "", None);
                of.pkid = packet;
                client.try_ack(&of).is_ok()
            }
        }
    }

    /// Asks for all that is published under some topics, once or more often.
    pub fn subscribe(&self, filters: &[String]) -> bool {
        let filters = filters.iter().cloned();
        match self {
            Self::Three(client) => {
                let of = |path| rumqttc::SubscribeFilter::new(path, three::QoS::AtLeastOnce);
                client.try_subscribe_many(filters.map(of)).is_ok()
            }
            Self::Five(client) => {
                let of = |path| five::Filter::new(path, v5::mqttbytes::QoS::AtLeastOnce);
                client.try_subscribe_many(filters.map(of)).is_ok()
            }
        }
    }

    /// Asks for no more of it.
    pub fn unsubscribe(&self, filter: &str) -> bool {
        match self {
            Self::Three(client) => client.try_unsubscribe(filter).is_ok(),
            Self::Five(client) => client.try_unsubscribe(filter).is_ok(),
        }
    }

    /// Publishes; false where so many packets wait that it has to be tried again.
    pub fn publish(&self, topic: &str, is_safe: bool, is_retained: bool, payload: &[u8]) -> bool {
        match self {
            Self::Three(client) => {
                let qos = if is_safe {
                    three::QoS::AtLeastOnce
                } else {
                    three::QoS::AtMostOnce
                };
                client.try_publish(topic, qos, is_retained, payload).is_ok()
            }
            Self::Five(client) => {
                let qos = if is_safe {
                    v5::mqttbytes::QoS::AtLeastOnce
                } else {
                    v5::mqttbytes::QoS::AtMostOnce
                };
                let payload = payload.to_vec();
                client.try_publish(topic, qos, is_retained, payload).is_ok()
            }
        }
    }

    /// Takes leave of the broker, which then publishes no last will.
    pub fn disconnect(&self) -> bool {
        match self {
            Self::Three(client) => client.try_disconnect().is_ok(),
            Self::Five(client) => client.try_disconnect().is_ok(),
        }
    }
}
