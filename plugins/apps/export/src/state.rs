//! An engine's snapshot as the saved state of its exported graph, and back.
//!
//! What stands in both goes over to the bit. An output that is passing over from one graph to the next does so no more in C, which has no
//! graph to pass over to.

mod courses;
mod image;
mod learners;
mod nodes;
mod snapshot;
mod votes;

use athermal_core::engine::{Engine, fnv_1a};
use thiserror::Error;

use crate::form::Form;
use image::Image;
use snapshot::{Slot, Snapshot};

/// Why a state is not taken over.
#[derive(Debug, Error)]
pub enum CarryError {
    /// The bytes are no state of the exported graph.
    #[error(
        "these bytes are no state that `{name}_save` wrote in double precision for revision {revision}: {reason}"
    )]
    NotASave {
        /// The graph.
        name: String,
        /// Its revision.
        revision: String,
        /// What is wrong with them.
        reason: &'static str,
    },
    /// The state of a node has another form than this version knows.
    #[error("the state of `{node}` cannot be read: {reason}")]
    Unreadable {
        /// The node.
        node: String,
        /// Why.
        reason: String,
    },
    /// The engine does not take it.
    #[error(transparent)]
    Engine(#[from] athermal_core::engine::RestoreError),
}

impl CarryError {
    fn of(node: &str, error: impl std::fmt::Display) -> Self {
        Self::Unreadable {
            node: node.to_owned(),
            reason: error.to_string(),
        }
    }
}

/// What `NAME_load` takes, of what an engine knows.
///
/// # Errors
/// When the state of a node has a form that this version does not know.
pub fn to_c(engine: &Engine, form: &Form) -> Result<Vec<u8>, CarryError> {
    let state = Snapshot::read(&engine.state())?;
    let mut image = Image::new(form);
    image.ints[0] = state.tick as i64;
    if state.last > i64::MIN {
        (image.ints[1], image.ints[2]) = (state.last, 1);
    }
    if let Some(before) = state.before_break {
        (image.ints[3], image.ints[4]) = (1, before);
    }
    image.ints[5] = state.refused as i64;
    let layout = form.layout;
    for (nth, name) in form.slots.iter().enumerate() {
        if let Some(slot) = state.slots.get(name) {
            image.reals[layout.slot_reals + nth] = slot.value;
            image.ints[layout.slot_ints + nth] = slot.stamp;
            image.ints[layout.slot_ints + form.slots.len() + nth] = slot.written as i64;
        }
    }
    for (nth, source) in form.sources.iter().enumerate() {
        let rejected = state.rejected.get(&source.name).copied().unwrap_or(0);
        image.ints[layout.rejected_ints + nth] = rejected as i64;
    }
    for history in &form.histories[..form.recorded] {
        let name = history.slot.map(|slot| &form.slots[slot]);
        if let Some(past) = name.and_then(|name| state.histories.get(name)) {
            image.put_history(history, past);
        }
    }
    for course in form.courses() {
        if let Some(known) = state.courses.get(&course.node) {
            image.put_course(course, known);
        }
    }
    for node in &form.nodes {
        if let Some(known) = state.nodes.get(&node.node) {
            nodes::put(&mut image, form, node, known)?;
        }
    }
    Ok(image.to_bytes(fnv_1a(form.revision.as_bytes())))
}

/// Lets an engine of the graph go on from what `NAME_save` wrote.
///
/// # Errors
/// When the bytes are no such state: the engine is as it was.
pub fn from_c(engine: &mut Engine, form: &Form, saved: &[u8]) -> Result<(), CarryError> {
    let image = Image::from_bytes(saved, form, fnv_1a(form.revision.as_bytes()));
    let image = image.map_err(|reason| CarryError::NotASave {
        name: form.name.clone(),
        revision: form.revision.clone(),
        reason,
    })?;
    // Of a cold engine the names, units and limits stay.
    let cold = Engine::new(engine.plan().clone(), engine.fitted());
    let cold = cold.map_err(|error| CarryError::of(&form.title, error))?;
    let mut state = Snapshot::read(&cold.state())?;
    state.tick = image.ints[0] as u64;
    state.last = if image.ints[2] == 0 {
        i64::MIN
    } else {
        image.ints[1]
    };
    state.before_break = (image.ints[3] != 0).then_some(image.ints[4]);
    state.refused = image.ints[5] as u64;
    let layout = form.layout;
    for (nth, name) in form.slots.iter().enumerate() {
        let slot = Slot {
            value: image.reals[layout.slot_reals + nth],
            stamp: image.ints[layout.slot_ints + nth],
            written: image.ints[layout.slot_ints + form.slots.len() + nth] as u64,
        };
        state.slots.insert(name.clone(), slot);
    }
    for (nth, source) in form.sources.iter().enumerate() {
        let rejected = image.ints[layout.rejected_ints + nth] as u64;
        state.rejected.insert(source.name.clone(), rejected);
    }
    for history in &form.histories[..form.recorded] {
        let name = history.slot.map(|slot| &form.slots[slot]);
        if let Some(past) = name.and_then(|name| state.histories.get_mut(name)) {
            past.entries = image.history(history);
        }
    }
    for course in form.courses() {
        let known = image.course(course);
        state.courses.insert(course.node.clone(), known);
    }
    for node in &form.nodes {
        if let Some(known) = state.nodes.get_mut(&node.node) {
            nodes::take(&image, form, node, known)?;
        }
    }
    let state = state.write(&form.title)?;
    Ok(engine.restore(&state.to_bytes())?)
}
