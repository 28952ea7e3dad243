//! Decides how an engine tells all that it knows, and goes on from what it or another one knew.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::carry::{Carry, NodeCarry, Untouched};
use super::state::{NodeState, SlotState};
use super::{Engine, EngineError, EngineState, RestoreError, Running};
use crate::node::Restored;

impl Engine {
    /// All that the engine knows, as bytes that say themselves what they are.
    ///
    /// An engine of the same graph and fit that is given them goes on with the same bits.
    #[must_use]
    pub fn snapshot(&self) -> Vec<u8> {
        self.state().to_bytes()
    }

    /// Goes on from a snapshot, exactly where it was taken.
    ///
    /// # Errors
    /// When the bytes are damaged or belong to another graph or fit: the engine is as it was.
    pub fn restore(&mut self, snapshot: &[u8]) -> Result<(), RestoreError> {
        let state = EngineState::from_bytes(snapshot)?;
        let expected = self.revision();
        if state.revision != expected {
            return Err(RestoreError::OtherGraph {
                found: state.revision,
                expected,
            });
        }
        let mut fresh = Self::new(Arc::clone(&self.plan), &self.fitted).map_err(|error| {
            RestoreError::Unreadable {
                reason: error.to_string(),
            }
        })?;
        let all = Untouched::all(&self.plan);
        for node in fresh.adopt(&state, &all, |_| (String::new(), false), false) {
            if let Carry::Cold { reason } | Carry::Warmed { reason } = node.outcome {
                return Err(RestoreError::Refused {
                    node: node.node,
                    reason,
                });
            }
        }
        for ((_, blending), output) in fresh.blending.iter_mut().zip(&self.plan.outputs) {
            *blending = state
                .blending
                .get(&output.name)
                .copied()
                .unwrap_or_default();
        }
        *self = fresh;
        Ok(())
    }

    /// An engine that knows the same and goes on with the same bits.
    pub(crate) fn twin(&self) -> Result<Self, EngineError> {
        let mut twin = Self::new(Arc::clone(&self.plan), &self.fitted)?;
        twin.adopt(
            &self.state(),
            &Untouched::all(&self.plan),
            |_| (String::new(), false),
            false,
        );
        for ((_, own), (_, blending)) in twin.blending.iter_mut().zip(&self.blending) {
            *own = *blending;
        }
        Ok(twin)
    }

    /// Lets outputs pass over from what another engine put out last; `from` says which of its outputs each follows.
    pub(crate) fn pass_over(&mut self, before: &Self, from: &[Option<usize>]) {
        for ((_, blending), from) in self.blending.iter_mut().zip(from) {
            if let Some((_, last)) = from.and_then(|from| before.blending.get(from)) {
                blending.hand_over(last);
            }
        }
    }

    /// All that the engine knows, by name.
    #[must_use]
    pub fn state(&self) -> EngineState {
        let name = |slot: usize| self.plan.channels[slot].name.clone();
        let outputs = self.plan.outputs.iter().zip(&self.blending);
        let sources = self.plan.sources.iter().zip(&self.rejected);
        EngineState {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            revision: self.revision(),
            tick: self.slots.tick,
            last: self.last,
            before_break: self.before_break,
            rejected: sources
                .map(|(source, &count)| (source.name.clone(), count))
                .collect(),
            refused: self.refused,
            slots: (0..self.plan.channels.len())
                .map(|slot| (name(slot), self.slot_state(slot)))
                .collect(),
            histories: self
                .histories
                .iter()
                .enumerate()
                .filter_map(|(slot, history)| history.clone().map(|history| (name(slot), history)))
                .collect(),
            nodes: self.node_states(),
            blending: outputs
                .map(|(output, (_, blending))| (output.name.clone(), *blending))
                .collect(),
        }
    }

    fn slot_state(&self, slot: usize) -> SlotState {
        SlotState {
            value: self.slots.values[slot],
            stamp: self.slots.stamps[slot],
            written: self.slots.written[slot],
        }
    }

    fn node_states(&self) -> BTreeMap<String, NodeState> {
        let states = self
            .plan
            .nodes
            .iter()
            .zip(&self.nodes)
            .map(|(node, running)| {
                let state = match running {
                    Running::Operator { operator, .. } => NodeState::pack(operator.snapshot()),
                    Running::Estimate { .. } => NodeState::default(),
                    Running::Vote(vote) => vote.snapshot(),
                };
                (node.instance(), state)
            });
        states.collect()
    }

    /// Goes on from a state: untouched nodes as they were, others offered theirs where that makes sense.
    ///
    /// `changed` says of each other node why it cannot simply go on, and whether its state may still be of use. `warmed`
    /// says whether this engine has been stepped over the past.
    pub(crate) fn adopt(
        &mut self,
        state: &EngineState,
        untouched: &Untouched,
        changed: impl Fn(&crate::compile::PlannedNode) -> (String, bool),
        warmed: bool,
    ) -> Vec<NodeCarry> {
        let plan = Arc::clone(&self.plan);
        let begin = |reason: String| {
            if warmed {
                Carry::Warmed { reason }
            } else {
                Carry::Cold { reason }
            }
        };
        let mut carried = Vec::with_capacity(plan.nodes.len());
        for (node, running) in plan.nodes.iter().zip(&mut self.nodes) {
            let instance = node.instance();
            let was = state.nodes.get(&instance);
            let outcome = if untouched.nodes.contains(&instance) {
                match restored(running, was) {
                    Restored::Accepted => Carry::Carried,
                    Restored::Migrated { from } => Carry::Migrated { from },
                    Restored::Cold { reason } => begin(reason),
                }
            } else {
                let (reason, useful) = changed(node);
                match was
                    .filter(|_| useful)
                    .map(|was| restored(running, Some(was)))
                {
                    Some(Restored::Accepted) => Carry::Adopted { reason },
                    Some(Restored::Migrated { from }) => Carry::Migrated { from },
                    Some(Restored::Cold { reason: why }) => begin(format!("{reason}: {why}")),
                    None => begin(reason),
                }
            };
            carried.push(NodeCarry {
                node: instance,
                outcome,
            });
        }
        self.adopt_slots(state, untouched);
        carried
    }

    fn adopt_slots(&mut self, state: &EngineState, untouched: &Untouched) {
        for (slot, channel) in self.plan.channels.iter().enumerate() {
            if !untouched.channels.contains(&channel.name) {
                continue;
            }
            if let Some(was) = state.slots.get(&channel.name) {
                self.slots.values[slot] = was.value;
                self.slots.stamps[slot] = was.stamp;
                self.slots.written[slot] = was.written;
            }
            if let (Some(history), Some(was)) = (
                &mut self.histories[slot],
                state.histories.get(&channel.name),
            ) {
                history.adopt(was);
            }
        }
        for gathered in &mut self.gathered {
            gathered.forget_places();
        }
        for (count, source) in self.rejected.iter_mut().zip(&self.plan.sources) {
            *count = state.rejected.get(&source.name).copied().unwrap_or(0);
        }
        for ((_, blending), output) in self.blending.iter_mut().zip(&self.plan.outputs) {
            if let Some(was) = state.blending.get(&output.name) {
                blending.hand_over(was);
            }
        }
        self.slots.tick = state.tick;
        self.last = state.last;
        self.before_break = state.before_break;
        self.refused = state.refused;
    }
}

/// What a node answers to a state.
fn restored(running: &mut Running, state: Option<&NodeState>) -> Restored {
    let Some(state) = state else {
        return Restored::cold("nothing is known of it");
    };
    match running {
        Running::Operator { operator, .. } => match state.unpack() {
            Ok(Some(own)) => operator.restore(own),
            Ok(None) => Restored::Accepted,
            Err(cold) => cold,
        },
        Running::Estimate { .. } => Restored::Accepted,
        Running::Vote(vote) => vote.restore(state),
    }
}
