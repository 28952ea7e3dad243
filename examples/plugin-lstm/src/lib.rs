//! Long short-term memory for athermal graphs, as a crate outside of its workspace: [`Lstm`] predicts a truth from the recent
//! course of features, [`LstmEncoder`] gives what such a network remembers as features for other estimators.
//!
//! | module | decides |
//! |---|---|
//! | `sequence` | which regressors of a row make up the sequence, in which order |
//! | `network` | what a network is, and what it makes of one sequence |
//! | `gradient` | the error of a batch and its gradient, by back-propagation through time |
//! | `activation` | how gates are opened |
//! | `adam` | how weights follow the gradient |
//! | `training` | what a graph may say of training |
//! | `learning` | what is trained on, when training stops, which weights are kept |
//! | `fit` | what a fit gives, and what it makes of a row |
//! | `estimator`, `encoder` | the kinds of node |

#![cfg_attr(test, allow(clippy::unwrap_used))]

mod activation;
mod adam;
mod encoder;
mod estimator;
mod fit;
mod gradient;
mod learning;
mod network;
mod sequence;
mod training;

pub use encoder::LstmEncoder;
pub use estimator::Lstm;
pub use sequence::Sequence;
pub use training::Training;
