//! What has been accepted and waits for a tick: the same live, in the journal and in a replay.

use std::collections::VecDeque;

use super::Sample;
use crate::channel::ABSENT;
use crate::time::{Duration, Instant};

/// Accepted samples on their way into ticks. It has no clock and no thresholds: whatever is decided is applied.
#[derive(Debug, Clone, PartialEq)]
pub struct Timeline {
    /// By stamp, then channel; each pair once.
    pending: VecDeque<Sample>,
    /// The stamp of each channel's newest sample that went into a tick.
    stamps: Vec<Instant>,
    last: Instant,
    /// What is added to the stamps of each source.
    offsets: Vec<Option<Duration>>,
    row: Vec<f64>,
}

impl Timeline {
    /// That of so many channels and sources before the first sample, with room for so many samples.
    #[must_use]
    pub fn new(channels: usize, sources: usize, room: usize) -> Self {
        Self {
            pending: VecDeque::with_capacity(room),
            stamps: vec![Instant::MIN; channels],
            last: Instant::MIN,
            offsets: vec![None; sources],
            row: vec![ABSENT; channels],
        }
    }

    /// One that goes on from a place in a log: the last tick, the newest stamps of channels and the offsets of sources.
    #[must_use]
    pub fn resume(
        last: Instant,
        stamps: Vec<Instant>,
        offsets: Vec<Option<Duration>>,
        pending: &[Sample],
    ) -> Self {
        let mut timeline = Self {
            pending: VecDeque::with_capacity(pending.len()),
            row: vec![ABSENT; stamps.len()],
            stamps,
            last,
            offsets,
        };
        for &sample in pending {
            timeline.accept(sample);
        }
        timeline
    }

    /// Lets a sample wait for its tick. False where its channel has a sample of this stamp that waits, or is unknown.
    pub fn accept(&mut self, sample: Sample) -> bool {
        if sample.channel as usize >= self.stamps.len() {
            return false;
        }
        let key = |of: &Sample| (of.stamp, of.channel);
        match self.pending.back() {
            Some(newest) if key(newest) >= key(&sample) => {
                match self.pending.binary_search_by_key(&key(&sample), key) {
                    Ok(_) => return false,
                    Err(place) => self.pending.insert(place, sample),
                }
            }
            _ => self.pending.push_back(sample),
        }
        true
    }

    /// Takes all that waits up to an instant: a value for each channel, the newest where there are several.
    pub fn tick(&mut self, at: Instant) -> &[f64] {
        self.row.fill(ABSENT);
        while let Some(sample) = self.pending.front().filter(|of| of.stamp <= at) {
            let channel = sample.channel as usize;
            self.row[channel] = sample.value;
            self.stamps[channel] = self.stamps[channel].max(sample.stamp);
            self.pending.pop_front();
        }
        self.last = at;
        &self.row
    }

    /// What follows belongs to another segment; `afresh`: its times may start again.
    pub fn segment(&mut self, afresh: bool) {
        self.pending.clear();
        if afresh {
            self.stamps.fill(Instant::MIN);
            self.last = Instant::MIN;
        }
    }

    /// The stamps of a source are shifted from now on.
    pub fn shift(&mut self, source: usize, offset: Duration) {
        if let Some(of) = self.offsets.get_mut(source) {
            *of = Some(offset);
        }
    }

    /// Nothing is stepped up to an instant any more: what waits there is dropped.
    pub fn not_before(&mut self, last: Instant) {
        self.pending.retain(|of| of.stamp > last);
        self.last = self.last.max(last);
    }

    /// The last tick; [`Instant::MIN`] before the first.
    #[must_use]
    pub fn last(&self) -> Instant {
        self.last
    }

    /// The stamp of each channel's newest sample that went into a tick; [`Instant::MIN`] before the first.
    #[must_use]
    pub fn stamps(&self) -> &[Instant] {
        &self.stamps
    }

    /// What is added to the stamps of each source, where that is something.
    #[must_use]
    pub fn offsets(&self) -> &[Option<Duration>] {
        &self.offsets
    }

    /// The samples that wait, by stamp, then channel.
    pub fn pending(&self) -> impl ExactSizeIterator<Item = &Sample> {
        self.pending.iter()
    }

    /// The instant of the next tick where instants within `join` are one; none where nothing waits that is after the last one.
    pub(super) fn next(&self, join: Duration) -> Option<(Instant, Instant)> {
        let first = self.pending.partition_point(|of| of.stamp <= self.last);
        let first = self.pending.get(first)?.stamp;
        let end = self.pending.partition_point(|of| of.stamp <= first + join);
        Some((first, self.pending[end - 1].stamp))
    }

    /// Makes room for so many channels, sources and samples. What waits for channels beyond is dropped.
    pub(super) fn fit(&mut self, channels: usize, sources: usize, room: usize) {
        self.stamps.resize(channels, Instant::MIN);
        self.row.resize(channels, ABSENT);
        self.offsets.resize(sources, None);
        self.pending.retain(|of| (of.channel as usize) < channels);
        self.pending
            .reserve(room.saturating_sub(self.pending.len()));
    }

    /// How many samples wait.
    pub(super) fn len(&self) -> usize {
        self.pending.len()
    }
}
