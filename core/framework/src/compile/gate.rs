//! The gate that any order of steps must pass, whoever planned it: nothing is read before it is there.

use super::plan::{Plan, PlannedRole, Step};

/// Why the steps of a plan cannot be done in their order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Misordered {
    /// A node runs twice, never, or takes its inputs for later ticks although it does not do that.
    Node {
        /// The node.
        node: usize,
    },
    /// A node runs before this gather of its inputs is read.
    Unread {
        /// The node.
        node: usize,
        /// The gather.
        gather: usize,
    },
    /// A gather is read before the node that writes one of its slots has run.
    Early {
        /// The gather.
        gather: usize,
        /// The slot.
        slot: usize,
    },
}

impl Plan {
    /// Checks that each node runs once, after all that it reads.
    ///
    /// # Errors
    /// What stands in the wrong place.
    pub fn check_order(&self) -> Result<(), Misordered> {
        let mut read = vec![false; self.gathers.len()];
        let mut ran = vec![false; self.nodes.len()];
        let mut captured = vec![false; self.nodes.len()];
        let all_read = |node: usize, read: &[bool]| {
            let mut gathers = self.nodes[node].role.gathers();
            let unread = gathers.find(|&gather| !read[gather]);
            unread.map_or(Ok(()), |gather| Err(Misordered::Unread { node, gather }))
        };
        for step in &self.steps {
            match *step {
                Step::Gather(gather) => {
                    // What is read with a lag is read from its past.
                    let entries = self.gathers[gather].entries.iter();
                    let mut present = entries.filter(|entry| entry.lag.is_zero());
                    let late = |slot: usize| self.channels[slot].node.is_some_and(|of| !ran[of]);
                    if let Some(entry) = present.find(|entry| late(entry.slot)) {
                        let slot = entry.slot;
                        return Err(Misordered::Early { gather, slot });
                    }
                    read[gather] = true;
                }
                Step::Run(node) => {
                    if !self.closes_loops(node) {
                        all_read(node, &read)?;
                    }
                    if std::mem::replace(&mut ran[node], true) {
                        return Err(Misordered::Node { node });
                    }
                }
                Step::Capture(node) => {
                    all_read(node, &read)?;
                    captured[node] = true;
                }
            }
        }
        let is_done = |node: usize| ran[node] && captured[node] == self.closes_loops(node);
        let left = (0..self.nodes.len()).find(|&node| !is_done(node));
        left.map_or(Ok(()), |node| Err(Misordered::Node { node }))
    }

    /// Whether a node takes its inputs for later ticks.
    pub(super) fn closes_loops(&self, node: usize) -> bool {
        let role = &self.nodes[node].role;
        matches!(role, PlannedRole::Feature { closes_loops, .. } if *closes_loops)
    }
}
