//! How far the journal is: what may leave the program, and what may be acknowledged.

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant as Clock};

use crate::bell::{Bell, Bells};
use crate::checkpoint::StateDesk;

/// How far the journal is. Shared by all threads.
#[derive(Debug, Default)]
pub struct Progress {
    written: AtomicU64,
    synced: AtomicU64,
    synced_happenings: AtomicU64,
    lost: AtomicU64,
    failures: AtomicU64,
    /// Whether the disk has failed, and it is not yet time to try again.
    failed: AtomicBool,
    /// Whether it has failed, and nothing has been written since.
    is_broken: AtomicBool,
    /// Whether somebody waited in vain, and nothing has been written since.
    is_stuck: AtomicBool,
    error: Mutex<Option<String>>,
    /// Of those who wait for more to be written.
    bells: Bells,
    /// Where the control thread gets checkpoints from.
    pub(crate) desk: StateDesk,
}

/// How the journal is, for a status.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct JournalStatus {
    /// How many records have been handed to the system.
    pub written: u64,
    /// How many of them are on the disk.
    pub synced: u64,
    /// How many records were never written.
    pub lost: u64,
    /// How often writing failed.
    pub failures: u64,
    /// Whether the program goes on without its journal at the moment.
    pub is_degraded: bool,
    /// What the system said last.
    pub error: Option<String>,
}

impl Progress {
    /// All records below this number have been handed to the system: they survive the end of the program.
    #[must_use]
    pub fn written(&self) -> u64 {
        self.written.load(Ordering::Acquire)
    }

    /// All records below this number are on the disk: they survive a power cut.
    #[must_use]
    pub fn synced(&self) -> u64 {
        self.synced.load(Ordering::Acquire)
    }

    /// So many ticks, beats, breaks and freezes are on the disk.
    #[must_use]
    pub fn synced_happenings(&self) -> u64 {
        self.synced_happenings.load(Ordering::Acquire)
    }

    /// Whether the program goes on without its journal at the moment.
    #[must_use]
    pub fn is_degraded(&self) -> bool {
        self.is_broken.load(Ordering::Acquire) || self.is_stuck.load(Ordering::Acquire)
    }

    /// Waits until all records below a number are written, but no longer than so long: what comes of them may leave then. False where
    /// they are not written. While the disk fails or hangs, nobody waits again.
    #[must_use]
    pub fn wait_written(&self, below: u64, patience: Duration) -> bool {
        if self.written() >= below {
            return true;
        }
        let (until, bell) = (Clock::now() + patience, Bell::here());
        self.bells.add(&bell);
        let is_written = loop {
            if self.written() >= below || self.is_degraded() {
                break self.written() >= below;
            }
            let left = until.saturating_duration_since(Clock::now());
            if left.is_zero() {
                self.is_stuck.store(true, Ordering::Release);
                break false;
            }
            std::thread::park_timeout(left);
        };
        self.bells.remove(&bell);
        is_written
    }

    /// From now on it rings where more is written, on the disk, or will not be. Rung by the journal thread.
    pub fn wakes(&self, bell: &Bell) {
        self.bells.add(bell);
    }

    pub(super) fn ring(&self) {
        self.bells.ring();
    }

    /// How the journal is.
    #[must_use]
    pub fn status(&self) -> JournalStatus {
        let error = self.error.lock().map_or(None, |error| error.clone());
        JournalStatus {
            written: self.written(),
            synced: self.synced(),
            lost: self.lost.load(Ordering::Relaxed),
            failures: self.failures.load(Ordering::Relaxed),
            is_degraded: self.is_degraded(),
            error,
        }
    }

    pub(crate) fn failed(&self) -> bool {
        self.failed.load(Ordering::Acquire)
    }

    pub(super) fn set_written(&self, below: u64) {
        self.written.store(below, Ordering::Release);
        self.is_stuck.store(false, Ordering::Release);
        self.is_broken.store(false, Ordering::Release);
    }

    pub(super) fn set_synced(&self, below: u64, happenings: u64) {
        self.synced_happenings
            .fetch_max(happenings, Ordering::AcqRel);
        self.synced.fetch_max(below, Ordering::AcqRel);
    }

    pub(super) fn failures(&self) -> u64 {
        self.failures.load(Ordering::Acquire)
    }

    pub(super) fn lose(&self, records: u64) {
        self.lost.fetch_add(records, Ordering::Relaxed);
    }

    pub(super) fn fail(&self, error: &std::io::Error) {
        if let Ok(mut last) = self.error.lock() {
            *last = Some(error.to_string());
        }
        self.is_broken.store(true, Ordering::Release);
        self.failed.store(true, Ordering::Release);
        // Last: who sees the number sees the rest.
        self.failures.fetch_add(1, Ordering::AcqRel);
    }

    pub(super) fn try_again(&self) {
        self.failed.store(false, Ordering::Release);
    }
}
