//! Rows on their way to a sink: a bounded ring of words, so that the engine thread hands them over without allocating or waiting.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

use athermal_run::live::Output;
use rtrb::{Consumer, Producer, RingBuffer};

use crate::connector::OutRow;
use crate::time::{Duration, Instant};

/// The words before the outputs.
const HEAD: usize = 7;

/// What a sink counts.
#[derive(Debug, Default)]
pub struct SinkCounts {
    /// Rows that were put out.
    pub put: AtomicU64,
    /// Commands that there was no room for because the sink was behind, and rows of a log that could not be made again for it.
    pub dropped: AtomicU64,
    /// Commands that were not put out because they were too old.
    pub behind: AtomicU64,
    /// Commands that were not put out because a newer one was due at the same time.
    pub superseded: AtomicU64,
    /// How often it failed.
    pub failures: AtomicU64,
    /// Why it cannot put out at the moment.
    pub(super) error: Mutex<Option<String>>,
    /// Rows that were handed to its thread, and those that the thread took.
    sent: AtomicU64,
    taken: AtomicU64,
    /// Rows of so many ticks, beats, breaks and freezes, and records, had no room: a log makes them again from the journal.
    pub(super) missed: AtomicU64,
    pub(super) missed_records: AtomicU64,
    /// How many ticks were stepped again for it.
    pub(super) again: AtomicU64,
    /// The newest row of a log is of so many ticks, beats, breaks and freezes, and it has put out those up to so many.
    pub(super) due: AtomicU64,
    pub(super) done: AtomicU64,
    /// Rows that it took and that have not left.
    pub(super) held: AtomicU64,
    /// A restart needs nothing before so many ticks, beats, breaks and freezes.
    pub(super) safe: AtomicU64,
}

impl SinkCounts {
    /// Why it cannot put out at the moment; none where it can.
    #[must_use]
    pub fn error(&self) -> Option<String> {
        self.error.lock().map_or(None, |error| error.clone())
    }

    /// How many rows of a log have not left: those that the journal has and it was not given yet, and those that it holds.
    #[must_use]
    pub fn spooled(&self) -> u64 {
        let done = self.done.load(Ordering::Relaxed);
        let due = self.due.load(Ordering::Relaxed);
        due.saturating_sub(done) + self.held.load(Ordering::Relaxed)
    }

    /// How many rows wait for its thread.
    #[must_use]
    pub fn waiting(&self) -> u64 {
        let taken = self.taken.load(Ordering::Acquire);
        self.sent.load(Ordering::Acquire).saturating_sub(taken)
    }
}

/// The end that the engine thread holds.
#[derive(Debug)]
pub(super) struct FrameSender {
    ring: Producer<u64>,
    counts: Arc<SinkCounts>,
    /// For each output of the sink, its place among those of the graph that runs.
    places: Vec<Option<usize>>,
    /// Whether rows that there is no room for are made again.
    is_log: bool,
    /// The last of them, by the number of ticks, beats, breaks and freezes; and whether the next one is not sent either.
    missed: u64,
    is_missing: bool,
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
    /// It is put out after the rows up to this number of them, for which there was no room.
    pub(super) after: u64,
}

/// A ring for so many rows of so many outputs.
pub(super) fn frames(
    rows: usize,
    outputs: usize,
    is_log: bool,
    counts: &Arc<SinkCounts>,
) -> (FrameSender, FrameReceiver) {
    let width = HEAD + outputs;
    let (producer, consumer) = RingBuffer::new(rows.max(1) * width);
    let sender = FrameSender {
        ring: producer,
        counts: Arc::clone(counts),
        places: vec![None; outputs],
        is_log,
        missed: 0,
        is_missing: false,
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

    /// Hands a row over. Where there is no room a command is dropped and counted. A log has it from the journal then, with all that
    /// follow until there is room for many: making them again is worth it.
    pub(super) fn send(&mut self, output: &Output<'_>, revision: u64) {
        if output.is_superseded && !self.is_log {
            self.counts.superseded.fetch_add(1, Ordering::Relaxed);
            return;
        }
        if self.is_log {
            self.counts.due.store(output.happenings, Ordering::Relaxed);
        }
        let width = HEAD + self.places.len();
        let least = if self.is_missing {
            self.ring.buffer().capacity() / 2
        } else {
            width
        };
        self.is_missing = self.is_log && self.ring.slots() < least;
        let chunk = self.ring.write_chunk(width);
        let Some(mut chunk) = chunk.ok().filter(|_| !self.is_missing) else {
            if self.is_log {
                self.missed = output.happenings;
                self.counts
                    .missed_records
                    .store(output.records, Ordering::Relaxed);
                self.counts
                    .missed
                    .store(output.happenings, Ordering::Release);
            } else {
                self.counts.dropped.fetch_add(1, Ordering::Relaxed);
            }
            return;
        };
        let head = [
            output.at.as_ns() as u64,
            u64::from(output.is_beat),
            output.behind.as_ns() as u64,
            revision,
            output.records,
            output.happenings,
            self.missed,
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
            is_degraded: false,
            outputs: &self.outputs,
        };
        let ticket = Ticket {
            records: self.words[4],
            happenings: self.words[5],
            after: self.words[6],
        };
        (row, ticket)
    }

    /// Whether no row will come any more.
    pub(super) fn is_over(&self) -> bool {
        self.ring.is_abandoned() && self.ring.is_empty()
    }
}
