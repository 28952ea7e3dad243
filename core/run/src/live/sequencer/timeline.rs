//! What has been accepted and waits for a tick: the same live, in the journal and in a replay.

use std::collections::VecDeque;

use super::Sample;
use crate::channel::ABSENT;
use crate::time::{Duration, Instant};

/// One in so many of the samples that may wait for their tick may wait to be decided on.
pub(super) const WAITING: usize = 4;

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
    /// The least lag of each source behind the host.
    lags: Vec<Option<Duration>>,
    /// What is too far ahead and not decided on, in the order of arrival.
    waiting: VecDeque<Sample>,
    row: Vec<f64>,
}

impl Timeline {
    /// That of so many channels and sources before the first sample.
    #[must_use]
    pub fn new(channels: usize, sources: usize) -> Self {
        Self {
            pending: VecDeque::new(),
            stamps: vec![Instant::MIN; channels],
            last: Instant::MIN,
            offsets: vec![None; sources],
            lags: vec![None; sources],
            waiting: VecDeque::new(),
            row: vec![ABSENT; channels],
        }
    }

    /// One that goes on from a place in a log: the last tick, the newest stamps of channels, the offsets and least lags of sources.
    #[must_use]
    pub fn resume(
        last: Instant,
        stamps: Vec<Instant>,
        (offsets, lags): (Vec<Option<Duration>>, Vec<Option<Duration>>),
        pending: &[Sample],
        waiting: Vec<Sample>,
    ) -> Self {
        let mut timeline = Self {
            pending: VecDeque::with_capacity(pending.len()),
            row: vec![ABSENT; stamps.len()],
            stamps,
            last,
            offsets,
            lags,
            waiting: waiting.into(),
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
        self.decided(sample);
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

    /// Keeps a sample until it is decided on.
    pub fn wait(&mut self, sample: Sample) {
        self.waiting.push_back(sample);
    }

    /// A sample is decided on: it no longer waits for that.
    pub fn decided(&mut self, sample: Sample) {
        let key = |of: &Sample| (of.stamp, of.channel);
        let mut waiting = self.waiting.iter();
        if let Some(place) = waiting.position(|of| key(of) == key(&sample)) {
            self.waiting.remove(place);
        }
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

    /// A source lags behind the host by so much at the least.
    pub fn lag(&mut self, source: usize, least: Duration) {
        if let Some(of) = self.lags.get_mut(source) {
            *of = Some(least);
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

    /// The least lag of each source behind the host, where that is known.
    #[must_use]
    pub fn lags(&self) -> &[Option<Duration>] {
        &self.lags
    }

    /// The samples that are not decided on, in the order of their arrival.
    #[must_use]
    pub fn waiting(&self) -> &VecDeque<Sample> {
        &self.waiting
    }

    /// The next sample that is not decided on, which no longer waits for that.
    pub(super) fn next_waiting(&mut self) -> Option<Sample> {
        self.waiting.pop_front()
    }

    /// The samples that wait, by stamp, then channel.
    pub fn pending(&self) -> impl ExactSizeIterator<Item = &Sample> {
        self.pending.iter()
    }

    /// The first instant of the next tick and its last sample, where instants within `join` are one; none where nothing waits that is
    /// after the last one.
    pub(super) fn next(&self, join: Duration) -> Option<(Instant, Sample)> {
        let first = self.pending.partition_point(|of| of.stamp <= self.last);
        let first = self.pending.get(first)?.stamp;
        let end = self.pending.partition_point(|of| of.stamp <= first + join);
        Some((first, self.pending[end - 1]))
    }

    /// Makes room for so many channels, sources and samples. What waits for channels beyond is dropped.
    pub(super) fn fit(&mut self, channels: usize, sources: usize, room: usize) {
        self.stamps.resize(channels, Instant::MIN);
        self.row.resize(channels, ABSENT);
        self.offsets.resize(sources, None);
        self.lags.resize(sources, None);
        self.waiting.retain(|of| (of.channel as usize) < channels);
        self.waiting.reserve(room / WAITING);
        self.pending.retain(|of| (of.channel as usize) < channels);
        self.pending
            .reserve(room.saturating_sub(self.pending.len()));
    }

    /// How many samples wait.
    pub(super) fn len(&self) -> usize {
        self.pending.len()
    }
}
