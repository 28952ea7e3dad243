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
use crate::connector::{ConnectorError, OutRow, Outlet, Stop};
use crate::diagnostic::panic_message;
use crate::journal::Progress;

/// How long outputs wait for the journal.
const PATIENCE: Wait = Wait::from_millis(50);
/// How long a row waits after a failure.
const AGAIN: Wait = Wait::from_millis(500);
/// How often the position is kept.
const KEEP: Wait = Wait::from_secs(5);

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
}

impl SinkThread {
    /// Puts rows out until no more will come.
    pub(super) fn run(mut self) {
        let (mut is_dirty, mut kept, mut has_failed) = (false, Clock::now(), false);
        let mut happenings = None;
        loop {
            if self.frames.take() {
                let (row, ticket) = self.frames.row();
                let ended = put(
                    &mut self.outlet,
                    &mut self.gate,
                    (&row, ticket),
                    &self.counts,
                    self.is_dry,
                    &self.progress,
                    |error, outlet_is_back| {
                        let sink = self.name.clone();
                        if outlet_is_back && has_failed {
                            let _ = self.events.send(ServiceEvent::SinkBack { sink });
                        } else if let Some(error) = error
                            && !has_failed
                        {
                            let _ = self.events.send(ServiceEvent::SinkFailed { sink, error });
                        }
                        has_failed = !outlet_is_back;
                        outlet_is_back || self.stop.wait(AGAIN)
                    },
                );
                if !ended {
                    return;
                }
                happenings = Some(ticket.happenings);
                is_dirty = true;
                continue;
            }
            if is_dirty {
                self.flush();
                is_dirty = false;
            }
            let is_over = self.frames.is_over();
            if (is_over || kept.elapsed() >= KEEP)
                && let Some(happenings) = happenings.take()
            {
                kept = Clock::now();
                self.keep(happenings);
            }
            if is_over {
                return;
            }
            std::thread::park_timeout(Wait::from_millis(100));
        }
    }

    fn flush(&mut self) {
        if let Err(error) = guarded(|| self.outlet.flush()) {
            let sink = self.name.clone();
            let _ = self.events.send(ServiceEvent::SinkFailed { sink, error });
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
        let _ = self.position.write(&Position {
            end,
            happenings,
            applied,
        });
    }
}

/// Puts a row out. `again` is given each failure, and says whether it is tried again; it is given the success after one, too.
fn put(
    outlet: &mut Box<dyn Outlet>,
    gate: &mut Option<CommandGate>,
    (row, ticket): (&OutRow<'_>, Ticket),
    counts: &SinkCounts,
    is_dry: bool,
    progress: &Progress,
    mut again: impl FnMut(Option<ConnectorError>, bool) -> bool,
) -> bool {
    // Where the journal fails the outputs go on; that is reported elsewhere.
    let _ = progress.wait_written(ticket.records, PATIENCE);
    let is_command = gate.is_some();
    let row = match gate {
        None => *row,
        Some(gate) => match gate.pass(row) {
            Some(row) => row,
            None => {
                counts.behind.fetch_add(1, Ordering::Relaxed);
                return true;
            }
        },
    };
    if is_dry {
        return true;
    }
    loop {
        match guarded(|| outlet.put(&row)) {
            Ok(()) => {
                counts.put.fetch_add(1, Ordering::Relaxed);
                let _ = again(None, true);
                return true;
            }
            Err(error) => {
                counts.failures.fetch_add(1, Ordering::Relaxed);
                let goes_on = again(Some(error), false);
                // An old command is none: the next tick has a newer one.
                if !goes_on || is_command {
                    return goes_on;
                }
            }
        }
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
