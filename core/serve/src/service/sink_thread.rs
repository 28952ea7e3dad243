//! The thread of a sink: puts rows out once they are journalled, tries again after a failure, and keeps how far it is.
//!
//! A log is given every row, however slow it is: those that there was no room for, and those that a run before left, are made again from
//! a checkpoint and the journal.

use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration as Wait, Instant as Clock};

use super::ServiceEvent;
use super::command::CommandGate;
use super::frames::{FrameReceiver, SinkCounts};
use super::position::{Position, PositionFile};
use super::sinks::made_again;
use crate::aside::Aside;
use crate::bell::{Bell, Mailbox};
use crate::connector::{BackOff, ConnectorError, OutRow, Outlet, Place, Sink, SinkWiring, Stop};
use crate::diagnostic::panic_message;
use crate::folder::StatePaths;
use crate::journal::Progress;
use crate::recovery::{Recovered, Start};

/// How long outputs wait for the journal.
const PATIENCE: Wait = Wait::from_millis(50);
/// How often the position of a log is kept, and that of a command, which goes on from there.
const KEEP: (Wait, Wait) = (Wait::from_secs(5), Wait::from_secs(1));

/// How often is looked whether what was taken can leave, where nothing comes.
const LOOK: Wait = Wait::from_secs(2);
/// How long the end waits for a disk that hangs.
const ENDS: Wait = Wait::from_secs(2);

/// What a sink is until it is open.
pub(super) struct Shut;

impl Outlet for Shut {
    fn put(&mut self, _: &OutRow<'_>) -> Result<(), ConnectorError> {
        Err(ConnectorError::new("it is not open"))
    }
}

/// What a sink is opened by.
pub(super) struct Opening {
    pub(super) parameters: Arc<dyn Sink>,
    pub(super) wiring: SinkWiring,
}

/// A sink at work.
pub(super) struct SinkThread {
    /// None once it is open.
    pub(super) opening: Option<Opening>,
    pub(super) port: Port,
    pub(super) frames: FrameReceiver,
    /// None of a log.
    pub(super) gate: Option<CommandGate>,
    /// Whether nothing is put out.
    pub(super) is_dry: bool,
    pub(super) folder: StatePaths,
    pub(super) columns: Vec<String>,
    pub(super) position: PositionFile,
    pub(super) progress: Arc<Progress>,
    /// What keeps its position, on a disk that may hang.
    pub(super) keeping: Aside<io::Result<(u64, Option<Place>)>>,
    /// It has the rows of so many ticks, beats, breaks and freezes…
    pub(super) done: u64,
    /// …of which so many are kept, and when that was tried last.
    pub(super) kept: (u64, Clock),
    /// Whether no row of this run has been kept.
    pub(super) is_new: bool,
    /// Where a log was when a run before ended.
    pub(super) was: Option<Position>,
    /// How many rows stand behind that place that have not been made again yet.
    pub(super) there: u64,
}

/// The way out.
pub(super) struct Port {
    pub(super) outlet: Box<dyn Outlet>,
    pub(super) counts: Arc<SinkCounts>,
    pub(super) stop: Stop,
    pub(super) health: Health,
    /// The longest pause after a failure.
    pub(super) retry: Wait,
    /// Whether the service is degraded.
    pub(super) is_degraded: Arc<AtomicBool>,
}

impl SinkThread {
    /// Puts rows out until no more will come.
    pub(super) fn run(mut self) {
        if !self.open() {
            return;
        }
        let mut is_dirty = self.was.is_some();
        let bell = Bell::here();
        self.port.stop.wakes(&bell);
        self.go_on();
        while !self.port.stop.is_asked() {
            let is_taken = self.frames.take();
            // In this order: what is over misses no more.
            let is_over = !is_taken && self.frames.is_over();
            let missed = self.port.counts.missed.load(Ordering::Acquire);
            let is_idle = !is_taken && missed <= self.done;
            if is_taken {
                self.put();
            } else if !is_idle {
                self.make_again(missed);
            } else if is_dirty {
                self.port
                    .health
                    .report(guarded(|| self.port.outlet.flush()));
            }
            is_dirty = !is_idle || is_dirty && self.port.health.has_failed;
            self.look();
            self.keep(is_idle && is_over);
            if is_idle && is_over {
                return;
            }
            if is_idle {
                std::thread::park_timeout(LOOK);
            }
        }
    }

    /// Opens it, and counts what stands behind the place where it was. That is tried again where it fails: a log that is wrong is no reason
    /// to do without corrections. False where it is to stop before.
    fn open(&mut self) -> bool {
        let mut back_off = BackOff::up_to(self.port.retry);
        while let Some(of) = &self.opening {
            let place = self.was.as_ref().and_then(|was| was.place);
            let opened = guarded(|| {
                let mut outlet = of.parameters.open(of.wiring.clone())?;
                let rows = match (place, outlet.kept()) {
                    (Some(place), Some(kept)) => kept.rows_after(place)?,
                    _ => None,
                };
                Ok((outlet, rows))
            });
            match opened {
                Ok((outlet, rows)) => {
                    // Where the place has gone nothing stands behind it: a row twice is less than one that is lost.
                    if let Some(was) = self.was.as_mut().filter(|_| rows.is_none()) {
                        was.place = None;
                    }
                    self.there = rows.unwrap_or(0);
                    (self.port.outlet, self.opening) = (outlet, None);
                    self.port.health.report(Ok(()));
                }
                Err(error) => {
                    self.port.counts.failures.fetch_add(1, Ordering::Relaxed);
                    self.port.health.report(Err(error));
                    if self.was.is_none() {
                        // What comes is made again by the next start, where this one never opens it.
                        self.keep(true);
                    }
                    if !self.port.stop.wait(back_off.after(Wait::ZERO)) {
                        return false;
                    }
                }
            }
        }
        if self.gate.is_none() && self.port.outlet.kept().is_none() {
            self.was = None;
        }
        true
    }

    /// Goes on from where it was: what a run before left is put out, and what the journal does not know is cut off.
    fn go_on(&mut self) {
        let (now, rows, was) = (self.done, self.there, self.was.take());
        if let Some(was) = &was {
            (self.done, self.kept.0) = (was.happenings.min(now), was.happenings);
        }
        if was.as_ref().is_none_or(|was| was.place.is_none()) {
            // Before the first row: after a kill those behind it are known.
            self.kept.0 = u64::MAX;
            self.keep(true);
        }
        let Some(was) = was else { return };
        let is_whole = self.done >= now || self.make_again(now);
        let unknown = std::mem::take(&mut self.there);
        if unknown > 0
            && is_whole
            && let (Some(place), Some(kept)) = (was.place, self.port.outlet.kept())
        {
            let cut = guarded(|| kept.cut(place, rows - unknown));
            self.port.health.report(cut);
        }
        // However often it is killed: what stands behind the place is no more than what one run wrote in a few seconds.
        self.keep(true);
    }

    /// Puts out the row that was taken: a log's however often that fails, until it is to stop.
    fn put(&mut self) {
        let after = self.frames.row().1.after;
        if after > self.done {
            self.make_again(after);
        }
        let (row, ticket) = self.frames.row();
        // Where the journal fails the outputs go on; that is reported elsewhere.
        let _ = self.progress.wait_written(ticket.records, PATIENCE);
        let Some(gate) = &mut self.gate else {
            // One that was made again is not put out twice.
            if ticket.happenings > self.done && self.port.put_at_last(&row) {
                self.done = ticket.happenings;
            }
            return;
        };
        self.done = ticket.happenings;
        let outlet = (!self.is_dry).then_some(&mut self.port.outlet);
        let ask = || catch_unwind(AssertUnwindSafe(|| outlet?.applied()));
        let Some(row) = gate.pass(&row, || ask().ok().flatten()) else {
            self.port.counts.behind.fetch_add(1, Ordering::Relaxed);
            return;
        };
        if !self.is_dry {
            // An old command is none: where this one fails, the next tick has a newer one.
            let is_put = self.port.put(&row);
            gate.is_put(is_put);
        }
    }

    /// Makes the rows again that it lacks, up to a number of ticks, beats, breaks and freezes, and those behind that are written: what
    /// comes of them in the ring is passed over. Whether the journal has them all.
    fn make_again(&mut self, missed: u64) -> bool {
        let began = Clock::now();
        let records = self.port.counts.missed_records.load(Ordering::Relaxed);
        while self.progress.written() < records && began.elapsed() < ENDS {
            std::thread::sleep(Wait::from_millis(1));
        }
        let (folder, mut outputs) = (self.folder.clone(), Vec::new());
        let (before, mut looked, mut is_whole) = (self.done, 0, true);
        let mut error = String::new();
        // The end of the journal is being written: what is read of it may not be whole.
        for _ in 0..3 {
            let from = self.done;
            let found = Recovered::replay(&folder, from, |happenings, engine| {
                let Self { port, there, .. } = self;
                port.counts.again.fetch_add(1, Ordering::Relaxed);
                let is_known = happenings <= self.done || *there > 0 && happenings > missed;
                if is_known || port.stop.is_asked() {
                    return;
                }
                let row = made_again(engine, &self.columns, &mut outputs);
                if *there > 0 || port.put_at_last(&row) {
                    *there = there.saturating_sub(1);
                    (self.done, looked) = (happenings, looked + 1);
                    port.counts.done.store(happenings, Ordering::Relaxed);
                    self.keep(false);
                }
            });
            match found {
                Ok(Some(of)) if !self.port.stop.is_asked() => {
                    let is_later = matches!(of.report.start, Start::Checkpoint(at) if at > from);
                    is_whole &= !is_later && of.report.gaps.is_empty();
                    self.done = self.done.max(missed.min(of.happenings()));
                }
                Ok(_) => {}
                Err(of) => error = format!(": {of}"),
            }
            if self.done >= missed || self.port.stop.is_asked() {
                break;
            }
        }
        is_whole &= self.done >= missed;
        let lost = missed.max(self.done) - before - looked;
        if !is_whole && lost > 0 && !self.port.stop.is_asked() {
            self.port.counts.dropped.fetch_add(lost, Ordering::Relaxed);
            let words = format_args!("{lost} rows are lost: the journal does not have them{error}");
            self.port.health.report(Err(ConnectorError::new(words)));
            self.done = missed.max(self.done);
        }
        is_whole
    }

    /// Asks whether what was taken can leave.
    fn look(&mut self) {
        if self.gate.is_none() {
            self.port.counts.done.store(self.done, Ordering::Relaxed);
            let held = guarded(|| Ok(self.port.outlet.held())).unwrap_or(0);
            self.port.counts.held.store(held, Ordering::Relaxed);
        }
        if !self.is_dry {
            let state = guarded(|| self.port.outlet.state());
            self.port.health.look(state);
        }
    }

    /// Keeps how far the sink is, now and then and at the end. Where that fails it is tried again; what is kept is always true.
    fn keep(&mut self, at_once: bool) {
        let every = if self.gate.is_some() { KEEP.1 } else { KEEP.0 };
        let patience = if at_once { ENDS } else { Wait::ZERO };
        self.is_kept(patience);
        // The first row of a run is what tells its file from others, where those are moved.
        let is_first = self.is_new && self.done > self.kept.0;
        let is_early = !at_once && !is_first && self.kept.1.elapsed() < every;
        // Where not all rows behind the place have been made again, its end is further than that.
        if self.kept.0 == self.done || is_early || self.there > 0 || !self.keeping.is_free() {
            return;
        }
        self.is_new &= !is_first;
        self.kept.1 = Clock::now();
        let applied = self.gate.as_ref().map_or(&[][..], CommandGate::applied);
        let finite = |value: &f64| Some(*value).filter(|value| value.is_finite());
        let applied = applied.iter().map(finite).collect();
        let place = match self.port.outlet.kept() {
            Some(kept) => match kept.end() {
                Ok(place) => Some(place),
                Err(_) => return,
            },
            None if self.gate.is_some() || self.opening.is_some() => None,
            None => {
                self.port.counts.safe.store(self.done, Ordering::Relaxed);
                return;
            }
        };
        let (file, happenings) = (self.position.clone(), self.done);
        let position = Position {
            place,
            happenings,
            applied,
        };
        let write = move || file.write(&position).map(|()| (happenings, place));
        self.keeping.start(write);
        self.is_kept(patience);
    }

    /// Looks whether the position is on the disk, for so long.
    fn is_kept(&mut self, patience: Wait) {
        if let Some(Ok((happenings, place))) = self.keeping.wait(patience) {
            self.kept.0 = happenings;
            if self.gate.is_none() {
                self.port.counts.safe.store(happenings, Ordering::Relaxed);
            }
            if let (Some(place), Some(kept)) = (place, self.port.outlet.kept()) {
                kept.forget(place);
            }
        }
    }
}

impl Port {
    /// Puts a row out. False where that fails.
    fn put(&mut self, row: &OutRow<'_>) -> bool {
        let row = OutRow {
            is_degraded: self.is_degraded.load(Ordering::Relaxed),
            ..*row
        };
        let put = guarded(|| self.outlet.put(&row));
        let is_put = put.is_ok();
        let counted = [&self.counts.failures, &self.counts.put][usize::from(is_put)];
        counted.fetch_add(1, Ordering::Relaxed);
        self.health.report(put);
        is_put
    }

    /// Puts a row out, however often that fails. False where it is to stop before.
    fn put_at_last(&mut self, row: &OutRow<'_>) -> bool {
        let mut back_off = BackOff::up_to(self.retry);
        while !self.stop.is_asked() {
            if self.put(row) {
                return true;
            }
            let _ = self.stop.wait(back_off.after(Wait::ZERO));
        }
        false
    }
}

/// Whether a sink works.
#[derive(Debug)]
pub(super) struct Health {
    pub(super) sink: String,
    pub(super) events: Mailbox<ServiceEvent>,
    pub(super) counts: Arc<SinkCounts>,
    /// Whether what it did last failed.
    pub(super) has_failed: bool,
    /// Whether it takes rows that cannot leave.
    pub(super) is_held: bool,
}

impl Health {
    /// What was taken can leave, or cannot.
    fn look(&mut self, state: Result<(), ConnectorError>) {
        let is_held = state.is_err();
        if std::mem::take(&mut self.is_held) || is_held {
            self.report(state);
            self.is_held = is_held;
        }
    }

    /// Reports the first failure, and the first success after one. That a row was taken is no news where none can leave.
    fn report(&mut self, done: Result<(), ConnectorError>) {
        let sink = self.sink.clone();
        let words = done.as_ref().err().map(ToString::to_string);
        let event = match (done, self.has_failed) {
            (Err(error), false) => ServiceEvent::SinkFailed { sink, error },
            (Ok(()), true) if !self.is_held => ServiceEvent::SinkBack { sink },
            _ => return,
        };
        self.has_failed = !self.has_failed;
        if let Ok(mut error) = self.counts.error.lock() {
            *error = words;
        }
        self.events.send(event);
    }
}

fn guarded<T>(work: impl FnOnce() -> Result<T, ConnectorError>) -> Result<T, ConnectorError> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|panic| {
        let words = panic_message(&*panic);
        Err(ConnectorError::new(format_args!(
            "its code panicked: {words}"
        )))
    })
}
