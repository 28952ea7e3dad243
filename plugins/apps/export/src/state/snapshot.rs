//! The form of an engine's snapshot, field by field: what is not read here is passed on as it is.

use std::collections::BTreeMap;

use athermal_core::engine::EngineState;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::CarryError;

#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Snapshot {
    version: String,
    revision: String,
    pub(super) tick: u64,
    pub(super) last: i64,
    pub(super) before_break: Option<i64>,
    pub(super) rejected: BTreeMap<String, u64>,
    pub(super) refused: u64,
    pub(super) slots: BTreeMap<String, Slot>,
    pub(super) histories: BTreeMap<String, Past>,
    pub(super) nodes: BTreeMap<String, Node>,
    blending: BTreeMap<String, Value>,
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub(super) courses: BTreeMap<String, Course>,
    frozen: bool,
}

/// A series in which leaps are looked for.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Course {
    pub(super) last: Option<(i64, f64)>,
    pub(super) newest: Option<(i64, f64)>,
    pub(super) before: Option<f64>,
    pub(super) changes: Sizes,
    pub(super) steps: Sizes,
    pub(super) bends: Sizes,
    pub(super) gap: f64,
    pub(super) gaps: u32,
    pub(super) leapt: Option<i64>,
    pub(super) suspected: Option<i64>,
    pub(super) homes: [f64; 8],
    pub(super) homed: usize,
}

#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Sizes {
    pub(super) of: [f64; 2],
    pub(super) seen: u32,
}

#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Slot {
    pub(super) value: f64,
    pub(super) stamp: i64,
    pub(super) written: u64,
}

#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Past {
    depth: String,
    pub(super) entries: Vec<PastEntry>,
    dropped: u64,
}

#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct PastEntry {
    pub(super) at: i64,
    pub(super) value: f64,
    pub(super) stamp: i64,
}

#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Node {
    pub(super) own: Option<Vec<u8>>,
    pub(super) learning: Option<Embargo>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) recent: Option<Recent>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) standing: Option<Standing>,
}

#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Recent {
    pub(super) seen: u32,
    pub(super) mean_square: f64,
    pub(super) refused: u32,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) since: Option<i64>,
    pub(super) weighed: bool,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) lesson: Option<i64>,
}

#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Standing {
    pub(super) squares: Vec<[f64; 2]>,
    pub(super) newest: usize,
    pub(super) from: Option<i64>,
    pub(super) last: Option<i64>,
}

#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Embargo {
    pub(super) pairing: Pairing,
    pub(super) withheld: Vec<Withheld>,
}

#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Pairing {
    ahead: String,
    limit: String,
    pub(super) runs: Runs,
    pub(super) past: usize,
    pub(super) number: u64,
    pub(super) needed: u64,
}

#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Runs {
    width: usize,
    pub(super) times: Vec<i64>,
    pub(super) numbers: Vec<f64>,
}

#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Withheld {
    pub(super) arrived: i64,
    pub(super) truth: f64,
    pub(super) note: f64,
    pub(super) run: u64,
}

impl Snapshot {
    pub(super) fn read(state: &EngineState) -> Result<Self, CarryError> {
        translated(state).map_err(|reason| CarryError::of("the engine", reason))
    }

    pub(super) fn write(&self, of: &str) -> Result<EngineState, CarryError> {
        translated(self).map_err(|reason| CarryError::of(of, reason))
    }
}

/// The same under other types, by the names of its fields.
fn translated<T: DeserializeOwned>(of: &impl Serialize) -> Result<T, String> {
    let written = rmp_serde::to_vec_named(of).map_err(|error| error.to_string())?;
    rmp_serde::from_slice(&written).map_err(|error| error.to_string())
}
