//! Estimator nodes of athermal: linear, AR and ARX regression, structural models followed by a Kalman filter, and the
//! baselines `zero` and `persistence`.

mod ar;
mod arx;
mod kalman;
mod linear;
mod persistence;
mod regression;
mod zero;

pub use ar::Ar;
pub use arx::Arx;
pub use kalman::{Kalman, Noises};
pub use linear::Linear;
pub use persistence::Persistence;
pub use regression::{LinearPredictor, Selection, Solver};
pub use zero::Zero;
