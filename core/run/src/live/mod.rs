//! A graph at work. A [`Session`] keeps its state, goes on after a restart, watches its sensors and outputs, and lets the graph be
//! replaced: staged, compared in the shadow, handed over between two ticks, taken back.
//!
//! Below it, [`pair`] makes two ends. The **engine thread** owns a [`Stepper`] and steps it: no allocation, no lock, no wait, also at
//! a hand-over. The **control thread** (or the same one, for recorded data) owns a [`Control`], to which every tick is
//! mirrored through a bounded ring, with what came of it. While a graph is staged or can be taken back, it steps a replica of what runs,
//! to the same bits, so that states are copied, candidates warmed and compared, and old graphs kept warm without the engine thread
//! noticing. A [`LiveGraph`] is a graph at work as its hosts have it: with both ends, or with one.
//!
//! ```text
//!  engine thread                              control thread
//!  ┌──────────┐   ticks (bounded ring)   ┌──────────────────────────────┐
//!  │ Stepper  │ ───────────────────────▶ │ replica · candidate · retained│
//!  │  engine  │ ◀─────────────────────── │ stage → shadow → commit       │
//!  └──────────┘   engines, both ways     └──────────────────────────────┘
//! ```

mod control;
mod graph;
mod handover;
mod keep;
mod moment;
pub mod monitor;
mod notice;
mod outside;
mod record;
mod refit;
mod retained;
mod run;
pub mod sequencer;
pub mod session;
mod shadow;
mod sink;
mod stage_error;
mod staged;
mod stepper;
pub mod store;
mod tick_view;

pub use control::{Control, Running};
pub use graph::{LiveGraph, Order, Output, Snapshot};
pub use handover::Feed;
pub use keep::Keep;
pub use moment::Moment;
pub use notice::Notice;
pub use record::{Record, output_hash};
pub use refit::Refit;
pub use run::{RunError, run};
pub use session::{Replacement, Report, Reporter, Session, SessionOptions};
pub use shadow::{Compared, Shadow, Verdict};
pub use sink::{Frame, Sink, SinkError};
pub use stage_error::StageError;
pub use staged::Staged;
pub use stepper::{Stepped, Stepper};
pub use store::{StateError, StateStore};
pub use tick_view::{Slots, TickView, mirrored};

use std::sync::Arc;

use crate::engine::{Engine, EngineError, RestoreError};
use crate::model::Model;
use crate::time::Duration;

/// How a graph is run so that it can be replaced.
#[derive(Debug, Clone)]
pub struct LiveOptions {
    /// How many ticks may wait for the control thread; beyond, the replica is lost and states are no longer carried. Without
    /// [`mirrors`](Self::mirrors) only 256 before the first [`pump`](Control::pump).
    pub mirrored: usize,
    /// How much of the past is kept at least, beyond what the running graph needs to warm up.
    pub retain: Duration,
    /// How many bytes of the past are kept at most.
    pub memory: usize,
    /// How long a replaced graph is kept warm, so that it can be taken back.
    pub keep_warm: Duration,
    /// Whether there is a replica all the time, and not only while something needs it.
    pub mirrors: bool,
    /// Whether a node that panics is given up, so that the graph goes on without it.
    pub isolates: bool,
    /// Channels that samples are given for, beyond those that the graph reads: what later graphs may read.
    pub channels: Vec<Feed>,
}

impl Default for LiveOptions {
    fn default() -> Self {
        Self {
            mirrored: 4096,
            retain: Duration::from_ns(3_600_000_000_000),
            memory: 256 << 20,
            keep_warm: Duration::from_ns(3_600_000_000_000),
            mirrors: true,
            isolates: false,
            channels: Vec::new(),
        }
    }
}

/// The two ends of a running graph.
///
/// # Errors
/// When what was fitted does not belong to the graph.
pub fn pair(model: &Model, options: LiveOptions) -> Result<(Stepper, Control), EngineError> {
    let engine = || Engine::new(Arc::clone(&model.plan), &model.fitted);
    Ok(control::pair(engine()?, engine()?, options))
}

/// The two ends of a graph that goes on from where an engine is.
///
/// # Errors
/// When a node does not take its own state back, so that the engine cannot be copied.
pub fn pair_from(engine: Engine, options: LiveOptions) -> Result<(Stepper, Control), RestoreError> {
    let replica = engine.twin()?;
    Ok(control::pair(engine, replica, options))
}
