//! Kinds of sources and sinks for tests.

use schemars::JsonSchema;
use serde::Deserialize;

use crate::connector::{
    ConnectorError, Inlet, Outlet, Purpose, Sink, SinkWiring, Source, SourceWiring,
};
use crate::time::Duration;

/// A table.
#[derive(Debug, Deserialize, JsonSchema)]
struct Table {
    /// Where it is.
    path: String,
    /// How often it is looked at.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0))]
    every: Option<Duration>,
}

/// A field bus.
#[derive(Debug, Deserialize, JsonSchema)]
struct Bus {}

/// A log.
#[derive(Debug, Deserialize, JsonSchema)]
struct Log {}

/// A stage.
#[derive(Debug, Deserialize, JsonSchema)]
struct Stage {}

crate::register_source!(Table, "test_table");
crate::register_source!(Bus, "test_bus");
crate::register_sink!(Log, "test_log");
// Two of one name, as two plugin crates may bring them.
crate::register_source!(Bus, "test_twice");
crate::register_source!(Table, "test_twice");
crate::register_sink!(Stage, "test_stage");
athermal_core::lacks!(crate::connector::SinkKind, "parquet", "parquet");

fn never<T>() -> Result<T, ConnectorError> {
    Err(ConnectorError::new("it is only read"))
}

impl Source for Table {
    fn open(&self, _: SourceWiring) -> Result<Box<dyn Inlet>, ConnectorError> {
        let every = self.every.unwrap_or_default();
        Err(ConnectorError::new(format_args!("{} {every}", self.path)))
    }
}

impl Source for Bus {
    fn needs_addresses(&self) -> bool {
        true
    }

    fn open(&self, _: SourceWiring) -> Result<Box<dyn Inlet>, ConnectorError> {
        never()
    }
}

impl Sink for Log {
    fn open(&self, _: SinkWiring) -> Result<Box<dyn Outlet>, ConnectorError> {
        never()
    }
}

impl Sink for Stage {
    fn purpose(&self) -> Purpose {
        Purpose::Command
    }

    fn open(&self, _: SinkWiring) -> Result<Box<dyn Outlet>, ConnectorError> {
        never()
    }
}
