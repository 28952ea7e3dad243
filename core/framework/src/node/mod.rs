//! Decides what authors of nodes implement and how a kind becomes known; not which nodes a graph has.
//!
//! A node *kind* is a serde struct of parameters plus one role: [`Feature`], [`Estimator`] or [`Combiner`]. The struct is
//! the specification: building what runs from it does no I/O and spawns nothing. [`register!`](crate::register) makes the
//! kind known under its name.
//!
//! A [`Feature`] with its [`Operator`] is the general form: any ports in, any ports out, a state of its own, at every tick if it
//! asks for it. Monitors, filters, safe states and compensations are features. [`Estimator`] and [`Combiner`] are narrower on
//! purpose: they never see a truth before its time, because it is not theirs to read. A feature that learns from a truth before
//! it runs has an [`Encoder`], and stays as it was fitted.

mod coefficients;
mod combiner;
mod encoder;
mod estimator;
mod feature;
mod figure;
mod forms;
mod kept;
mod kind_facts;
mod learner;
mod learning_gate;
mod linear_form;
pub mod number;
pub mod number_or_none;
pub mod numbers;
mod port;
mod predictor;
pub mod prelude;
mod range;
mod reach;
mod recent_error;
mod registry;
mod standing;
mod state;
mod training_error;

pub use coefficients::{Coefficients, Factor, Mode, Noise, Of, Term};
pub use combiner::{Combine, Combiner, Evidence, Votes};
pub(crate) use encoder::FeatureFit;
pub use encoder::{Encoder, Hindsight};
pub use estimator::{
    CandidateScore, Estimator, OrderFigure, OrderTable, PlannedRow, Regressor, Regressors, Runs,
    SelectionStep, Summed, Trained, Trainer, TrainingReport, TrainingSetup, TriedOrder, TruthLags,
};
pub use feature::{Feature, Operator, Outputs, Tick};
pub(crate) use feature::{PortValues, SlotTime};
pub use figure::{Figure, Figures};
pub use forms::Forms;
pub use kept::Kept;
pub use kind_facts::{Duty, KindFacts, Pace};
pub use learner::{Learner, Learns, TrainedRange};
pub use learning_gate::{Admission, LearningGate, LearningLimits, between_lessons};
pub use linear_form::LinearForm;
pub(crate) use linear_form::Strands;
pub use port::{FREEZE, InputPort, Inputs, Mistake, OutputPort, PortSummary, Read};
pub use predictor::Predictor;
#[doc(hidden)]
pub use predictor::{InModel, PredictorForm};
pub use range::{ParameterPart, Range, each_parameter, out_of_range};
pub use reach::Reach;
pub(crate) use recent_error::RecentError;
#[doc(hidden)]
pub use registry::read;
pub use registry::{Kind, NodeKind, NodeSpec, ReadSpec, Role, RoleName, as_toml, inline_toml};
pub use standing::who_speaks;
pub(crate) use standing::{Speaks, Standing};
#[doc(hidden)]
pub use state::StateForm;
pub use state::{Restored, State};
pub use training_error::TrainingError;
