//! Decides how the node is told in which a panic came about; what a panic says and what becomes of it is decided elsewhere.

use crate::compile::{Plan, PlannedNode};
use crate::time::Instant;

/// The node that is at work. Where a panic ends it, a line on standard error says which it was: the panic itself knows only a place
/// in the source.
pub struct AtHand<'a> {
    plan: &'a Plan,
    when: When,
    node: usize,
}

/// When a node is at work.
#[derive(Clone, Copy)]
enum When {
    Tick(Instant),
    Fit,
    /// While it is made, or takes a state back.
    Start,
}

impl<'a> AtHand<'a> {
    /// None yet, of a plan at an instant.
    #[inline]
    pub(super) fn at(plan: &'a Plan, now: Instant) -> Self {
        Self {
            plan,
            when: When::Tick(now),
            node: usize::MAX,
        }
    }

    /// This one, while it is fitted.
    pub fn in_fit(plan: &'a Plan, node: usize) -> Self {
        let when = When::Fit;
        Self { plan, when, node }
    }

    /// None yet, of a plan whose nodes are made or take their states back.
    pub(super) fn at_start(plan: &'a Plan) -> Self {
        Self {
            plan,
            when: When::Start,
            node: usize::MAX,
        }
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
            eprintln!("{}", told(node, self.when));
        }
    }
}

/// The node of a name, while what it was fitted to is read: as [`AtHand`], and looked for only where a panic ends it.
pub struct FitAtHand<'a> {
    /// The plan that is fitted.
    pub plan: &'a Plan,
    /// The node at hand.
    pub name: &'a str,
}

impl Drop for FitAtHand<'_> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            let mut nodes = self.plan.nodes.iter();
            let node = nodes.find(|node| node.instance() == self.name);
            if let Some(node) = node {
                eprintln!("{}", told(node, When::Start));
            }
        }
    }
}

fn told(node: &PlannedNode, when: When) -> String {
    let when = match when {
        When::Tick(now) => format!("at {now} s"),
        When::Fit => "in its fit".to_owned(),
        When::Start => "before its first tick".to_owned(),
    };
    format!(
        "the node `{}` panicked {when}; what it said stands above, and is for {}",
        node.instance(),
        node.kind.author()
    )
}
