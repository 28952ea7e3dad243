//! Decides which channels of a port a name or a pattern picks out; which port is meant is decided by who asks.

use std::cell::OnceCell;
use std::sync::Arc;

use indexmap::IndexMap;

use super::CompileProblem;
use super::reference::{Pattern, Reference, is_pattern};
use crate::diagnostic::Names;

/// The channels of a port, each with its slot.
#[derive(Debug, Default, Clone)]
pub(crate) struct PortChannels {
    slots: IndexMap<String, usize>,
    /// Their names, once somebody refers to one that there is not: a graph may do so thousands of times.
    known: OnceCell<Arc<Names>>,
}

impl PortChannels {
    /// Adds a channel; gives the slot of one that had the name before.
    pub(crate) fn insert(&mut self, name: String, slot: usize) -> Option<usize> {
        self.known.take();
        self.slots.insert(name, slot)
    }

    /// The slots of the channels that a reference to this port stands for, in order.
    ///
    /// # Errors
    /// [`CompileProblem::UnknownChannel`].
    pub(crate) fn find(&self, reference: &Reference<'_>) -> Result<Vec<usize>, CompileProblem> {
        let slots = self.slots(reference.channel);
        match reference.channel {
            Some(channel) if slots.is_empty() => Err(CompileProblem::UnknownChannel {
                node: reference.node.to_owned(),
                channel: channel.to_owned(),
                known: self.known(),
            }),
            _ => Ok(slots),
        }
    }

    /// Those that a name or a pattern stands for; all of them where there is none.
    fn slots(&self, wanted: Option<&str>) -> Vec<usize> {
        match wanted {
            None => self.slots.values().copied().collect(),
            Some(text) if is_pattern(text) => {
                let pattern = Pattern::new(text);
                let matching = self.slots.iter().filter(|(name, _)| pattern.matches(name));
                matching.map(|(_, &slot)| slot).collect()
            }
            Some(name) => self.slots.get(name).copied().into_iter().collect(),
        }
    }

    /// The names of all of them.
    fn known(&self) -> Arc<Names> {
        let listed = || Arc::new(self.slots.keys().cloned().collect());
        Arc::clone(self.known.get_or_init(listed))
    }
}
