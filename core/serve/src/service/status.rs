//! What a service knows of itself, for whoever asks.

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64};

use athermal_run::live::Snapshot;

use crate::time::Duration;

/// What the engine thread publishes.
#[derive(Debug)]
pub(super) struct Shared {
    /// Grows for as long as the engine thread lives.
    pub(super) beat: AtomicU64,
    /// Whether it has come to its end.
    pub(super) has_ended: AtomicBool,
    pub(super) snapshot: Mutex<Snapshot>,
}

impl Shared {
    /// How often the engine thread publishes: not before, where it is awake, and not after. So it is seldom woken for that alone.
    pub(super) const EVERY: (Duration, Duration) = (
        Duration::from_ns(900_000_000),
        Duration::from_ns(1_100_000_000),
    );

    pub(super) fn new(channels: usize) -> Self {
        Self {
            beat: AtomicU64::new(0),
            has_ended: AtomicBool::new(false),
            snapshot: Mutex::new(Snapshot::new(channels)),
        }
    }

    /// What was published last.
    pub(super) fn read(&self) -> Snapshot {
        let snapshot = self.snapshot.lock();
        snapshot.map_or_else(|poisoned| poisoned.into_inner().clone(), |of| of.clone())
    }
}
