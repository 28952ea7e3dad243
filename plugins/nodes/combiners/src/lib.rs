//! Combiner nodes of athermal: votes that weigh estimators, by their recent error or alike, choices among them, and watches
//! over them.

mod auto_weighted;
mod choose;
mod conformal;
mod errors;
mod guard;
mod hedge;
mod mean;
mod median;
mod memory;
pub mod share;
mod state_gate;
mod watch;

pub use auto_weighted::{AutoWeighted, Weighting};
pub use choose::{Best, Fallback};
pub use conformal::Conformal;
pub use guard::Guard;
pub use hedge::Hedge;
pub use mean::Mean;
pub use median::{Median, Trimmed};
pub use memory::{Fading, LastTruths, Memory};
pub use state_gate::StateGate;
pub use watch::{Adwin, PageHinkley, Watched};
