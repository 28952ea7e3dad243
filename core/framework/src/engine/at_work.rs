//! Names the node in whose code a panic came about: the panic itself knows only a place in the source.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

use crate::compile::{Plan, PlannedNode};
use crate::diagnostic::{NodePanic, panic_message};
use crate::time::Instant;

/// When a node is at work.
#[derive(Debug, Clone, Copy)]
pub enum When {
    /// At a tick, or the end of a segment.
    Tick(Instant),
    /// In its fit.
    Fit,
    /// While it is made, or takes a state back.
    Start,
}

/// The number of the node that is at work.
#[derive(Debug)]
pub(crate) struct AtWork(usize);

impl AtWork {
    /// From here on it is this one.
    #[inline]
    pub(crate) fn is(&mut self, node: usize) {
        self.0 = node;
    }
}

/// Does what takes the code of nodes.
///
/// # Panics
/// Where that panics: with a [`NodePanic`] that names the node at work.
#[inline]
pub(crate) fn naming<T>(plan: &Plan, when: When, work: impl FnOnce(&mut AtWork) -> T) -> T {
    caught(work)
        .unwrap_or_else(|(node, panic)| resume_unwind(named(plan.nodes.get(node), when, panic)))
}

/// Does what takes the code of nodes; a panic comes back with the number of the node at work.
#[inline]
pub(crate) fn caught<T>(
    work: impl FnOnce(&mut AtWork) -> T,
) -> Result<T, (usize, Box<dyn Any + Send>)> {
    let mut at_work = AtWork(usize::MAX);
    catch_unwind(AssertUnwindSafe(|| work(&mut at_work))).map_err(|panic| (at_work.0, panic))
}

/// The same for the code of one node, by its number.
pub fn naming_one<T>(plan: &Plan, node: usize, when: When, work: impl FnOnce() -> T) -> T {
    naming(plan, when, |at_work| {
        at_work.is(node);
        work()
    })
}

/// A panic with its node; as it is where it knows one already, or there is none.
#[cold]
pub(crate) fn named(
    node: Option<&PlannedNode>,
    when: When,
    panic: Box<dyn Any + Send>,
) -> Box<dyn Any + Send> {
    let Some(node) = node.filter(|_| !panic.is::<NodePanic>()) else {
        return panic;
    };
    Box::new(NodePanic {
        node: node.instance(),
        when: match when {
            When::Tick(now) => format!("at {now} s"),
            When::Fit => "in its fit".to_owned(),
            When::Start => "before its first tick".to_owned(),
        },
        author: node.kind.author(),
        message: panic_message(&*panic).to_owned(),
    })
}
