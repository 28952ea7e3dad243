//! From what the parts of a machine do to what its tool point does: `kinematics`.

mod chain;
mod kinematics;

pub use kinematics::{Kinematics, Link};
