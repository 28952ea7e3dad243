//! Decides how the node is told in which a panic came about; what a panic says and what becomes of it is decided elsewhere.

use crate::compile::{Plan, PlannedNode};
use crate::time::Instant;

/// The node that is at work. Where a panic ends it, a line on standard error says which it was: the panic itself knows only a place
/// in the source.
pub(crate) struct AtHand<'a> {
    plan: &'a Plan,
    /// The instant of the tick; none in a fit.
    now: Option<Instant>,
    node: usize,
}

impl<'a> AtHand<'a> {
    /// None yet, of a plan at an instant.
    #[inline]
    pub(super) fn at(plan: &'a Plan, now: Instant) -> Self {
        Self {
            plan,
            now: Some(now),
            node: usize::MAX,
        }
    }

    /// This one, while it is fitted.
    pub(crate) fn in_fit(plan: &'a Plan, node: usize) -> Self {
        let now = None;
        Self { plan, now, node }
    }

    /// From here on it is this one.
    #[inline]
    pub(super) fn is(&mut self, node: usize) {
        self.node = node;
    }
}

impl Drop for AtHand<'_> {
    #[inline]
    fn drop(&mut self) {
        if std::thread::panicking()
            && let Some(node) = self.plan.nodes.get(self.node)
        {
            eprintln!("{}", told(node, self.now));
        }
    }
}

fn told(node: &PlannedNode, now: Option<Instant>) -> String {
    let when = now.map_or_else(|| "in its fit".to_owned(), |now| format!("at {now} s"));
    format!(
        "the node `{}` panicked {when}; what it said stands above, and is for the author of `{}`, from {} {}",
        node.instance(),
        node.kind.name,
        node.kind.package,
        node.kind.version
    )
}
