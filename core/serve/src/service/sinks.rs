//! The sinks of a service at its start: opened, and brought to where the journal is.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::sync::mpsc::Sender;
use std::thread::JoinHandle;
use std::time::Instant as Clock;

use super::command::CommandGate;
use super::engine_thread::Sinks;
use super::frames::{FrameReceiver, SinkCounts, frames};
use super::position::{Position, PositionFile};
use super::sink_thread::{Health, Port, SinkThread};
use super::{ServiceError, ServiceEvent, spawn};
use crate::aside::Aside;
use crate::connector::{OutRow, Outlet, Purpose, SinkWiring, Stop, WiredOutput};
use crate::deployment::DeclaredSink;
use crate::engine::Engine;
use crate::folder::{StateFolder, StatePaths};
use crate::journal::Progress;
use crate::time::{Duration, Instant};

/// How many rows may wait for a sink.
const ROWS: usize = 1 << 13;

/// A sink that has been opened.
pub(super) struct OpenSink {
    pub(super) declared: DeclaredSink,
    pub(super) outlet: Box<dyn Outlet>,
    pub(super) position: PositionFile,
    pub(super) counts: Arc<SinkCounts>,
    /// Where it was, and how many rows stand behind that place; none at its first start.
    was: Option<(Position, u64)>,
}

impl OpenSink {
    /// Opens a sink, and looks where its rows end.
    pub(super) fn open(
        declared: DeclaredSink,
        wiring: SinkWiring,
        folder: &StateFolder,
    ) -> Result<Self, ServiceError> {
        let failed = |error| ServiceError::Sink {
            sink: declared.name.clone(),
            error,
        };
        let mut outlet = declared.parameters.open(wiring).map_err(failed)?;
        let position = PositionFile::new(folder.path(), &declared.name);
        let was = match (position.read(), outlet.kept()) {
            // Where the file has gone it begins anew, with what comes.
            (Some(of), Some(kept)) => {
                let rows = kept.rows_after(of.end).map_err(failed)?;
                rows.map(|rows| (of, rows))
            }
            (of, _) => of.map(|of| (of, 0)),
        };
        Ok(Self {
            declared,
            outlet,
            position,
            counts: Arc::default(),
            was,
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
        outputs: row,
    }
}

/// What a sink is given, by the columns that it has.
pub(super) fn wiring(
    declared: &DeclaredSink,
    outputs: &[WiredOutput],
    plan: &crate::compile::Plan,
) -> SinkWiring {
    let of = |name: &String| {
        let known = outputs.iter().find(|of| of.name == *name);
        known.cloned().unwrap_or(WiredOutput {
            name: name.clone(),
            unit: None,
        })
    };
    SinkWiring {
        name: declared.name.clone(),
        machine: plan.name.clone(),
        folder: declared.folder.clone(),
        outputs: declared.outputs.iter().map(of).collect(),
        time: plan.time.clone(),
    }
}

/// What the engine thread hands rows to, the threads of sinks, and what each counts.
type Running = (Sinks, Vec<JoinHandle<()>>, Vec<(String, Arc<SinkCounts>)>);

/// Starts the threads of sinks, which have all rows of so many ticks, beats, breaks and freezes.
pub(super) fn start(
    sinks: Vec<OpenSink>,
    is_dry: bool,
    (folder, happenings): (&StatePaths, u64),
    (progress, stop, events): (&Arc<Progress>, &Stop, &Sender<ServiceEvent>),
) -> Result<Running, ServiceError> {
    let (mut out, mut threads, mut counts) = (Sinks::default(), Vec::new(), Vec::new());
    for sink in sinks {
        let (name, columns) = (sink.declared.name.clone(), sink.declared.outputs.clone());
        let is_log = sink.declared.parameters.purpose() == Purpose::Log;
        let (sender, frames) = frames(ROWS, columns.len(), is_log, &sink.counts);
        counts.push((name, Arc::clone(&sink.counts)));
        let thread = sink.thread(frames, is_dry, (folder, happenings), progress, stop, events);
        let handle = spawn("sink", move || thread.run())?;
        out.add(sender, columns, handle.thread().clone());
        threads.push(handle);
    }
    Ok((out, threads, counts))
}

impl OpenSink {
    fn thread(
        mut self,
        frames: FrameReceiver,
        is_dry: bool,
        (folder, happenings): (&StatePaths, u64),
        progress: &Arc<Progress>,
        stop: &Stop,
        events: &Sender<ServiceEvent>,
    ) -> SinkThread {
        let is_command = self.declared.parameters.purpose() == Purpose::Command;
        let gate = is_command.then(|| {
            let mut gate = CommandGate::new(self.declared.behind, self.declared.rate.clone());
            if let Some((was, _)) = &self.was {
                gate.start_from(&was.applied());
            }
            gate
        });
        let was = self.was.filter(|_| self.outlet.kept().is_some());
        // A command is never made again.
        let known = was.as_ref().map_or(happenings, |of| of.0.happenings);
        let safe = if is_command { u64::MAX } else { known };
        self.counts.safe.store(safe, Ordering::Relaxed);
        SinkThread {
            is_dry: is_dry && is_command,
            port: Port {
                outlet: self.outlet,
                counts: self.counts,
                stop: stop.clone(),
                health: Health {
                    sink: self.declared.name,
                    events: events.clone(),
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
            was,
            there: 0,
        }
    }
}
