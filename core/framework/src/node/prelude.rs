//! All that the author of a node names, in one import: `use athermal_core::node::prelude::*;`.

pub use super::{
    Coefficients, Combine, Combiner, Encoder, Estimator, Evidence, Factor, Feature, Forms,
    InputPort, Inputs, Learner, Learns, LinearForm, Mistake, Noise, Of, Operator, OutputPort,
    Outputs, PortSummary, Predictor, Reach, Regressor, Regressors, Restored, Runs, State, Summed,
    Term, Tick, Trained, TrainedRange, Trainer, TrainingError, TrainingReport, TrainingSetup,
    TruthLags, Votes, number, number_or_none, numbers,
};
pub use crate::channel::{ABSENT, Channel, is_unchanged};
pub use crate::quantity::Quantity;
pub use crate::time::{Duration, Instant};
pub use crate::unit::Unit;
pub use schemars::JsonSchema;
pub use serde::{Deserialize, Serialize};
