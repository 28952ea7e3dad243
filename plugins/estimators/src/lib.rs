//! Estimator nodes of athermal: linear, AR and ARX regression, sparse, robust and polynomial ones, and the baselines `zero` and
//! `persistence`.

mod ar;
mod arx;
mod elastic_net;
mod folds;
mod huber;
mod lags;
mod lasso;
mod linear;
mod penalty;
mod persistence;
mod polynomial;
mod regression;
mod selection;
mod solver;
mod zero;

pub use ar::Ar;
pub use arx::Arx;
pub use elastic_net::{ElasticNet, SparsePenalty};
pub use folds::{Cut, Folds};
pub use huber::Huber;
pub use lasso::Lasso;
pub use linear::Linear;
pub use penalty::{Choice, Penalty};
pub use persistence::Persistence;
pub use polynomial::{Polynomial, PolynomialPredictor};
pub use regression::LinearPredictor;
pub use selection::{By, CrossValidated, Selection};
pub use solver::Solver;
pub use zero::Zero;
