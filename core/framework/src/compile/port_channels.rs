//! Which channels of a port a name or a pattern picks out.

use std::cell::OnceCell;
use std::sync::Arc;

use indexmap::IndexMap;

use super::problem::UnknownChannel;
use super::reference::{Reference, alternatives, is_pattern};
use crate::diagnostic::Names;
use crate::document::Pattern;

/// The channels of a port, each with its slot.
#[derive(Debug, Default, Clone)]
pub struct PortChannels {
    slots: IndexMap<String, usize>,
    /// Their names, once somebody refers to one that there is not: a graph may do so thousands of times.
    known: OnceCell<Arc<Names>>,
}

impl PortChannels {
    /// Adds a channel; gives the slot of one that had the name before.
    pub fn insert(&mut self, name: String, slot: usize) -> Option<usize> {
        self.known.take();
        self.slots.insert(name, slot)
    }

    /// The slots of the channels that a reference to this port stands for, in order.
    ///
    /// # Errors
    /// Also where an alternative of a choice stands for none.
    pub fn find(&self, reference: &Reference<'_>) -> Result<Vec<usize>, UnknownChannel> {
        let slots = self.slots(reference.channel);
        let Some(channel) = reference.channel else {
            return Ok(slots);
        };
        let unmatched = if slots.is_empty() {
            Some(channel.to_owned())
        } else {
            alternatives(channel).find(|of| self.slots(Some(of)).is_empty())
        };
        match unmatched {
            Some(channel) => Err(UnknownChannel {
                node: reference.node.to_owned(),
                channel,
                known: self.known(),
            }),
            None => Ok(slots),
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

#[cfg(test)]
mod tests {
    use super::*;

    fn found(reference: &str) -> Result<Vec<usize>, String> {
        let mut port = PortChannels::default();
        for (slot, name) in ["plate1@150s", "plate2@150s", "room@150s"]
            .into_iter()
            .enumerate()
        {
            port.insert(name.to_owned(), slot);
        }
        port.find(&Reference::parse(reference))
            .map_err(|unknown| unknown.channel)
    }

    #[test]
    fn an_alternative_that_stands_for_no_channel_is_told_though_others_stand_for_some() {
        assert_eq!(found("slopes.{plate1,room}@*"), Ok(vec![0, 2]));
        assert_eq!(found("slopes.{plat1,room}@*"), Err("plat1@*".to_owned()));
        assert_eq!(found("slopes.{lid}@*"), Err("{lid}@*".to_owned()));
    }

    #[test]
    fn of_two_choices_not_every_combination_must_be_there() {
        assert_eq!(found("slopes.{plate,roo}{1,2,m}@*"), Ok(vec![0, 1, 2]));
        assert_eq!(
            found("slopes.{plate,room}{1,3,@}*"),
            Err("{plate,room}3*".to_owned())
        );
    }
}
