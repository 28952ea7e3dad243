//! Combiner nodes of athermal: votes that weigh estimators, by their recent error or alike.

mod auto_weighted;
mod mean;

pub use auto_weighted::{AutoWeighted, Weighting};
pub use mean::Mean;
