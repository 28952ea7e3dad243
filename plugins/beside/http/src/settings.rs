//! `[control]`: how a service is asked and ordered.

use std::borrow::Cow;
use std::net::SocketAddr;
use std::path::PathBuf;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Deserializer, de};

/// How a service is asked and ordered. Its Unix socket is always there: `/run/athermal/NAME.sock`, or `control.sock` in the state folder.
#[derive(Debug, Clone, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Control {
    /// A loopback address and port that it listens on besides, such as "127.0.0.1:9464", for the page, for `/metrics` and for programs
    /// that know no Unix sockets. Orders need the token that stands in `token` of the state folder.
    pub http: Option<Loopback>,
    /// An address and port at which other machines may look and order, by TLS. To look takes the token that stands in `token-read`.
    pub https: Option<Https>,
    /// The origins of pages that may ask besides, such as `https://edge.plant` of a proxy.
    pub origins: Vec<Origin>,
    /// The Unix socket, where it is to be another.
    pub socket: Option<PathBuf>,
}

/// Where other machines look and order.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Https {
    /// An address and port, such as "0.0.0.0:9443".
    #[schemars(with = "String")]
    pub at: SocketAddr,
    /// The file with the certificate, in PEM, and those of who signed it. Without one, one is made in the state folder, and the service
    /// reports its fingerprint. It is read again when it changes.
    pub certificate: Option<PathBuf>,
    /// The file with its key.
    pub key: Option<PathBuf>,
}

/// A scheme with a host, as browsers name where a page comes from.
#[derive(Debug, Clone, PartialEq, Eq, JsonSchema)]
pub struct Origin(
    #[schemars(pattern("^https?://[^/]+$"))]
    pub String,
);

impl Origin {
    /// Its host, with the port where there is one.
    #[must_use]
    pub fn host(&self) -> &str {
        self.0.split_once("://").map_or(&self.0, |(_, host)| host)
    }
}

impl<'de> Deserialize<'de> for Origin {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = String::deserialize(deserializer)?;
        let host = ["https://", "http://"]
            .iter()
            .find_map(|of| text.strip_prefix(of));
        let is_host = |of: &str| !of.is_empty() && !of.contains(['/', '*', ' ', '@']);
        match host.is_some_and(is_host) {
            true => Ok(Self(text)),
            false => Err(de::Error::custom(format!(
                "an origin is a scheme and a host, such as \"https://edge.plant\", found \"{text}\""
            ))),
        }
    }
}

/// An address of the machine itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Loopback(pub SocketAddr);

impl<'de> Deserialize<'de> for Loopback {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = String::deserialize(deserializer)?;
        let address: SocketAddr = text.parse().map_err(|_| {
            de::Error::custom(format!(
                "an address and a port are wanted, such as \"127.0.0.1:9464\", found \"{text}\""
            ))
        })?;
        if !address.ip().is_loopback() {
            return Err(de::Error::custom(format!(
                "\"{text}\" is seen by other machines, for which there is no encryption here: listen on 127.0.0.1 or [::1], or use `https`"
            )));
        }
        Ok(Self(address))
    }
}

impl JsonSchema for Loopback {
    fn schema_name() -> Cow<'static, str> {
        "Loopback".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "type": "string",
            "description": "A loopback address and a port.",
            "pattern": "^(127\\.[0-9.]+|\\[::1\\]):[0-9]+$",
            "examples": ["127.0.0.1:9464", "[::1]:9464"]
        })
    }
}
