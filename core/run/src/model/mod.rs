//! Decides what a fitted graph is and how it is written: one JSON file that reads back to the last bit.

mod card;
mod coefficients;
mod error;
mod file;
mod named;
pub mod problem;
mod shared;

pub use card::{Card, DataCard, EstimatorCard, Period, content_of};
pub use coefficients::{Coefficient, EstimatorParts, FittedEstimator, ProductFactor};
pub use error::ModelError;
pub use file::Model;
pub use named::named_model;
