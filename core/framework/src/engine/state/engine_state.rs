//! The state of an engine and its form in bytes. [`snapshot`](super::snapshot) takes it down.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::blend::Blending;
use super::revision::fnv_1a;
use crate::channel::Extremes;
use crate::compile::Plan;
use crate::engine::leap::Course;
use crate::engine::learning::EmbargoState;
use crate::engine::tick::History;
use crate::node::{RecentError, Restored, Standing, State};
use crate::time::{Duration, Instant};

/// What every snapshot begins with.
const MAGIC: &[u8; 16] = b"athermal state 1";

/// All that a running engine knows, by the names of its nodes and channels.
#[derive(Debug, Serialize, Deserialize)]
pub struct EngineState {
    /// The version of the program that wrote it.
    pub(crate) version: String,
    /// The revision of the graph that it belongs to.
    pub(crate) revision: String,
    pub(crate) tick: u64,
    pub(crate) last: Instant,
    pub(crate) before_break: Option<Instant>,
    pub(crate) rejected: BTreeMap<String, u64>,
    pub(crate) refused: u64,
    /// Between which values the samples of each channel lay: for whoever takes over in the same run.
    #[serde(skip)]
    pub(crate) extremes: BTreeMap<String, Extremes>,
    pub(crate) slots: BTreeMap<String, SlotState>,
    pub(crate) histories: BTreeMap<String, History>,
    /// What each node keeps.
    pub nodes: BTreeMap<String, NodeState>,
    pub(crate) blending: BTreeMap<String, Blending>,
    /// The series in which leaps are looked for.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub(crate) courses: BTreeMap<String, Course>,
    /// Whether learning has been frozen on command.
    pub(crate) frozen: bool,
}

/// What a slot holds.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub(crate) struct SlotState {
    pub(crate) value: f64,
    pub(crate) stamp: Instant,
    pub(crate) written: u64,
}

/// What a node knows. Its own state is kept as bytes, so that one that nobody understands spoils no other.
#[derive(Debug, Default, Serialize, Deserialize)]
pub struct NodeState {
    pub own: Option<Vec<u8>>,
    pub(crate) learning: Option<EmbargoState>,
    /// The recent error of an estimator that learns.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) recent: Option<RecentError>,
    /// How it stands beside its fit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) standing: Option<Standing>,
}

impl NodeState {
    pub(crate) fn pack(own: Option<Box<dyn State>>) -> Self {
        let own = own.map(|state| {
            rmp_serde::to_vec_named(&state).expect("a state consists of data that serde can write")
        });
        Self {
            own,
            ..Self::default()
        }
    }

    /// The node's own state, to be offered to it.
    pub(crate) fn unpack(&self) -> Result<Option<Box<dyn State>>, Restored> {
        let Some(bytes) = &self.own else {
            return Ok(None);
        };
        <dyn State>::read(bytes).map(Some).map_err(|error| {
            Restored::cold(format!(
                "this program does not understand the state: {error}"
            ))
        })
    }
}

/// Why a snapshot is not taken.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum RestoreError {
    /// The bytes are no snapshot.
    #[error("these bytes are no snapshot of an engine")]
    NotASnapshot,
    /// The bytes have changed since they were written.
    #[error("the snapshot is damaged: its checksum does not fit; use an older one")]
    Damaged,
    /// The form is one that this program does not know.
    #[error("the snapshot was written by another version: {reason}")]
    Unreadable {
        /// The message of the reader.
        reason: String,
    },
    /// The snapshot belongs to another graph or fit.
    #[error(
        "the snapshot belongs to revision {found} and the engine runs revision {expected}: load the model that it was taken of, or start \
         cold"
    )]
    OtherGraph {
        /// The revision that the snapshot belongs to.
        found: String,
        /// The revision of the engine.
        expected: String,
    },
    /// A node does not go on from its state.
    #[error("`{node}` does not go on from its state: {reason}")]
    Refused {
        /// The node.
        node: String,
        /// Why.
        reason: String,
    },
}

impl EngineState {
    /// The state as bytes: a name, a checksum, and the state as MessagePack with names.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        let payload = rmp_serde::to_vec_named(self)
            .expect("the state of an engine consists of data that serde can write");
        let mut bytes = Vec::with_capacity(MAGIC.len() + 8 + payload.len());
        bytes.extend_from_slice(MAGIC);
        bytes.extend_from_slice(&fnv_1a(&payload).to_le_bytes());
        bytes.extend_from_slice(&payload);
        bytes
    }

    /// Reads a state back.
    ///
    /// # Errors
    /// When the bytes are no state, or not as they were written.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, RestoreError> {
        let rest = bytes
            .strip_prefix(MAGIC.as_slice())
            .ok_or(RestoreError::NotASnapshot)?;
        let (checksum, payload) = rest.split_first_chunk::<8>().ok_or(RestoreError::Damaged)?;
        if fnv_1a(payload) != u64::from_le_bytes(*checksum) {
            return Err(RestoreError::Damaged);
        }
        rmp_serde::from_slice(payload).map_err(|error| RestoreError::Unreadable {
            reason: error.to_string(),
        })
    }

    /// How many bytes the nodes keep, and how many they will once all that they look back over has been filled as far as `span` is.
    #[must_use]
    pub fn held(&self, plan: &Plan, span: Duration) -> (u64, u64) {
        let nodes = plan.nodes.iter().map(|node| {
            let own = self.nodes.get(&node.instance());
            let bytes = own.and_then(|of| of.own.as_ref()).map_or(0, Vec::len);
            let filled = (span.secs() / node.memory.secs()).clamp(1e-6, 1.0);
            (bytes as u64, (bytes as f64 / filled) as u64)
        });
        nodes.fold((0, 0), |(now, full), (bytes, filled)| {
            (now + bytes, full + filled)
        })
    }

    /// The revision of the graph that the state belongs to.
    #[must_use]
    pub fn revision(&self) -> &str {
        &self.revision
    }

    /// The number of ticks that had been stepped.
    #[must_use]
    pub fn tick(&self) -> u64 {
        self.tick
    }
}
