//! Estimator nodes of athermal: linear, AR and ARX regression, recursive least squares, structural models followed by a Kalman
//! filter, and the baselines `zero` and `persistence`.

mod ar;
mod arx;
mod kalman;
mod linear;
mod online;
mod persistence;
mod regression;
mod rls;
mod zero;

pub use ar::Ar;
pub use arx::Arx;
pub use kalman::{Kalman, Noises};
pub use linear::Linear;
pub use online::OnlinePredictor;
pub use persistence::Persistence;
pub use regression::{LinearPredictor, Selection, Solver};
pub use rls::{Forgetting, Rls};
pub use zero::Zero;
