//! Where a broker is and how one logs in: what source and sink have in common.

use std::fmt;
use std::net::{TcpStream, ToSocketAddrs};
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::time::Duration as Wait;

use athermal_core::node::Forms;
use athermal_core::time::Duration;
use athermal_serve::connector::ParameterRemark;
use schemars::JsonSchema;
use serde::de::Error as _;
use serde::{Deserialize, Deserializer};

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

/// A text that does not belong into a file that others read.
#[derive(Debug, Clone, PartialEq, Eq, JsonSchema)]
#[schemars(transparent)]
pub struct Secret(SecretPlace);

/// Where a text stands that does not belong into a file that others read.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct SecretPlace {
    /// A file with it, relative to the machine file; blanks and line ends around it do not count.
    #[serde(default)]
    file: Option<PathBuf>,
    /// A variable of the environment with it.
    #[serde(default)]
    env: Option<String>,
}

impl<'de> Deserialize<'de> for Secret {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let place = Forms::new("where it stands, { file = \"…\" } or { env = \"…\" }")
            .text(|_: String| None)
            .table(Some)
            .read(deserializer)?;
        place.map(Self).ok_or_else(|| {
            D::Error::custom(
                "a secret has no place in a file that others read: write `{ file = \"…\" }` with a file that has it, or \
                 `{ env = \"…\" }` with a variable of the environment; only the name of a user may stand here, as `name`",
            )
        })
    }
}

impl Secret {
    fn read(&self, folder: &Path) -> Result<String, String> {
        let SecretPlace { file, env } = &self.0;
        match (file, env) {
            (Some(file), None) => {
                let path = folder.join(file);
                let read = std::fs::read_to_string(&path);
                let text =
                    read.map_err(|error| format!("cannot read {}: {error}", path.display()))?;
                Ok(text.trim().to_owned())
            }
            (None, Some(name)) => std::env::var(name)
                .map_err(|_| format!("the environment has no variable `{name}` for the login")),
            _ => {
                Err("a secret of `login` is either { file = \"…\" } or { env = \"…\" }".to_owned())
            }
        }
    }
}

/// Who logs in.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Login {
    /// The name of the user; without it `user` says where it stands.
    #[serde(default)]
    name: Option<String>,
    /// Where the name of the user stands.
    #[serde(default)]
    user: Option<Secret>,
    /// Where the password stands: { file = "…" } or { env = "…" }. It has no place in the machine file itself.
    password: Secret,
}

impl Login {
    fn read(&self, folder: &Path) -> Result<(String, String), String> {
        let name = match (&self.name, &self.user) {
            (Some(name), None) => name.clone(),
            (None, Some(user)) => user.read(folder)?,
            _ => return Err("`login` needs either `name` or `user`".to_owned()),
        };
        Ok((name, self.password.read(folder)?))
    }
}

/// What is said of the way to a broker, by source and sink alike.
#[derive(Debug, Clone)]
pub struct Way<'a> {
    pub broker: &'a Broker,
    pub authorities: Option<&'a PathBuf>,
    pub identity: Option<&'a Identity>,
    pub login: Option<&'a Login>,
    pub client_id: Option<&'a ClientId>,
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

    #[test]
    fn a_password_comes_from_a_file_or_the_environment_and_from_nowhere_else() {
        let folder = std::env::temp_dir();
        let secret = |file: Option<&str>, env: Option<&str>| {
            Secret(SecretPlace {
                file: file.map(PathBuf::from),
                env: env.map(str::to_owned),
            })
        };
        let name = format!("athermal-mqtt-secret-{}", std::process::id());
        std::fs::write(folder.join(&name), " word \n").unwrap();
        assert_eq!(
            secret(Some(&name), None).read(&folder),
            Ok("word".to_owned())
        );
        std::fs::remove_file(folder.join(&name)).unwrap();
        assert!(secret(Some(&name), None).read(&folder).is_err());
        let path = std::env::var("PATH").unwrap();
        assert_eq!(secret(None, Some("PATH")).read(&folder), Ok(path));
        assert!(secret(None, None).read(&folder).is_err());
        assert!(secret(Some("a"), Some("b")).read(&folder).is_err());
    }

    #[test]
    fn a_password_in_clear_is_refused_with_the_way_to_write_it_and_without_the_password() {
        for text in [
            "password = \"w0rd\"",
            "user = \"w0rd\"\npassword = { env = \"P\" }",
        ] {
            let error = toml::from_str::<Login>(text).unwrap_err();
            let error = error.message();
            assert!(error.contains("{ file = \"…\" }"), "{error}");
            assert!(error.contains("{ env = \"…\" }"), "{error}");
            assert!(!error.contains("w0rd"), "{error}");
        }
        let login = "name = \"me\"\npassword = { env = \"P\" }";
        assert!(toml::from_str::<Login>(login).is_ok());
        let error = toml::from_str::<Login>("name = \"me\"\npassword = 7").unwrap_err();
        assert!(error.message().contains("{ file = "), "{error}");
    }
}
