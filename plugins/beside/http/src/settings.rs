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
    /// A loopback address and port that it listens on besides, such as "127.0.0.1:9464", for `/metrics` and for programs that know no
    /// Unix sockets. Orders need the token that stands in the state folder.
    pub http: Option<Loopback>,
    /// The Unix socket, where it is to be another.
    pub socket: Option<PathBuf>,
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
                "\"{text}\" is seen by other machines, for which there is no encryption here: listen on 127.0.0.1 or [::1], and let a proxy with TLS stand before it"
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
