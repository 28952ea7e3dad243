//! Estimator nodes of athermal: linear, AR and ARX regression, and the baselines `zero` and `persistence`.

mod ar;
mod arx;
mod linear;
mod persistence;
mod regression;
mod stack;
mod zero;

pub use ar::Ar;
pub use arx::Arx;
pub use linear::Linear;
pub use persistence::Persistence;
pub use regression::{LinearPredictor, Selection, Solver};
pub use stack::Stack;
pub use zero::Zero;
