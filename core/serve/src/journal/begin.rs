//! What a file of the journal begins with, so that reading can begin with any of them.

use athermal_run::live::Feed;
use serde::{Deserialize, Serialize};

use crate::engine::fnv_1a;
use crate::sequencer::{Sample, Timeline};
use crate::time::{Duration, Instant};

/// The channels and sources of a journal, by place.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct FeedNames {
    /// Signal and channel, and the column in tables.
    pub channels: Vec<(String, String)>,
    /// The sources.
    pub sources: Vec<String>,
}

impl FeedNames {
    /// Those of a feed.
    #[must_use]
    pub fn new(feed: &[Feed], sources: Vec<String>) -> Self {
        let channel = |of: &Feed| (of.name.clone(), of.column.clone());
        Self {
            channels: feed.iter().map(channel).collect(),
            sources,
        }
    }

    /// A timeline of these channels and sources as one of others, by name. What waits for a channel that is not there is dropped.
    #[must_use]
    pub fn map(&self, timeline: &Timeline, to: &Self) -> Timeline {
        let place = |channel| self.channels.iter().position(|of| of == channel);
        let places: Vec<_> = to.channels.iter().map(place).collect();
        let stamp = |place: &Option<usize>| place.map_or(Instant::MIN, |of| timeline.stamps()[of]);
        let of_source = |all: &[Option<Duration>]| {
            let place = |source| self.sources.iter().position(|of| of == source);
            let of = |source| place(source).and_then(|place| all[place]);
            to.sources.iter().map(of).collect::<Vec<_>>()
        };
        let moved = |sample: &Sample| {
            let channel = places
                .iter()
                .position(|of| *of == Some(sample.channel as usize));
            channel.map(|channel| Sample {
                channel: channel as u32,
                ..*sample
            })
        };
        let pending: Vec<_> = timeline.pending().filter_map(moved).collect();
        let waiting = timeline.waiting().iter().filter_map(moved).collect();
        let (offsets, lags) = (of_source(timeline.offsets()), of_source(timeline.lags()));
        let stamps = places.iter().map(stamp).collect();
        Timeline::resume(timeline.last(), stamps, (offsets, lags), &pending, waiting)
    }

    /// A hash, for the header of a file.
    pub(super) fn hash(&self) -> u64 {
        let mut text = String::new();
        for (name, column) in &self.channels {
            text.extend([name, "\n", column, "\n"]);
        }
        for source in &self.sources {
            text.extend(["\t", source, "\n"]);
        }
        fnv_1a(text.as_bytes())
    }
}

/// Where a log is at the beginning of a file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Begin {
    /// The channels and sources.
    pub feed: FeedNames,
    /// The revision of the graph that runs.
    pub revision: String,
    /// The number of the first record.
    pub event: u64,
    /// How many ticks, beats, breaks and freezes there were before.
    pub happenings: u64,
    /// Whether the file before may end in the middle of a record, because it could not be written.
    pub after_failure: bool,
    /// Whether learning is frozen on command.
    pub frozen: bool,
    /// The last tick; [`Instant::MIN`] before the first.
    pub(super) last: Instant,
    /// The stamp of each channel's newest sample that was stepped.
    pub(super) stamps: Vec<Instant>,
    /// What is added to the stamps of each source, in ns.
    pub(super) offsets: Vec<Option<i64>>,
    /// What waits: channel, stamp, and the bits of the value.
    pub(super) pending: Vec<(u32, Instant, u64)>,
    /// The least lag of each source, in ns.
    #[serde(default)]
    pub(super) lags: Vec<Option<i64>>,
    /// What is not decided on.
    #[serde(default)]
    pub(super) waiting: Vec<(u32, Instant, u64)>,
}

impl Begin {
    /// The beginning of a journal, or of its next file after a restart.
    #[must_use]
    pub fn new(
        feed: FeedNames,
        revision: String,
        (event, happenings): (u64, u64),
        frozen: bool,
        timeline: &Timeline,
    ) -> Self {
        let mut begin = Self {
            feed,
            revision,
            event,
            happenings,
            after_failure: false,
            frozen,
            last: Instant::MIN,
            stamps: Vec::new(),
            offsets: Vec::new(),
            pending: Vec::new(),
            lags: Vec::new(),
            waiting: Vec::new(),
        };
        begin.set(timeline);
        begin
    }

    /// Before the first file.
    pub(crate) fn nothing() -> Self {
        let timeline = Timeline::new(0, 0);
        Self::new(
            FeedNames::default(),
            String::new(),
            (0, 0),
            false,
            &timeline,
        )
    }

    /// Takes over where a timeline is.
    pub(super) fn set(&mut self, timeline: &Timeline) {
        let ns = |of: &Option<Duration>| of.map(Duration::as_ns);
        self.last = timeline.last();
        self.stamps = timeline.stamps().to_vec();
        self.offsets = timeline.offsets().iter().map(ns).collect();
        self.lags = timeline.lags().iter().map(ns).collect();
        self.pending = timeline.pending().map(kept).collect();
        self.waiting = timeline.waiting().iter().map(kept).collect();
    }

    /// What waits, and what has been stepped.
    #[must_use]
    pub fn timeline(&self) -> Timeline {
        let durations = |all: &[Option<i64>]| {
            let all = all.iter().map(|of| of.map(Duration::from_ns));
            let mut all: Vec<_> = all.collect();
            all.resize(self.feed.sources.len(), None);
            all
        };
        let sample = |&(channel, stamp, bits): &(u32, Instant, u64)| Sample {
            channel,
            stamp,
            value: f64::from_bits(bits),
        };
        let pending: Vec<_> = self.pending.iter().map(sample).collect();
        let waiting = self.waiting.iter().map(sample).collect();
        let sources = (durations(&self.offsets), durations(&self.lags));
        let mut stamps = self.stamps.clone();
        stamps.resize(self.feed.channels.len(), Instant::MIN);
        Timeline::resume(self.last, stamps, sources, &pending, waiting)
    }
}

/// A sample as it is kept.
pub(super) fn kept(of: &Sample) -> (u32, Instant, u64) {
    (of.channel, of.stamp, of.value.to_bits())
}
