//! Models of one graph share it: it is declared and compiled once for as long as one of them is in memory. What differs between them are
//! their fits and cards.

use std::sync::{Arc, Mutex, PoisonError, Weak};

use crate::compile::{Plan, Wanted};
use crate::document::GraphFile;

/// A graph as declared and as compiled.
pub(super) type Shared = (Arc<GraphFile>, Arc<Plan>);

/// What is in memory, as far as it is.
static KNOWN: Mutex<Vec<Known>> = Mutex::new(Vec::new());

struct Known {
    /// The graph as JSON, as models have it.
    text: String,
    wanted: Wanted,
    graph: Weak<GraphFile>,
    plan: Weak<Plan>,
}

impl Known {
    fn shared(&self) -> Option<Shared> {
        Some((self.graph.upgrade()?, self.plan.upgrade()?))
    }
}

/// The graph of a text that some model has, compiled so that it offers as much; else the one that `read` gives.
pub(super) fn shared<E>(
    text: String,
    wanted: Wanted,
    read: impl FnOnce() -> Result<(GraphFile, Plan), E>,
) -> Result<Shared, E> {
    let known = || KNOWN.lock().unwrap_or_else(PoisonError::into_inner);
    let mut same = None;
    known().retain(|of| {
        let there = of.shared();
        let is_there = there.is_some();
        if of.wanted == wanted && of.text == text {
            same = there;
        }
        is_there
    });
    if let Some(same) = same {
        return Ok(same);
    }
    let (graph, plan) = read()?;
    let can_change = plan.nodes.iter().any(|of| (of.kind.facts)().can_change);
    let (graph, plan) = (Arc::new(graph), Arc::new(plan));
    if !can_change {
        known().push(Known {
            text,
            wanted,
            graph: Arc::downgrade(&graph),
            plan: Arc::downgrade(&plan),
        });
    }
    Ok((graph, plan))
}
