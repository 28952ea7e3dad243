//! The thread of a sink: puts rows out once they are journalled, tries again after a failure, and keeps how far it is.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::sync::mpsc::Sender;
use std::time::{Duration as Wait, Instant as Clock};

use super::ServiceEvent;
use super::command::CommandGate;
use super::frames::{FrameReceiver, SinkCounts, Ticket};
use super::position::{Position, PositionFile};
use crate::aside::Aside;
use crate::connector::{ConnectorError, Outlet, Stop};
use crate::diagnostic::panic_message;
use crate::journal::Progress;

/// How long outputs wait for the journal.
const PATIENCE: Wait = Wait::from_millis(50);
/// How long a row waits after a failure.
const AGAIN: Wait = Wait::from_millis(500);
/// How often the position of a log is kept, and that of a command, which goes on from there.
const KEEP: (Wait, Wait) = (Wait::from_secs(5), Wait::from_secs(1));

/// How long the end waits for a disk that hangs.
const ENDS: Wait = Wait::from_secs(2);

/// A sink at work.
pub(super) struct SinkThread {
    pub(super) name: String,
    pub(super) outlet: Box<dyn Outlet>,
    pub(super) frames: FrameReceiver,
    pub(super) counts: Arc<SinkCounts>,
    /// None of a log.
    pub(super) gate: Option<CommandGate>,
    /// Whether nothing is put out.
    pub(super) is_dry: bool,
    pub(super) position: PositionFile,
    pub(super) progress: Arc<Progress>,
    pub(super) stop: Stop,
    pub(super) events: Sender<ServiceEvent>,
    pub(super) health: Health,
    /// What keeps its position, on a disk that may hang.
    pub(super) keeping: Aside<()>,
}

impl SinkThread {
    /// Puts rows out until no more will come.
    pub(super) fn run(mut self) {
        let (mut is_dirty, mut kept, mut happenings) = (false, Clock::now(), None);
        let every = if self.gate.is_some() { KEEP.1 } else { KEEP.0 };
        loop {
            if self.frames.take() {
                let Some(put) = self.put() else {
                    return;
                };
                happenings = Some(put);
                is_dirty = true;
                self.look();
                continue;
            }
            if is_dirty {
                let flushed = guarded(|| self.outlet.flush());
                is_dirty = flushed.is_err();
                self.health.report(&self.name, &self.events, flushed);
            }
            self.look();
            let is_over = self.frames.is_over();
            if (is_over || kept.elapsed() >= every)
                && let Some(happenings) = happenings.take()
            {
                kept = Clock::now();
                if is_over {
                    self.keeping.wait(ENDS);
                }
                self.keep(happenings);
            }
            if is_over {
                self.keeping.wait(ENDS);
                return;
            }
            std::thread::park_timeout(Wait::from_millis(100));
        }
    }

    /// Puts out the row that was taken, however often that fails, and gives how many ticks, beats, breaks and freezes there were then.
    /// None where it is to stop meanwhile.
    fn put(&mut self) -> Option<u64> {
        let (
            row,
            Ticket {
                records,
                happenings,
            },
        ) = self.frames.row();
        // Where the journal fails the outputs go on; that is reported elsewhere.
        let _ = self.progress.wait_written(records, PATIENCE);
        if let Some(gate) = &mut self.gate {
            let applied = || self.outlet.applied();
            if gate.is_unsure()
                && let Ok(Some(applied)) = catch_unwind(AssertUnwindSafe(applied))
            {
                gate.start_from(&applied);
            }
            let Some(row) = gate.pass(&row) else {
                self.counts.behind.fetch_add(1, Ordering::Relaxed);
                return Some(happenings);
            };
            if !self.is_dry {
                // An old command is none: where this one fails, the next tick has a newer one.
                let put = guarded(|| self.outlet.put(&row));
                self.counts.count(&put);
                gate.is_put(put.is_ok());
                self.health.report(&self.name, &self.events, put);
            }
            return Some(happenings);
        }
        loop {
            let put = guarded(|| self.outlet.put(&row));
            let is_put = put.is_ok();
            self.counts.count(&put);
            self.health.report(&self.name, &self.events, put);
            if is_put {
                return Some(happenings);
            }
            if !self.stop.wait(AGAIN) {
                return None;
            }
        }
    }

    /// Asks whether what was taken can leave.
    fn look(&mut self) {
        if !self.is_dry {
            let state = guarded(|| self.outlet.state());
            self.health.look(&self.name, &self.events, state);
        }
    }

    /// Keeps how far the sink is. Where that fails it is tried again; what is kept is always true.
    fn keep(&mut self, happenings: u64) {
        let applied = self.gate.as_ref().map_or(&[][..], CommandGate::applied);
        let applied = applied
            .iter()
            .map(|value| Some(*value).filter(|value| value.is_finite()));
        let applied: Vec<_> = applied.collect();
        let end = match self.outlet.kept() {
            Some(kept) => kept.end(),
            None if self.gate.is_some() => Ok(0),
            None => return,
        };
        let Ok(end) = end else { return };
        let (file, position) = (
            self.position.clone(),
            Position {
                end,
                happenings,
                applied,
            },
        );
        self.keeping.take();
        self.keeping.start(move || drop(file.write(&position)));
    }
}

/// Whether a sink works.
#[derive(Debug, Default)]
pub(super) struct Health {
    /// Whether what it did last failed.
    has_failed: bool,
    /// Whether it takes rows that cannot leave.
    is_held: bool,
}

impl Health {
    /// What was taken can leave, or cannot.
    fn look(
        &mut self,
        name: &str,
        events: &Sender<ServiceEvent>,
        state: Result<(), ConnectorError>,
    ) {
        let is_held = state.is_err();
        if std::mem::take(&mut self.is_held) || is_held {
            self.report(name, events, state);
            self.is_held = is_held;
        }
    }

    /// Reports the first failure, and the first success after one. That a row was taken is no news where none can leave.
    fn report(
        &mut self,
        name: &str,
        events: &Sender<ServiceEvent>,
        done: Result<(), ConnectorError>,
    ) {
        let sink = name.to_owned();
        let event = match (done, self.has_failed) {
            (Err(error), false) => ServiceEvent::SinkFailed { sink, error },
            (Ok(()), true) if !self.is_held => ServiceEvent::SinkBack { sink },
            _ => return,
        };
        self.has_failed = !self.has_failed;
        let _ = events.send(event);
    }
}

fn guarded(work: impl FnOnce() -> Result<(), ConnectorError>) -> Result<(), ConnectorError> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|panic| {
        let words = panic_message(&*panic);
        Err(ConnectorError::new(format_args!(
            "its code panicked: {words}"
        )))
    })
}
