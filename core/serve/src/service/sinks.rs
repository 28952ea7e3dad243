//! The sinks of a service at its start: opened, and brought to where the journal is.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Instant as Clock;

use super::command::CommandGate;
use super::engine_thread::Sinks;
use super::frames::{FrameReceiver, SinkCounts, frames};
use super::position::{Position, PositionFile};
use super::sink_thread::{Health, Opening, Port, Shut, SinkThread};
use super::{ServiceError, ServiceEvent, spawn};
use crate::aside::Aside;
use crate::bell::Mailbox;
use crate::connector::{OutRow, Outlet, Purpose, SinkWiring, Stop};
use crate::deployment::DeclaredSink;
use crate::engine::Engine;
use crate::folder::{StateFolder, StatePaths};
use crate::journal::Progress;
use crate::time::{Duration, Instant};

/// How many rows may wait for a sink.
const ROWS: usize = 1 << 13;

/// A sink that is to be started.
pub(super) struct OpenSink {
    declared: DeclaredSink,
    wiring: SinkWiring,
    /// That of a command. A log is opened by its own thread, which tries again where that fails.
    outlet: Option<Box<dyn Outlet>>,
    position: PositionFile,
    counts: Arc<SinkCounts>,
    /// Where it was; none at its first start.
    was: Option<Position>,
}

impl OpenSink {
    /// Opens a command, and looks where a log was.
    pub(super) fn open(
        declared: DeclaredSink,
        wiring: SinkWiring,
        folder: &StateFolder,
    ) -> Result<Self, ServiceError> {
        let failed = |error| ServiceError::Sink {
            sink: declared.name.clone(),
            error,
        };
        let is_command = declared.parameters.purpose() == Purpose::Command;
        let outlet = is_command.then(|| declared.parameters.open(wiring.clone()));
        let outlet = outlet.transpose().map_err(failed)?;
        let position = PositionFile::new(folder.path(), &declared.name);
        Ok(Self {
            was: position.read(),
            declared,
            wiring,
            outlet,
            position,
            counts: Arc::default(),
        })
    }
}

/// A row of these columns as it was put out, of an engine that was stepped again.
pub(super) fn made_again<'a>(
    engine: &Engine,
    columns: &[String],
    row: &'a mut Vec<f64>,
) -> OutRow<'a> {
    let outputs = &engine.plan().outputs;
    let value = |column: &String| {
        let place = outputs.iter().position(|of| of.name == *column);
        place.map_or(f64::NAN, |place| engine.outputs()[place])
    };
    row.clear();
    row.extend(columns.iter().map(value));
    OutRow {
        at: engine.last().unwrap_or(Instant::MIN),
        is_beat: false,
        behind: Duration::ZERO,
        revision: u64::from_str_radix(engine.revision(), 16).unwrap_or_default(),
        is_degraded: false,
        outputs: row,
    }
}

/// What the engine thread hands rows to, the threads of sinks, and what each counts.
type Running = (Sinks, Vec<JoinHandle<()>>, Vec<(String, Arc<SinkCounts>)>);

/// What the threads of sinks share with the service: the journal, the end, what happens, and whether the service is degraded.
type Threads<'a> = (
    &'a Arc<Progress>,
    &'a Stop,
    &'a Mailbox<ServiceEvent>,
    &'a Arc<AtomicBool>,
);

/// Starts the threads of sinks, which have all rows of so many ticks, beats, breaks and freezes.
pub(super) fn start(
    sinks: Vec<OpenSink>,
    is_dry: bool,
    (folder, happenings): (&StatePaths, u64),
    threads_of: Threads<'_>,
) -> Result<Running, ServiceError> {
    let (mut out, mut threads, mut counts) = (Sinks::default(), Vec::new(), Vec::new());
    for sink in sinks {
        let (name, columns) = (sink.declared.name.clone(), sink.declared.outputs.clone());
        let is_log = sink.declared.parameters.purpose() == Purpose::Log;
        let (sender, frames) = frames(ROWS, columns.len(), is_log, &sink.counts);
        counts.push((name, Arc::clone(&sink.counts)));
        let thread = sink.thread(frames, is_dry, (folder, happenings), threads_of);
        let handle = spawn("sink", move || thread.run())?;
        out.add(sender, columns, handle.thread().clone());
        threads.push(handle);
    }
    Ok((out, threads, counts))
}

impl OpenSink {
    fn thread(
        self,
        frames: FrameReceiver,
        is_dry: bool,
        (folder, happenings): (&StatePaths, u64),
        (progress, stop, events, is_degraded): Threads<'_>,
    ) -> SinkThread {
        let retry = self.wiring.retry;
        let is_command = self.outlet.is_some();
        let gate = is_command.then(|| {
            let mut gate = CommandGate::new(self.declared.behind, self.declared.rate.clone());
            if let Some(was) = &self.was {
                gate.start_from(&was.applied());
            }
            gate
        });
        // A command is never made again.
        let was = self.was.filter(|_| !is_command);
        let known = was.as_ref().map_or(happenings, |of| of.happenings);
        let safe = if is_command { u64::MAX } else { known };
        self.counts.safe.store(safe, Ordering::Relaxed);
        if !is_command {
            self.counts.due.store(happenings, Ordering::Relaxed);
            let done = known.min(happenings);
            self.counts.done.store(done, Ordering::Relaxed);
        }
        SinkThread {
            is_dry: is_dry && is_command,
            opening: (!is_command).then_some(Opening {
                parameters: self.declared.parameters,
                wiring: self.wiring,
            }),
            port: Port {
                outlet: self.outlet.unwrap_or_else(|| Box::new(Shut)),
                counts: Arc::clone(&self.counts),
                stop: stop.clone(),
                retry,
                is_degraded: Arc::clone(is_degraded),
                health: Health {
                    sink: self.declared.name,
                    events: events.clone(),
                    counts: self.counts,
                    has_failed: false,
                    is_held: false,
                },
            },
            frames,
            gate,
            folder: folder.clone(),
            columns: self.declared.outputs,
            position: self.position,
            progress: Arc::clone(progress),
            keeping: Aside::default(),
            done: happenings,
            kept: (u64::MAX, Clock::now()),
            is_new: !is_command,
            was,
            there: 0,
        }
    }
}
