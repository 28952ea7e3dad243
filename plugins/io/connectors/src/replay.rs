//! `replay`: a recording as if it were happening.

use std::path::PathBuf;

use athermal_files::Reader;
use athermal_serve::connector::{
    ConnectorError, Inlet, Outflow, Source, SourceWiring, Stamps, Stop,
};
use athermal_serve::register_source;
use schemars::JsonSchema;
use serde::Deserialize;

use crate::pace::{Pace, Speed};
use crate::table::{in_folder, layout, options, pass};

/// A recording in CSV or JSON lines, row by row as if it were happening. The service ends with it.
#[derive(Debug, Deserialize, JsonSchema)]
pub struct Replay {
    /// The recording.
    path: PathBuf,
    /// How fast: 1 is as it was recorded, 10 ten times as fast, "fastest" as fast as it goes.
    #[serde(default)]
    speed: Speed,
}

register_source!(Replay, "replay");

impl Source for Replay {
    fn stamps(&self) -> Stamps {
        Stamps::Order
    }

    fn ends(&self) -> bool {
        true
    }

    fn open(&self, wiring: SourceWiring) -> Result<Box<dyn Inlet>, ConnectorError> {
        Ok(Box::new(ReplayInlet {
            path: in_folder(&wiring.folder, &self.path),
            speed: self.speed,
            wiring,
        }))
    }
}

struct ReplayInlet {
    path: PathBuf,
    speed: Speed,
    wiring: SourceWiring,
}

impl Inlet for ReplayInlet {
    fn run(&mut self, out: &mut Outflow, stop: &Stop) -> Result<(), ConnectorError> {
        let options = athermal_files::Options {
            goes_on: false,
            joins: true,
            ..options(None)
        };
        let opened = Reader::open(&self.path, layout(&self.wiring), options);
        let mut reader = opened.map_err(ConnectorError::new)?;
        out.connected();
        let known = self.wiring.channels.iter().map(|of| of.after).max();
        let mut pace = Pace::new(self.speed);
        // What the service knows already needs no time.
        let wait = |at| known.is_some_and(|known| at <= known) || pace.wait(at, stop);
        pass(&mut reader, out, stop, wait).map(|_| ())
    }
}
