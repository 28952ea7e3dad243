//! A set of slots: a mark for each, since most slots of a graph are in most sets.

use std::ops::Range;

/// Some of the slots of a plan.
#[derive(Debug, Clone, Default)]
pub struct SlotSet(Vec<bool>);

impl SlotSet {
    /// Takes a slot in; whether it was not there before.
    pub(crate) fn insert(&mut self, slot: usize) -> bool {
        if slot >= self.0.len() {
            self.0.resize(slot + 1, false);
        }
        !std::mem::replace(&mut self.0[slot], true)
    }

    pub fn contains(&self, slot: usize) -> bool {
        self.0.get(slot).is_some_and(|marked| *marked)
    }

    /// Whether any slot of a range is in it.
    pub fn has_any(&self, mut slots: Range<usize>) -> bool {
        slots.any(|slot| self.contains(slot))
    }
}

impl Extend<usize> for SlotSet {
    fn extend<T: IntoIterator<Item = usize>>(&mut self, slots: T) {
        for slot in slots {
            self.insert(slot);
        }
    }
}

impl FromIterator<usize> for SlotSet {
    fn from_iter<T: IntoIterator<Item = usize>>(slots: T) -> Self {
        let mut set = Self::default();
        set.extend(slots);
        set
    }
}
