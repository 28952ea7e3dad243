//! Combiner nodes of athermal: votes that weigh estimators, by their recent error or alike, and choices among them.

mod auto_weighted;
mod choose;
mod errors;
mod mean;
mod median;

pub use auto_weighted::{AutoWeighted, Weighting};
pub use choose::{Best, Fallback, Guard};
pub use mean::Mean;
pub use median::{Median, Trimmed};
