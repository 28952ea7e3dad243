//! Rows on their way to a sink: a bounded ring of words, so that the engine thread hands them over without allocating or waiting.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use rtrb::{Consumer, Producer, RingBuffer};

use crate::connector::OutRow;
use crate::time::{Duration, Instant};
use crate::worker::Output;

/// The words before the outputs.
const HEAD: usize = 6;

/// What a sink counts.
#[derive(Debug, Default)]
pub struct SinkCounts {
    /// Rows that were put out.
    pub put: AtomicU64,
    /// Rows that there was no room for, because the sink was behind.
    pub dropped: AtomicU64,
    /// Commands that were not put out because they were too old.
    pub behind: AtomicU64,
    /// How often it failed.
    pub failures: AtomicU64,
    /// Rows that were handed to its thread, and those that the thread took.
    sent: AtomicU64,
    taken: AtomicU64,
}

impl SinkCounts {
    /// How many rows wait.
    #[must_use]
    pub fn waiting(&self) -> u64 {
        let taken = self.taken.load(Ordering::Acquire);
        self.sent.load(Ordering::Acquire).saturating_sub(taken)
    }
}

impl SinkCounts {
    /// Counts a row that was put out, or a failure.
    pub(super) fn count<E>(&self, put: &Result<(), E>) {
        let counted = if put.is_ok() {
            &self.put
        } else {
            &self.failures
        };
        counted.fetch_add(1, Ordering::Relaxed);
    }
}

/// The end that the engine thread holds.
#[derive(Debug)]
pub(super) struct FrameSender {
    ring: Producer<u64>,
    counts: Arc<SinkCounts>,
    /// For each output of the sink, its place among those of the graph that runs.
    places: Vec<Option<usize>>,
}

/// The end that the thread of a sink holds.
#[derive(Debug)]
pub(super) struct FrameReceiver {
    ring: Consumer<u64>,
    counts: Arc<SinkCounts>,
    words: Vec<u64>,
    outputs: Vec<f64>,
}

/// What goes with a row and is no business of an outlet.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ticket {
    /// It may leave once so many records are written.
    pub(super) records: u64,
    /// So many ticks, beats, breaks and freezes there are then.
    pub(super) happenings: u64,
}

/// A ring for so many rows of so many outputs.
pub(super) fn frames(
    rows: usize,
    outputs: usize,
    counts: &Arc<SinkCounts>,
) -> (FrameSender, FrameReceiver) {
    let width = HEAD + outputs;
    let (producer, consumer) = RingBuffer::new(rows.max(1) * width);
    let sender = FrameSender {
        ring: producer,
        counts: Arc::clone(counts),
        places: vec![None; outputs],
    };
    let receiver = FrameReceiver {
        ring: consumer,
        counts: Arc::clone(counts),
        words: vec![0; width],
        outputs: vec![f64::NAN; outputs],
    };
    (sender, receiver)
}

impl FrameSender {
    /// Where the outputs of the sink stand among those of the graph that runs from now on.
    pub(super) fn wire(&mut self, places: impl Iterator<Item = Option<usize>>) {
        for (place, new) in self.places.iter_mut().zip(places) {
            *place = new;
        }
    }

    /// Hands a row over. Where there is no room it is dropped and counted.
    pub(super) fn send(&mut self, output: &Output<'_>, revision: u64) {
        let Ok(mut chunk) = self.ring.write_chunk(HEAD + self.places.len()) else {
            self.counts.dropped.fetch_add(1, Ordering::Relaxed);
            return;
        };
        let head = [
            output.at.as_ns() as u64,
            u64::from(output.is_beat),
            output.behind.as_ns() as u64,
            revision,
            output.records,
            output.happenings,
        ];
        let value = |place: &Option<usize>| {
            let value = place.and_then(|place| output.stepped.outputs.get(place));
            value.copied().unwrap_or(f64::NAN).to_bits()
        };
        let (first, second) = chunk.as_mut_slices();
        let words = head.into_iter().chain(self.places.iter().map(value));
        for (place, word) in first.iter_mut().chain(second).zip(words) {
            *place = word;
        }
        chunk.commit_all();
        self.counts.sent.fetch_add(1, Ordering::Release);
    }
}

impl FrameReceiver {
    /// Takes the next row out, to be looked at until the next is taken; false where there is none.
    pub(super) fn take(&mut self) -> bool {
        let Ok(chunk) = self.ring.read_chunk(self.words.len()) else {
            return false;
        };
        let (first, second) = chunk.as_slices();
        self.words[..first.len()].copy_from_slice(first);
        self.words[first.len()..].copy_from_slice(second);
        chunk.commit_all();
        self.counts.taken.fetch_add(1, Ordering::Release);
        for (output, word) in self.outputs.iter_mut().zip(&self.words[HEAD..]) {
            *output = f64::from_bits(*word);
        }
        true
    }

    /// The row that was taken last.
    pub(super) fn row(&self) -> (OutRow<'_>, Ticket) {
        let row = OutRow {
            at: Instant::from_ns(self.words[0] as i64),
            is_beat: self.words[1] != 0,
            behind: Duration::from_ns(self.words[2] as i64),
            revision: self.words[3],
            outputs: &self.outputs,
        };
        let ticket = Ticket {
            records: self.words[4],
            happenings: self.words[5],
        };
        (row, ticket)
    }

    /// Whether no row will come any more.
    pub(super) fn is_over(&self) -> bool {
        self.ring.is_abandoned() && self.ring.is_empty()
    }
}
