//! What is learned while a graph runs, and how late: runs [paired](pairing) with their truths, the [`embargo`] on truths,
//! the [gate](gated_learner) before a learner, and the [`feedback`] of predictions in evaluations.

mod embargo;
mod feedback;
mod gated_learner;
mod mode;
mod pairing;
mod rows;

pub(crate) use embargo::{DueTruth, Embargo, EmbargoState};
pub(crate) use feedback::Feedback;
pub(crate) use gated_learner::GatedLearner;
pub use mode::{Mode, StepLength, times};

pub use pairing::{Pair, Pairing};
