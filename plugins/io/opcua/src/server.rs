//! Where a server is, how one logs in, and how its messages are secured: what source and sink have in common.

use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::time::Duration as Wait;

use athermal_serve::connector::ParameterRemark;
use athermal_serve::deployment::Login;
use opcua::crypto::SecurityPolicy;
use opcua::types::MessageSecurityMode;
use schemars::JsonSchema;
use serde::Deserialize;

/// Where a server is.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(try_from = "String")]
#[schemars(with = "String")]
pub struct Server {
    /// The whole address, with its port.
    pub url: String,
    /// Its name or address alone.
    pub host: String,
}

impl TryFrom<String> for Server {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        text.parse()
    }
}

impl FromStr for Server {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = |why: &str| {
            format!(
                "\"{text}\" is no server: {why}; write \"opc.tcp://HOST\", or \"opc.tcp://HOST:PORT\", with a path where it has one"
            )
        };
        let rest = text.strip_prefix("opc.tcp://");
        let rest = rest.ok_or(wrong("it has no `opc.tcp://`"))?;
        let (place, path) = rest.split_at(rest.find('/').unwrap_or(rest.len()));
        if place.contains('@') {
            let why = "a user or password has no place in it: they are given by `login`";
            return Err(wrong(why));
        }
        // An address of version 6 stands in brackets.
        let (host, port) = match place.rsplit_once(':') {
            Some((host, port)) if !port.ends_with(']') => {
                let port: Result<u16, _> = port.parse();
                (host, port.map_err(|_| wrong("its port is no number"))?)
            }
            _ => (place, 4840),
        };
        if host.is_empty() || host.contains(|of: char| of.is_whitespace() || of.is_control()) {
            return Err(wrong("it has no host"));
        }
        Ok(Self {
            url: format!("opc.tcp://{host}:{port}{path}"),
            host: host.trim_matches(['[', ']']).to_owned(),
        })
    }
}

impl fmt::Display for Server {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.url)
    }
}

/// How messages are signed and encrypted.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, JsonSchema)]
pub enum Security {
    /// Not at all: whoever is in the network can read and change what is sent.
    #[default]
    #[serde(rename = "none", alias = "None")]
    None,
    /// The policy that most servers have.
    Basic256Sha256,
    /// A newer one.
    #[serde(rename = "Aes128_Sha256_RsaOaep")]
    Aes128,
    /// The strictest one.
    #[serde(rename = "Aes256_Sha256_RsaPss")]
    Aes256,
}

impl Security {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::None, Self::Basic256Sha256, Self::Aes128, Self::Aes256];

    /// As the crate that speaks the protocol calls it.
    pub fn policy(self) -> SecurityPolicy {
        match self {
            Self::None => SecurityPolicy::None,
            Self::Basic256Sha256 => SecurityPolicy::Basic256Sha256,
            Self::Aes128 => SecurityPolicy::Aes128Sha256RsaOaep,
            Self::Aes256 => SecurityPolicy::Aes256Sha256RsaPss,
        }
    }

    /// As a machine file writes it.
    pub fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Basic256Sha256 => "Basic256Sha256",
            Self::Aes128 => "Aes128_Sha256_RsaOaep",
            Self::Aes256 => "Aes256_Sha256_RsaPss",
        }
    }
}

impl FromStr for Security {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let found = Self::ALL.into_iter().find(|of| of.name() == text);
        let known = Self::ALL.map(Self::name).join(", ");
        found.ok_or_else(|| format!("`{text}` is no policy: write one of {known}"))
    }
}

/// Whether messages are encrypted too.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Mode {
    /// They are signed and encrypted.
    #[default]
    SignAndEncrypt,
    /// They are only signed: nobody can change them, and all can read.
    Sign,
}

/// What is said of the way to a server, by source and sink alike.
#[derive(Debug, Clone)]
pub struct Way<'a> {
    pub server: &'a Server,
    pub security: Security,
    pub mode: Mode,
    pub login: Option<&'a Login>,
}

/// What a session is made of.
#[derive(Debug, Clone)]
pub struct Settings {
    /// Where the server is.
    pub server: Server,
    /// How messages are secured.
    pub security: Security,
    pub mode: Mode,
    /// User and password.
    pub login: Option<(String, String)>,
    /// By what the server knows us, and the name of our session.
    pub uri: String,
    pub name: String,
    /// The folder with certificates.
    pub folder: PathBuf,
    /// How long an answer may take.
    pub patience: Wait,
    /// The longest pause between two connections.
    pub retry: Wait,
}

impl Settings {
    /// How it is asked that messages are secured.
    pub fn message_mode(&self) -> MessageSecurityMode {
        match (self.security, self.mode) {
            (Security::None, _) => MessageSecurityMode::None,
            (_, Mode::Sign) => MessageSecurityMode::Sign,
            (_, Mode::SignAndEncrypt) => MessageSecurityMode::SignAndEncrypt,
        }
    }
}

impl Way<'_> {
    /// What is wrong with it, or doubtful, before anything runs.
    pub fn remarks(&self) -> Vec<ParameterRemark> {
        let remark = |at: &str, words: &str, help: &str| ParameterRemark {
            at: vec![at.to_owned()],
            is_mistake: false,
            words: words.to_owned(),
            help: help.to_owned(),
        };
        match (self.security, self.login) {
            (Security::None, None) => vec![remark(
                "endpoint",
                "nothing is signed: whoever is in the network can change what is sent",
                "add security = \"Basic256Sha256\", and trust the server's certificate by `athermal trust`",
            )],
            (Security::None, Some(_)) => vec![remark(
                "login",
                "nothing is encrypted: unless the server encrypts passwords alone, this one is sent in clear",
                "add security = \"Basic256Sha256\", and trust the server's certificate by `athermal trust`",
            )],
            _ => Vec::new(),
        }
    }

    /// What a session is made of, for a source or sink of this name on a machine.
    ///
    /// # Errors
    /// When a secret cannot be read.
    pub fn settings(
        &self,
        (machine, name): (Option<&str>, &str),
        (folder, state): (&Path, &Path),
        (patience, retry): (Wait, Wait),
    ) -> Result<Settings, String> {
        // In a certificate there are no others.
        let plain = |text: &str| -> String {
            let is_plain = |of: char| of.is_ascii_alphanumeric() || matches!(of, '-' | '_' | '.');
            text.chars()
                .map(|of| if is_plain(of) { of } else { '-' })
                .collect()
        };
        let (own, name) = (plain(machine.unwrap_or("machine")), plain(name));
        Ok(Settings {
            server: self.server.clone(),
            security: self.security,
            mode: self.mode,
            login: self.login.map(|login| login.read(folder)).transpose()?,
            uri: format!("urn:athermal:{own}:{name}"),
            name: format!("athermal {own} {name}"),
            folder: state.to_owned(),
            patience,
            retry,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_server_has_a_scheme_a_host_the_usual_port_and_perhaps_a_path() {
        let of = |text: &str| text.parse::<Server>().map(|of| (of.url, of.host));
        let is = |url: &str, host: &str| Ok((url.to_owned(), host.to_owned()));
        assert_eq!(of("opc.tcp://plc"), is("opc.tcp://plc:4840", "plc"));
        assert_eq!(
            of("opc.tcp://plc:7/UA/x"),
            is("opc.tcp://plc:7/UA/x", "plc")
        );
        assert_eq!(of("opc.tcp://[::1]"), is("opc.tcp://[::1]:4840", "::1"));
        for (text, why) in [
            ("plc", "no `opc.tcp://`"),
            ("http://plc", "no `opc.tcp://`"),
            ("opc.tcp://", "no host"),
            ("opc.tcp://a b", "no host"),
            ("opc.tcp://plc:x", "no number"),
            ("opc.tcp://me:w0rd@plc", "`login`"),
        ] {
            let error = of(text).expect_err(text);
            assert!(error.contains(why), "{error}");
        }
    }
}
