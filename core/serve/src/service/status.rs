//! What a service knows of itself, for whoever asks.

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64};

use crate::sequencer::Counts;
use crate::time::{Duration, Instant};

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
            snapshot: Mutex::new(Snapshot {
                counts: vec![Counts::default(); channels],
                hurried: 0,
                waiting: 0,
                happenings: 0,
                last: Instant::MIN,
                newest: None,
                stamps: vec![Instant::MIN; channels],
                is_synchronised: false,
                outside: vec![0; channels],
                ticks: 0,
                beats: 0,
            }),
        }
    }

    /// What was published last.
    pub(super) fn read(&self) -> Snapshot {
        let snapshot = self.snapshot.lock();
        snapshot.map_or_else(|poisoned| poisoned.into_inner().clone(), |of| of.clone())
    }
}

/// What the engine thread knew when it last published.
#[derive(Debug, Clone)]
pub struct Snapshot {
    /// What became of the samples of each channel.
    pub counts: Vec<Counts>,
    /// How many ticks were cut early because too many samples waited.
    pub hurried: u64,
    /// How many samples are too far ahead and not decided on.
    pub waiting: usize,
    /// How many ticks, beats, breaks and freezes there were, those of earlier runs included.
    pub happenings: u64,
    /// The last tick.
    pub last: Instant,
    /// The newest stamp, and the time since.
    pub newest: Option<Instant>,
    /// The stamp of each channel's newest sample that was stepped; [`Instant::MIN`] before the first.
    pub stamps: Vec<Instant>,
    /// Whether the host's time is known to be right. Until then clocks of sources are not judged by it.
    pub is_synchronised: bool,
    /// How many accepted samples of each channel are infinite or outside of the range of their signal, and absent at their ticks.
    pub outside: Vec<u64>,
    /// How many ticks were stepped since the start: those that samples made…
    pub ticks: u64,
    /// …and those that time alone did.
    pub beats: u64,
}
