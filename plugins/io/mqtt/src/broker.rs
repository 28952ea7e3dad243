//! Where a broker is and how one logs in: what source and sink have in common.

use std::fmt;
use std::net::{TcpStream, ToSocketAddrs};
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::time::Duration as Wait;

use athermal_core::time::Duration;
use athermal_serve::connector::ParameterRemark;
use athermal_serve::deployment::Login;
use schemars::JsonSchema;
use serde::Deserialize;

use crate::client::Settings;

/// Where a broker is.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(try_from = "String")]
#[schemars(with = "String")]
pub struct Broker {
    /// Its name or address.
    pub host: String,
    /// Its port.
    pub port: u16,
    /// Whether TLS is spoken.
    pub is_secure: bool,
    /// The certificates that its own is judged by; those of the system without.
    #[serde(skip)]
    pub authorities: Option<PathBuf>,
    /// By what it knows the client, where it asks for that.
    #[serde(skip)]
    pub identity: Option<Identity>,
}

/// By what a broker knows a client that has a certificate.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Identity {
    /// The file with the certificate, and those of the authorities between it and the one that the broker knows.
    pub certificate: PathBuf,
    /// The file with its key, which only the service's user reads.
    pub key: PathBuf,
}

impl TryFrom<String> for Broker {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        text.parse()
    }
}

impl FromStr for Broker {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = |why: &str| {
            format!(
                "\"{text}\" is no broker: {why}; write \"mqtt://HOST\", or \"mqtt://HOST:PORT\", or \"mqtts://…\""
            )
        };
        let (scheme, rest) = text.split_once("://").ok_or(wrong("it has no `mqtt://`"))?;
        let is_secure = match scheme {
            "mqtt" => false,
            "mqtts" => true,
            _ => return Err(wrong("it is spoken to by another protocol")),
        };
        let rest = rest.strip_suffix('/').unwrap_or(rest);
        if rest.contains('@') {
            let why = "a user or password has no place in it: they are given by `login`";
            return Err(wrong(why));
        }
        if rest.contains(['/', '?', '#']) {
            return Err(wrong("there is more behind the port"));
        }
        let usual = if is_secure { 8883 } else { 1883 };
        // An address of version 6 stands in brackets.
        let (host, port) = match rest.rsplit_once(':') {
            Some((host, port)) if !port.ends_with(']') => (
                host,
                port.parse().map_err(|_| wrong("its port is no number"))?,
            ),
            _ => (rest, usual),
        };
        if host.is_empty() {
            return Err(wrong("it has no host"));
        }
        Ok(Self {
            host: host.to_owned(),
            port,
            is_secure,
            authorities: None,
            identity: None,
        })
    }
}

impl Broker {
    /// Whether somebody listens there.
    pub fn is_there(&self) -> bool {
        let host = self.host.trim_matches(['[', ']']);
        let found = (host, self.port).to_socket_addrs();
        let mut addresses = found.into_iter().flatten();
        addresses.any(|of| TcpStream::connect_timeout(&of, Wait::from_secs(1)).is_ok())
    }
}

impl fmt::Display for Broker {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let scheme = if self.is_secure { "mqtts" } else { "mqtt" };
        write!(f, "{scheme}://{}:{}", self.host, self.port)
    }
}

/// By what a broker knows a client.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(try_from = "String")]
#[schemars(with = "String")]
pub struct ClientId(String);

impl TryFrom<String> for ClientId {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        match text.len() {
            0 => Err(
                "a client id is never empty: leave it out, and the usual one is taken".to_owned(),
            ),
            1..=65_535 if !text.contains('\0') => Ok(Self(text)),
            length => Err(format!(
                "a client id is a text of up to 65,535 bytes without NUL; this one has {length}"
            )),
        }
    }
}

/// A version of the protocol.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
pub enum Version {
    /// MQTT 3.1.1.
    #[serde(rename = "3.1.1")]
    Three,
    /// MQTT 5.
    #[serde(rename = "5")]
    Five,
}

/// What is said of the way to a broker, by source and sink alike.
#[derive(Debug, Clone)]
pub struct Way<'a> {
    /// Where it is.
    pub broker: &'a Broker,
    /// The certificates that its own is judged by.
    pub authorities: Option<&'a PathBuf>,
    /// By what it knows the client.
    pub identity: Option<&'a Identity>,
    /// User and password.
    pub login: Option<&'a Login>,
    /// The client id, if not the usual one.
    pub client_id: Option<&'a ClientId>,
    /// After how long without a packet it is asked whether it is there.
    pub keep_alive: Duration,
}

impl Way<'_> {
    /// What is wrong with it, before anything runs.
    pub fn remarks(&self) -> Vec<ParameterRemark> {
        let (is_secure, mut all) = (self.broker.is_secure, Vec::new());
        let mut mistake = |at: &str, words: String, help: &str| {
            all.push(ParameterRemark {
                at: vec![at.to_owned()],
                is_mistake: true,
                words,
                help: help.to_owned(),
            });
        };
        if is_secure && !cfg!(feature = "tls") {
            let help = "take a program that has TLS, as release archives and the Debian package do, or build it with `--features tls`";
            mistake("broker", without_tls(self.broker), help);
        }
        if self.identity.is_some() && !is_secure {
            let words = format!(
                "a certificate of the client is of TLS, and {} is spoken to without",
                self.broker
            );
            let help = "write `mqtts://` in place of `mqtt://`, or leave `tls` out";
            mistake("tls", words, help);
        }
        all
    }

    /// What a connection is made of, for a source or sink of this name on a machine.
    ///
    /// # Errors
    /// When a secret cannot be read.
    pub fn settings(
        &self,
        machine: Option<&str>,
        name: &str,
        folder: &Path,
    ) -> Result<Settings, String> {
        let mut broker = self.broker.clone();
        broker.authorities = self.authorities.map(|path| folder.join(path));
        broker.identity = self.identity.map(|of| Identity {
            certificate: folder.join(&of.certificate),
            key: folder.join(&of.key),
        });
        let own = match machine {
            Some(machine) => format!("athermal-{machine}-{name}"),
            None => format!("athermal-{name}"),
        };
        Ok(Settings {
            broker,
            version: Version::Five,
            client_id: self.client_id.map_or(own, |of| of.0.clone()),
            login: self.login.map(|login| login.read(folder)).transpose()?,
            keep_alive: Wait::from_nanos(self.keep_alive.as_ns().max(0) as u64),
            receive_maximum: u16::MAX,
            keeps_session: true,
            last_will: None,
        })
    }
}

/// That a program speaks no TLS.
pub fn without_tls(broker: &Broker) -> String {
    format!("{broker} asks for TLS, and this program was built without it")
}

/// Ten seconds: a broker that is gone is noticed within twice of it.
pub const fn keep_alive() -> Duration {
    Duration::from_ns(10_000_000_000)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_broker_has_a_scheme_a_host_and_the_usual_port() {
        let of = |text: &str| {
            text.parse::<Broker>()
                .map(|of| (of.host, of.port, of.is_secure))
        };
        assert_eq!(of("mqtt://plant"), Ok(("plant".to_owned(), 1883, false)));
        assert_eq!(of("mqtts://plant/"), Ok(("plant".to_owned(), 8883, true)));
        assert_eq!(of("mqtt://[::1]"), Ok(("[::1]".to_owned(), 1883, false)));
        assert_eq!(of("mqtt://[::1]:7"), Ok(("[::1]".to_owned(), 7, false)));
    }

    #[test]
    fn what_is_no_broker_is_refused_and_a_password_in_clear_too() {
        for (text, why) in [
            ("plant", "no `mqtt://`"),
            ("http://plant", "another protocol"),
            ("mqtt://", "no host"),
            ("mqtt://plant:x", "no number"),
            ("mqtt://me:secret@plant", "`login`"),
            ("mqtt://plant/topic", "behind the port"),
        ] {
            let error = text.parse::<Broker>().expect_err(text);
            assert!(error.contains(why), "{error}");
        }
    }

    #[test]
    fn a_client_id_is_no_empty_text_and_none_that_the_protocol_cannot_carry() {
        let of = |text: String| ClientId::try_from(text).map(|of| of.0);
        assert_eq!(of("me".to_owned()), Ok("me".to_owned()));
        for text in [String::new(), "a\0b".to_owned(), "a".repeat(65_536)] {
            assert!(of(text).is_err());
        }
    }
}
