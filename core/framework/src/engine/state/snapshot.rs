//! The state of an engine taken down, and restored in the same or in another engine.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::engine_state::{NodeState, SlotState};
use super::transfer::{Begin, Carry, NodeCarry, StateTransfer};
use crate::channel::Extremes;
use crate::compile::origins::Dependents;
use crate::compile::{Plan, PlannedRole};
use crate::engine::tick::Estimate;
use crate::engine::tick::NodeRunner;
use crate::engine::{Engine, EngineState, RestoreError, When, naming, naming_one, with_history};
use crate::node::Restored;
use crate::node::SlotTime;

impl Engine {
    /// All that the engine knows, as self-describing bytes.
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
                expected: expected.to_owned(),
            });
        }
        let mut fresh = Self::new(Arc::clone(&self.plan), &self.fitted).map_err(|error| {
            RestoreError::Unreadable {
                reason: error.to_string(),
            }
        })?;
        if let Some((node, reason)) = fresh.go_on(&state) {
            return Err(RestoreError::Refused { node, reason });
        }
        *self = fresh;
        Ok(())
    }

    /// An engine that knows the same and goes on with the same bits, without the nodes that were given up.
    ///
    /// # Errors
    /// When a node does not take its own state back.
    pub fn twin(&self) -> Result<Self, RestoreError> {
        self.twin_on(&self.plan)
    }

    /// The same on a plan that computes more or less of what nothing reads: this one's, as [`Plan::looked_into`] gives it, or back.
    ///
    /// # Errors
    /// As [`twin`](Self::twin).
    pub fn twin_on(&self, plan: &Arc<Plan>) -> Result<Self, RestoreError> {
        let mut twin = Self::new(Arc::clone(plan), &self.fitted)
            .expect("what was fitted belongs to the plan, or there would be no engine to copy");
        twin.revision.clone_from(&self.revision);
        match twin.go_on(&self.state()) {
            None => {
                twin.isolate_as(self);
                Ok(twin)
            }
            Some((node, reason)) => Err(RestoreError::Refused { node, reason }),
        }
    }

    /// Goes on from a state of the same graph and fit; the first node that does not, and why.
    fn go_on(&mut self, state: &EngineState) -> Option<(String, String)> {
        let carried = self.adopt(state, &StateTransfer::all(&self.plan), false);
        carried.into_iter().find_map(|node| match node.outcome {
            Carry::Cold { reason } | Carry::Warmed { reason } => Some((node.node, reason)),
            Carry::Carried | Carry::Adopted { .. } => None,
        })
    }

    /// Takes over from another engine: outputs pass over from what it put out last, where `from` says which of its outputs
    /// each follows, and what is frozen on command stays so.
    pub fn pass_over(&mut self, before: &Self, from: &[Option<usize>]) {
        self.outputs.take_over(&before.outputs, from);
        self.refused = before.refused;
        // Whoever made this engine ready may have missed the command.
        self.frozen = before.frozen;
    }

    /// All that the engine knows, by name.
    #[must_use]
    pub fn state(&self) -> EngineState {
        let plan = &self.plan;
        let sources = || plan.sources.iter().map(|source| source.name.clone());
        let channels = || plan.channels.iter().map(|channel| channel.name.clone());
        let outputs = plan.outputs.iter().enumerate();
        let values = self.slots.values.iter().zip(&self.slots.given);
        let slots = values.map(|(&value, given)| SlotState {
            value,
            stamp: given.stamp,
            written: given.tick,
        });
        let histories = with_history(plan).zip(&self.histories);
        EngineState {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            revision: self.revision().to_owned(),
            tick: self.slots.tick,
            last: self.last,
            before_break: self.before_break,
            frozen: self.frozen,
            rejected: sources().zip(self.rejected.iter().copied()).collect(),
            refused: self.refused,
            extremes: sources().zip(self.extremes.iter().copied()).collect(),
            slots: channels().zip(slots).collect(),
            histories: histories
                .map(|(slot, history)| (plan.channels[slot].name.clone(), history.clone()))
                .collect(),
            nodes: self.node_states(),
            courses: (self.leaps.courses.iter())
                .map(|(slot, course)| (plan.channels[*slot].name.clone(), course.clone()))
                .collect(),
            blending: outputs
                .map(|(index, output)| (output.name.clone(), self.outputs.blending(index)))
                .collect(),
        }
    }

    fn node_states(&self) -> BTreeMap<String, NodeState> {
        naming(&self.plan, When::Tick(self.last), |at_work| {
            let nodes = self.plan.nodes.iter().zip(&self.nodes).enumerate();
            let states = nodes.map(|(index, (node, runner))| {
                at_work.is(index);
                let state = match runner {
                    NodeRunner::Operator(node) => NodeState::pack(node.operator.snapshot()),
                    NodeRunner::Estimate(node) => {
                        let estimate = node.estimate.as_ref();
                        estimate.map(Estimate::snapshot).unwrap_or_default()
                    }
                    NodeRunner::Vote(vote) => vote.snapshot(),
                };
                (node.instance(), state)
            });
            states.collect()
        })
    }

    /// Goes on from a state of this or another graph, as far as the transfer goes.
    ///
    /// `warmed`: whether this engine has been stepped over the past, so that what is not carried is not cold.
    pub fn adopt(
        &mut self,
        state: &EngineState,
        transfer: &StateTransfer,
        warmed: bool,
    ) -> Vec<NodeCarry> {
        let plan = Arc::clone(&self.plan);
        let afresh = |reason: String| {
            if warmed {
                Carry::Warmed { reason }
            } else {
                Carry::Cold { reason }
            }
        };
        let mut carried = Vec::with_capacity(plan.nodes.len());
        let mut refusing = vec![false; plan.nodes.len()];
        for (index, (node, running)) in plan.nodes.iter().zip(&mut self.nodes).enumerate() {
            let was = state.nodes.get(&node.instance());
            let mut restored = || naming_one(&plan, index, When::Start, || restored(running, was));
            let outcome = match &transfer.nodes[index] {
                Begin::AsItWas => match restored() {
                    Restored::Accepted => Carry::Carried,
                    Restored::Cold { reason } => {
                        refusing[index] = true;
                        afresh(reason)
                    }
                },
                Begin::Offered { reason } => match restored() {
                    Restored::Accepted => Carry::Adopted {
                        reason: reason.clone(),
                    },
                    Restored::Cold { reason: why } => afresh(format!("{reason}: {why}")),
                },
                Begin::Afresh { reason } => afresh(reason.clone()),
            };
            carried.push(NodeCarry {
                node: node.instance(),
                outcome,
            });
        }
        self.adopt_slots(state, transfer, &refusing);
        if refusing.contains(&true) {
            // What hangs on a node that begins afresh has its old state, but will not go on as if nothing had happened.
            let touched = Dependents::of(&plan, &[], |node| refusing[node]);
            for (node, carry) in plan.nodes.iter().zip(&mut carried) {
                let read = plan.reads(node).find(|&slot| touched.slots[slot]);
                if let (Carry::Carried, Some(slot)) = (&carry.outcome, read) {
                    let name = &plan.channels[slot].name;
                    carry.outcome = Carry::Adopted {
                        reason: format!("`{name}`, which it reads, does not go on as it was"),
                    };
                }
            }
        }
        carried
    }

    fn adopt_slots(&mut self, state: &EngineState, transfer: &StateTransfer, refusing: &[bool]) {
        let goes_on = |slot: usize| {
            let refuses = self.plan.channels[slot].node.is_some_and(|of| refusing[of]);
            transfer.slots[slot] && !refuses
        };
        for (slot, channel) in self.plan.channels.iter().enumerate() {
            if let Some(was) = state.slots.get(&channel.name)
                && goes_on(slot)
            {
                self.slots.values[slot] = was.value;
                self.slots.given[slot] = SlotTime {
                    stamp: was.stamp,
                    tick: was.written,
                };
            }
        }
        for (slot, history) in with_history(&self.plan).zip(&mut self.histories) {
            if let Some(was) = state.histories.get(&self.plan.channels[slot].name)
                && goes_on(slot)
            {
                history.adopt(was);
            }
        }
        for (slot, course) in &mut self.leaps.courses {
            if let Some(was) = state.courses.get(&self.plan.channels[*slot].name)
                && transfer.slots[*slot]
            {
                course.clone_from(was);
            }
        }
        for gathered in &mut self.gathered {
            gathered.forget_places();
        }
        let counts = self.rejected.iter_mut().zip(&mut self.extremes);
        for ((count, extremes), source) in counts.zip(&self.plan.sources) {
            *count = state.rejected.get(&source.name).copied().unwrap_or(0);
            let was = state.extremes.get(&source.name);
            *extremes = was.copied().unwrap_or(Extremes::NONE);
        }
        for (index, output) in self.plan.outputs.iter().enumerate() {
            if let Some(was) = state.blending.get(&output.name)
                && transfer.outputs[index]
            {
                self.outputs.go_on(index, *was);
            }
        }
        self.slots.tick = state.tick;
        self.last = state.last;
        self.before_break = state.before_break;
        self.refused = state.refused;
        self.frozen = state.frozen;
        // A segment may end before the next tick, and what freezes learning then decides what is learned of it.
        for node in &self.plan.nodes {
            if let PlannedRole::Estimator {
                learning: Some(learning),
                ..
            } = &node.role
                && let Some(freeze) = learning.freeze
            {
                let of = &self.plan.gathers[freeze];
                self.gathered[freeze].read(of, &self.slots, &self.histories, self.last);
            }
        }
    }
}

/// What a node answers to a state.
fn restored(running: &mut NodeRunner, state: Option<&NodeState>) -> Restored {
    let Some(state) = state else {
        return Restored::cold("nothing is known of it");
    };
    match running {
        NodeRunner::Operator(node) => match state.unpack() {
            Ok(Some(own)) => node.operator.restore(own),
            Ok(None) => Restored::Accepted,
            Err(cold) => cold,
        },
        NodeRunner::Estimate(node) => match &mut node.estimate {
            Some(estimate) => estimate.restore(state),
            None => Restored::Accepted,
        },
        NodeRunner::Vote(vote) => vote.restore(state),
    }
}
