//! Decides what a fitted graph is and how it is written: one JSON file that reads back to the last bit.

mod card;
mod error;
mod file;
mod named;
mod problem;

pub use card::{Card, DataCard, EstimatorCard, Period};
pub use error::ModelError;
pub use file::Model;
pub use named::named_model;
pub use problem::NamedModelProblem;
