//! A source of athermal: a counter.
//!
//! It gives each of its channels the same count, one more each time. Make it ask your controller instead: connect in
//! [`Inlet::run`], and come back with an error where the connection is lost. `run` is called again after a while.

use std::time::{SystemTime, UNIX_EPOCH};

use athermal_core::time::{Duration, Instant};
use athermal_serve::connector::{ConnectorError, Inlet, Outflow, Source, SourceWiring, Stop};
use athermal_serve::register_source;
use schemars::JsonSchema;
use serde::Deserialize;

/// Counts on all channels, one more each time.
#[derive(Debug, Deserialize, JsonSchema)]
pub struct MyNode {
    /// The time from one count to the next.
    #[schemars(extend("exclusiveMinimum" = 0))]
    every: Duration,
}

register_source!(MyNode, "my_node");

impl MyNode {
    /// A counter that counts so often.
    pub fn new(every: Duration) -> Self {
        Self { every }
    }
}

impl Source for MyNode {
    fn open(&self, wiring: SourceWiring) -> Result<Box<dyn Inlet>, ConnectorError> {
        let every = u64::try_from(self.every.as_ns());
        let every = every.map_err(|_| ConnectorError::new("`every` is below 0"))?;
        Ok(Box::new(Counter {
            every: std::time::Duration::from_nanos(every),
            channels: wiring.channels.len(),
            count: 0.0,
        }))
    }
}

struct Counter {
    every: std::time::Duration,
    channels: usize,
    count: f64,
}

impl Inlet for Counter {
    fn run(&mut self, out: &mut Outflow, stop: &Stop) -> Result<(), ConnectorError> {
        // Here a connection is made; what fails is worded for whoever reads the log.
        out.connected();
        while stop.wait(self.every) {
            let since = SystemTime::now().duration_since(UNIX_EPOCH);
            let since = since.map_err(ConnectorError::new)?.as_nanos();
            // A source that has stamps of its own gives those.
            let stamp = Instant::from_ns(i64::try_from(since).map_err(ConnectorError::new)?);
            self.count += 1.0;
            for channel in 0..self.channels {
                out.sample(channel, stamp, self.count);
            }
        }
        Ok(())
    }
}
