//! What an engine knows: [taken down](engine_state) and [restored](snapshot), [transferred](transfer) to another graph, and
//! the passing of outputs from one graph [to the next](blend).

mod blend;
mod engine_state;
mod revision;
mod snapshot;
mod transfer;

pub(crate) use blend::{Blending, rate};
pub(crate) use engine_state::NodeState;
pub use engine_state::{EngineState, RestoreError};
pub use revision::{Fnv1a, fnv_1a, revision};

pub use transfer::{Carry, NodeCarry, StateTransfer};
