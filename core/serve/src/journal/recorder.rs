//! The end of the journal that the engine thread holds: it never waits, and goes on when nothing can be written.

use std::io;
use std::path::Path;
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::{Duration as Wait, Instant as Clock};

use athermal_run::live::Keep;
use rtrb::{Producer, RingBuffer};

use super::writer::Writer;
use super::{Begin, JournalError, Progress, Record, output_hash};
use crate::engine::Engine;
use crate::sequencer::{Sample, Timeline};
use crate::time::{Duration, Instant};

/// The journal thread is woken at the latest after so many records, so that what comes of a long pass need not wait for its end.
const EARLY: u64 = 64;
/// So many records are worth waking it for, without a tick.
const FEW: u64 = 8;
/// How long writing and syncing the rest may take.
const ENDS: Wait = Wait::from_secs(3);

/// How a journal is written.
#[derive(Debug, Clone, Copy)]
pub struct JournalOptions {
    /// How many bytes a file has at most, unless its first record is larger.
    pub file: u64,
    /// By how many bytes a file grows ahead of what is written.
    pub ahead: u64,
    /// How many records may wait for the journal thread. Beyond, the journal has a gap, which is counted.
    pub queue: usize,
    /// At most so much is lost in a power cut.
    pub sync: Wait,
    /// How long after a failure it is tried again.
    pub retry: Wait,
}

impl Default for JournalOptions {
    fn default() -> Self {
        Self {
            file: 64 << 20,
            ahead: 1 << 20,
            queue: 1 << 16,
            sync: Wait::from_secs(1),
            retry: Wait::from_secs(1),
        }
    }
}

/// What goes through the ring.
#[derive(Debug)]
pub(super) enum Message {
    Record(u64, Record),
    /// After a gap: where the log is, in pieces, so that nothing is allocated here.
    Resume(Resume),
    Stamp(u32, Instant),
    Offset(u32, Duration),
    Lag(u32, Duration),
    Pending(Sample),
    Waiting(Sample),
    Resumed,
}

/// Where the log is after a gap.
#[derive(Debug, Clone, Copy)]
pub(super) struct Resume {
    pub(super) event: u64,
    pub(super) happenings: u64,
    pub(super) frozen: bool,
    pub(super) last: Instant,
}

/// The end of a journal that the engine thread holds.
#[derive(Debug)]
pub struct Recorder {
    queue: Producer<Message>,
    progress: Arc<Progress>,
    thread: Option<JoinHandle<()>>,
    event: u64,
    happenings: u64,
    frozen: bool,
    /// Whether records are lost at the moment.
    has_gap: bool,
    /// How many failures of the disk have been noticed here.
    failures: u64,
    /// How much was handed over since the journal thread was woken.
    new: u64,
}

impl Recorder {
    /// Begins a file in a folder, and the threads that write it.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn start(
        folder: &Path,
        begin: Begin,
        options: JournalOptions,
    ) -> Result<Self, JournalError> {
        Self::start_after(|| Ok(()), folder, begin, options)
    }

    /// The same, once the folder has been prepared. Where that fails, or the file cannot be made since the disk is full or may not be
    /// written, both are tried again as after any failure; nothing is written into a folder that holds another journal by then.
    ///
    /// # Errors
    /// When there can never be such a file.
    pub fn start_after(
        prepare: impl FnMut() -> io::Result<()> + Send + 'static,
        folder: &Path,
        begin: Begin,
        options: JournalOptions,
    ) -> Result<Self, JournalError> {
        let (queue, messages) = RingBuffer::new(options.queue.max(16));
        let progress = Arc::new(Progress::default());
        progress.set_written(begin.event);
        progress.set_synced(begin.event, begin.happenings);
        let (event, happenings, frozen) = (begin.event, begin.happenings, begin.frozen);
        let known = Arc::clone(&progress);
        let writer = Writer::begin(Box::new(prepare), folder, begin, options, messages, known)?;
        let thread = std::thread::Builder::new()
            .name("journal".to_owned())
            .spawn(move || writer.run());
        let thread = thread.map_err(|error| JournalError::NotWritten {
            path: folder.to_owned(),
            error,
        })?;
        Ok(Self {
            queue,
            progress,
            thread: Some(thread),
            event,
            happenings,
            frozen,
            has_gap: false,
            failures: 0,
            new: 0,
        })
    }

    /// How many records there are, those of gaps included.
    #[must_use]
    pub fn event(&self) -> u64 {
        self.event
    }

    /// Whether the journal thread is far behind, and gets on: whatever can wait is better held back.
    #[must_use]
    pub fn is_crowded(&self) -> bool {
        let half = self.queue.buffer().capacity() / 2;
        self.queue.slots() < half && !self.has_gap && !self.progress.is_degraded()
    }

    /// Whether records are lost at the moment.
    #[must_use]
    pub fn has_gap(&self) -> bool {
        self.has_gap
    }

    /// How far the journal is.
    #[must_use]
    pub fn progress(&self) -> &Arc<Progress> {
        &self.progress
    }

    /// Writes and syncs all that is on its way, and ends the threads.
    pub fn finish(self) {
        drop(self);
    }

    /// Ends a gap where that is possible: the journal goes on from where the log is now. Between two decisions.
    pub fn mend(&mut self, timeline: &Timeline) {
        self.has_gap |= self.progress.failures() != self.failures;
        if !self.has_gap || self.progress.failed() {
            return;
        }
        let failures = self.progress.failures();
        let (stamps, pending) = (timeline.stamps(), timeline.pending());
        let (offsets, lags) = (timeline.offsets(), timeline.lags());
        let waiting = timeline.waiting().iter();
        let sources = offsets.len() + lags.len();
        let pieces = stamps.len() + sources + pending.len() + waiting.len() + 2;
        if self.queue.slots() < pieces.min(self.queue.buffer().capacity()) {
            return;
        }
        let resume = Resume {
            event: self.event,
            happenings: self.happenings,
            frozen: self.frozen,
            last: timeline.last(),
        };
        let stamps = stamps.iter().enumerate();
        let stamps = stamps.map(|(nth, stamp)| Message::Stamp(nth as u32, *stamp));
        let offsets = offsets.iter().enumerate();
        let offsets = offsets.filter_map(|(nth, of)| of.map(|of| Message::Offset(nth as u32, of)));
        let lags = lags.iter().enumerate();
        let lags = lags.filter_map(|(nth, of)| of.map(|of| Message::Lag(nth as u32, of)));
        let messages = std::iter::once(Message::Resume(resume))
            .chain(stamps)
            .chain(offsets)
            .chain(lags)
            .chain(waiting.map(|of| Message::Waiting(*of)))
            .chain(pending.map(|of| Message::Pending(*of)))
            .chain(std::iter::once(Message::Resumed));
        for message in messages {
            if self.queue.push(message).is_err() {
                // More waits than the ring has room for: what was handed over is void without its end.
                return;
            }
        }
        (self.has_gap, self.failures, self.new) = (false, failures, 1);
        self.sync();
    }
}

/// The journal as a graph at work knows it. A record may leave once [`Progress::written`] is as many as there were after it.
impl Keep for Recorder {
    fn record(&mut self, record: Record) -> u64 {
        self.happenings += u64::from(record.is_happening());
        if let Record::Freeze(frozen) = record {
            self.frozen = frozen;
        }
        self.has_gap |= self.progress.failures() != self.failures;
        let pushed = if self.has_gap {
            false
        } else {
            let message = Message::Record(self.event, record);
            self.queue.push(message).is_ok()
        };
        if !pushed {
            self.has_gap = true;
            self.progress.lose(1);
        }
        self.event += 1;
        self.new += 1;
        if self.new >= EARLY {
            self.sync();
        }
        self.event
    }

    fn tick(&mut self, at: Instant, is_beat: bool, outputs: &[f64]) -> u64 {
        let hash = output_hash(outputs);
        self.record(match is_beat {
            true => Record::Beat { at, hash },
            false => Record::Tick { at, hash },
        })
    }

    fn happenings(&self) -> u64 {
        self.happenings
    }

    /// Wakes the journal thread, where it has something to write.
    fn sync(&mut self) {
        if std::mem::take(&mut self.new) > 0
            && let Some(thread) = &self.thread
        {
            thread.thread().unpark();
        }
    }

    fn passed(&mut self, has_ticked: bool, timeline: &Timeline) {
        if has_ticked || self.new >= FEW {
            self.sync();
        }
        self.mend(timeline);
    }

    fn wants_checkpoint(&self) -> bool {
        self.progress.desk.is_asked()
    }

    fn checkpoint(&mut self, engine: &Engine) {
        // What a node that was given up had learned is not whole: the journal goes on from before.
        if engine.panics().is_empty() {
            self.progress.desk.leave(engine, self.happenings);
        }
    }
}
impl Drop for Recorder {
    fn drop(&mut self) {
        // The journal thread ends once the ring is abandoned and empty.
        let (queue, _) = RingBuffer::new(1);
        drop(std::mem::replace(&mut self.queue, queue));
        self.new = 1;
        self.sync();
        // A disk that hangs does not keep the program from ending.
        let began = Clock::now();
        while let Some(thread) = &self.thread
            && !thread.is_finished()
            && began.elapsed() < ENDS
        {
            std::thread::sleep(Wait::from_micros(200));
        }
    }
}
