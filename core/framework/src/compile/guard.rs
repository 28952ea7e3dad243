//! What becomes of a panic in the code of a kind while a graph with it is compiled.

use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

use super::instance::instance_name;
use super::kind_fault::KindFault;
use crate::diagnostic::{NodePanic, panic_message};
use crate::document::{InstanceDecl, NodeDecl};
use crate::node::Kind;

/// What becomes of panics.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Panics {
    /// Each is reported as a fault of its kind, and so is all that is wrong elsewhere.
    Report,
    /// The first one goes on to whoever compiles, as a [`NodePanic`].
    Propagate,
}

impl Panics {
    /// Does what takes code of a kind, for an instance of a node.
    ///
    /// # Errors
    /// Where it panics.
    pub(super) fn caught<T>(
        self,
        kind: &Kind,
        (node, decl): (&NodeDecl, &InstanceDecl),
        work: impl FnOnce() -> T,
    ) -> Result<T, KindFault> {
        // What the work has half done is let go with the graph.
        catch_unwind(AssertUnwindSafe(work)).map_err(|panic| {
            let message = panic_message(&*panic).to_owned();
            if self == Self::Propagate {
                resume_unwind(Box::new(NodePanic {
                    node: instance_name(&node.name, decl.member.as_deref()),
                    when: "while its graph was compiled".to_owned(),
                    author: kind.author(),
                    message,
                }));
            }
            KindFault::panics(&message)
        })
    }
}
