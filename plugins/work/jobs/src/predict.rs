//! What a model puts out at each row of recorded data.

use std::path::Path;

use athermal_core::failure::{Failure, outside};
use athermal_core::watch::Watch;
use athermal_run::live::{Sink, run};
use athermal_run::model::Model;
use athermal_run::recording::Recording as _;
use schemars::JsonSchema;
use serde::Deserialize;

use crate::beyond::beyond;
use crate::data::Data;
use crate::doubts::Doubts;
use crate::faults::{FaultWatch, Purpose};
use crate::model::{IN_MEMORY, check_fitted, warn_unfitted, warn_without_novelty};

/// On which data a model runs.
#[derive(Debug, Deserialize, JsonSchema)]
pub struct Predict {
    /// The data.
    #[serde(flatten)]
    pub data: Data,
    /// Let no estimator learn on the way
    #[serde(default)]
    pub frozen: bool,
}

impl Predict {
    /// What the model puts out at each row goes to a sink.
    ///
    /// # Errors
    /// When the data cannot be read, or the model is a graph that needs a fit.
    pub fn run(&self, model: &Model, sink: &mut dyn Sink, host: &dyn Watch) -> Result<(), Failure> {
        let name = Path::new(IN_MEMORY);
        check_fitted(model, name)?;
        warn_unfitted(host, model, name);
        warn_without_novelty(host, model, name);
        let mut engine = model.engine()?;
        engine.freeze(self.frozen);
        self.data.check_offsets(&[])?;
        self.data.thin(None, model)?;
        let dataset = self.data.dataset();
        let watch = FaultWatch::new(&dataset, Purpose::Run);
        let mut source = watch.open(&model.plan).map_err(outside)?;
        run(&mut engine, &mut *source, sink)?;
        drop(source);
        let (ranges, rejected) = (engine.sample_ranges(), engine.rejected_channels());
        let doubts = Doubts {
            plan: &model.plan,
            dataset: &dataset,
            refused: engine.refused(),
            rejected: &rejected,
            faults: watch.found(),
            outside_fit: beyond(model.sample_ranges(), &ranges),
        };
        doubts.warn(host);
        Ok(())
    }
}
