//! Decides what becomes of a panic in the code of a kind while a graph with it is compiled; where such code is asked is decided
//! where its answer is needed.

use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

use super::kind_fault::KindFault;
use crate::diagnostic::said;
use crate::node::Kind;

/// What becomes of panics.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Panics {
    /// Each is told as a fault of its kind, and all that is wrong elsewhere is told too.
    AreTold,
    /// The first one goes on to whoever compiles, after a line on standard error that says of which node it is.
    GoOn,
}

impl Panics {
    /// Does what takes code of a kind, for the node that a context names.
    ///
    /// # Errors
    /// Where it panics.
    pub(super) fn caught<T>(
        self,
        kind: &Kind,
        context: &str,
        work: impl FnOnce() -> T,
    ) -> Result<T, KindFault> {
        // What the work has half done is let go with the graph.
        catch_unwind(AssertUnwindSafe(work)).map_err(|panic| {
            if self == Self::GoOn {
                eprintln!(
                    "the {context} panicked while its graph was compiled; what it said stands above, and is for {}",
                    kind.author()
                );
                resume_unwind(panic);
            }
            KindFault::panics(said(&*panic))
        })
    }
}
