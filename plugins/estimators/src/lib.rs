//! Estimator nodes of athermal: linear, AR and ARX regression, sparse, robust and polynomial ones, recursive least squares,
//! structural models followed by a Kalman filter, transfer functions identified by the prediction error, and the baselines `zero`
//! and `persistence`.

mod ar;
mod arimax;
mod arma;
mod armax;
mod arx;
mod bj;
mod elastic_net;
mod folds;
mod huber;
mod identified;
mod kalman;
mod lag_order;
mod lags;
mod lasso;
mod linear;
mod narx;
mod oe;
mod online;
mod order;
mod penalty;
mod persistence;
mod polynomial;
mod regression;
mod rls;
mod selection;
mod solver;
mod stack;
mod zero;

pub use ar::Ar;
pub use arimax::Arimax;
pub use arma::Arma;
pub use armax::Armax;
pub use arx::Arx;
pub use bj::Bj;
pub use elastic_net::{ElasticNet, SparsePenalty};
pub use folds::{Cut, Folds};
pub use huber::Huber;
pub use identified::PerInput;
pub use kalman::{Kalman, Noises};
pub use lasso::Lasso;
pub use linear::Linear;
pub use narx::{Narx, NarxPredictor};
pub use oe::Oe;
pub use online::OnlinePredictor;
pub use order::{Figure, Order, OrderRange};
pub use penalty::{Choice, Penalty};
pub use persistence::Persistence;
pub use polynomial::{Polynomial, PolynomialPredictor};
pub use regression::LinearPredictor;
pub use rls::{Forgetting, Rls};
pub use selection::{By, CrossValidated, Selection};
pub use solver::Solver;
pub use stack::Stack;
pub use zero::Zero;
