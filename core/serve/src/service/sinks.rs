//! The sinks of a service at its start: opened, and brought to where the journal is.

use std::sync::Arc;
use std::sync::mpsc::Sender;
use std::thread::JoinHandle;

use super::command::CommandGate;
use super::engine_thread::Sinks;
use super::frames::{FrameReceiver, SinkCounts, frames};
use super::position::{Position, PositionFile};
use super::sink_thread::{Health, SinkThread};
use super::{ServiceError, ServiceEvent, spawn};
use crate::aside::Aside;
use crate::connector::{OutRow, Outlet, Purpose, SinkWiring, Stop, WiredOutput};
use crate::deployment::DeclaredSink;
use crate::engine::Engine;
use crate::folder::StateFolder;
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
    /// Where it was; none at its first start.
    pub(super) was: Option<Position>,
    /// How many rows stand behind that place.
    rows: u64,
    /// How many of the ticks behind that place have been stepped again.
    again: u64,
    row: Vec<f64>,
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
        let mut was = position.read();
        let mut rows = 0;
        if let (Some(of), Some(kept)) = (&was, outlet.kept()) {
            match kept.rows_after(of.end).map_err(failed)? {
                Some(there) => rows = there,
                // The file has gone: it begins anew, with what comes.
                None => was = None,
            }
        }
        Ok(Self {
            row: vec![f64::NAN; declared.outputs.len()],
            declared,
            outlet,
            position,
            counts: Arc::default(),
            was,
            rows,
            again: 0,
        })
    }

    /// Up to how many ticks, beats, breaks and freezes all of its rows stand; none where that does not matter.
    pub(super) fn least(&mut self) -> Option<u64> {
        let is_log = self.declared.parameters.purpose() == Purpose::Log;
        let keeps = is_log && self.outlet.kept().is_some();
        self.was.as_ref().filter(|_| keeps).map(|of| of.happenings)
    }

    /// Looks at a tick that is stepped again, and puts it out where it does not stand yet.
    pub(super) fn again(&mut self, happenings: u64, engine: &Engine) -> Result<(), ServiceError> {
        let Some(least) = self.least() else {
            return Ok(());
        };
        if happenings <= least {
            return Ok(());
        }
        self.again += 1;
        if self.again <= self.rows {
            return Ok(());
        }
        let outputs = &engine.plan().outputs;
        let columns = self.declared.outputs.iter();
        for (value, column) in self.row.iter_mut().zip(columns) {
            let place = outputs.iter().position(|of| of.name == *column);
            *value = place.map_or(f64::NAN, |place| engine.outputs()[place]);
        }
        let row = OutRow {
            at: engine.last().unwrap_or(Instant::MIN),
            is_beat: false,
            behind: Duration::ZERO,
            revision: u64::from_str_radix(engine.revision(), 16).unwrap_or_default(),
            outputs: &self.row,
        };
        let put = self.outlet.put(&row);
        put.map_err(|error| ServiceError::Sink {
            sink: self.declared.name.clone(),
            error,
        })
    }

    /// Cuts off what the journal does not know, and keeps the place. `happenings` is where the journal is.
    pub(super) fn settle(&mut self, happenings: u64) -> Result<(), ServiceError> {
        let failed = |error| ServiceError::Sink {
            sink: self.declared.name.clone(),
            error,
        };
        let Some(kept) = self.outlet.kept() else {
            return Ok(());
        };
        if let Some(of) = &self.was
            && self.again < self.rows
        {
            kept.cut(of.end, self.again).map_err(failed)?;
        }
        // Where rows are still on their way the place that was kept before holds.
        let Ok(end) = kept.end() else {
            return Ok(());
        };
        let position = Position {
            end,
            happenings,
            applied: Vec::new(),
        };
        let written = self.position.write(&position);
        written.map_err(|error| ServiceError::Position {
            sink: self.declared.name.clone(),
            error,
        })
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

/// Starts the threads of sinks.
pub(super) fn start(
    sinks: Vec<OpenSink>,
    is_dry: bool,
    (progress, stop, events): (&Arc<Progress>, &Stop, &Sender<ServiceEvent>),
) -> Result<Running, ServiceError> {
    let (mut out, mut threads, mut counts) = (Sinks::default(), Vec::new(), Vec::new());
    for sink in sinks {
        let (sender, frames) = frames(ROWS, sink.declared.outputs.len(), &sink.counts);
        let (name, columns) = (sink.declared.name.clone(), sink.declared.outputs.clone());
        counts.push((name, Arc::clone(&sink.counts)));
        let thread = sink.thread(frames, is_dry, progress, stop, events);
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
        progress: &Arc<Progress>,
        stop: &Stop,
        events: &Sender<ServiceEvent>,
    ) -> SinkThread {
        let is_command = self.declared.parameters.purpose() == Purpose::Command;
        let gate = is_command.then(|| {
            let mut gate = CommandGate::new(self.declared.behind, self.declared.rate.clone());
            if let Some(was) = &self.was {
                gate.start_from(&was.applied());
            }
            gate
        });
        SinkThread {
            is_dry: is_dry && is_command,
            name: self.declared.name,
            outlet: self.outlet,
            frames,
            counts: self.counts,
            gate,
            position: self.position,
            progress: Arc::clone(progress),
            stop: stop.clone(),
            events: events.clone(),
            health: Health::default(),
            keeping: Aside::default(),
        }
    }
}
