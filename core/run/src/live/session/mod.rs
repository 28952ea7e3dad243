//! A session: a graph at work, with its state, its restart, its monitors and its replacement. It takes events. A recording is pulled by
//! [`Session::run`], a broker pushes with [`Session::take`], and neither knows of the other.

mod replacement;
mod report;
mod restart;
mod swap_schedule;
mod watched_graph;

pub use replacement::{Replacement, Swap, SwapTime, load_replacement};
pub use report::{ANOTHER_RUN, Report, Reporter};
pub use watched_graph::WatchedGraph;

use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant as Clock};

use super::monitor::{Finding, Monitor, OutputMonitor};
use super::store::{OutputIdentity, StateStore};
use super::{Feed, Frame, LiveGraph, LiveOptions, Order, RunError, Sink, TickView};
use crate::compile::Plan;
use crate::engine::{Engine, EngineError};
use crate::model::Model;
use crate::recording::{Event, Samples, Source, Steps, drive};
use crate::time::Instant;
use restart::Restart;
use swap_schedule::SwapSchedule;

/// How long a run that is killed may have learned in vain.
const SAVE_EVERY: Duration = Duration::from_secs(60);

/// How a session is run.
#[derive(Debug, Default)]
pub struct SessionOptions {
    /// Where its state is kept, from one run to the next.
    pub state: Option<StateStore>,
    /// Whether estimators learn nothing while it runs.
    pub frozen: bool,
    /// How its graph may be replaced; not at all without.
    pub replacement: Option<Replacement>,
}

impl SessionOptions {
    /// The plan that rows are read for: its sources are the channels of all graphs that are known.
    #[must_use]
    pub fn reading(&self, model: &Model) -> Plan {
        replacement::reading(model, self.models(model), &self.union(model).0)
    }

    /// The outputs that are put out: those of all graphs that are known.
    #[must_use]
    pub fn columns(&self, model: &Model) -> Vec<String> {
        self.union(model).1
    }

    fn union(&self, model: &Model) -> (Vec<Feed>, Vec<String>) {
        replacement::union(self.models(model))
    }

    fn models<'a>(&'a self, model: &'a Model) -> impl Iterator<Item = &'a Model> + Clone {
        let swaps = self.replacement.iter().flat_map(|of| &of.swaps);
        std::iter::once(model).chain(swaps.map(|swap| &swap.model))
    }
}

/// A graph at work.
pub struct Session<'a> {
    reporter: &'a dyn Reporter,
    live: LiveGraph,
    model: Model,
    swaps: Option<SwapSchedule>,
    state: Option<StateStore>,
    restart: Restart,
    monitors: Vec<&'a mut dyn Monitor>,
    /// What these have found at a row.
    found: Vec<Finding>,
    output: OutputMonitor,
    identity: Option<OutputIdentity>,
    saved: Clock,
    /// Whether the first row is still to come: what is known before says nothing of where the data were.
    is_before_first: bool,
    /// A row without samples.
    empty: Samples,
}

impl<'a> Session<'a> {
    /// A model at work, from its state on where there is one.
    ///
    /// # Errors
    /// When the state is not one of the model, or cannot be written where it is not there yet.
    pub fn begin(
        model: Model,
        mut options: SessionOptions,
        reporter: &'a dyn Reporter,
    ) -> Result<Self, RunError> {
        let mut engine = Engine::new(Arc::clone(&model.plan), &model.fitted)?;
        let mut restart = Restart::default();
        if let Some(state) = &mut options.state {
            let is_restored = state.restore(&mut engine)?;
            if is_restored {
                restart.seen = engine.last();
            } else {
                reporter.report(Report::NoState(state.path().to_owned()));
            }
            // Better now than after the first minute. What was read needs not be written yet: a disk may be full for a while.
            match state.save(&engine, &model) {
                Err(error) if is_restored => reporter.report(Report::NotSaved {
                    error,
                    at_start: true,
                }),
                saved => saved?,
            }
        }
        let (feed, columns) = options.union(&model);
        let width = feed.len();
        let (mut live, swaps) = match options.replacement {
            None => (LiveGraph::of_rows(engine), None),
            Some(of) => {
                let channels = feed.clone();
                let options = LiveOptions {
                    channels,
                    ..LiveOptions::default()
                };
                let live = LiveGraph::replaceable(engine, options)?;
                (live, Some(SwapSchedule::new(of, feed, columns)))
            }
        };
        live.order(Order::Freeze(options.frozen));
        Ok(Self {
            reporter,
            empty: Samples {
                time_text: String::new(),
                values: vec![f64::NAN; width],
            },
            live,
            model,
            swaps,
            state: options.state,
            restart,
            monitors: Vec::new(),
            found: Vec::new(),
            output: OutputMonitor::default(),
            identity: None,
            saved: Clock::now(),
            is_before_first: true,
        })
    }

    /// The last instant that the run before had seen.
    #[must_use]
    pub fn seen(&self) -> Option<Instant> {
        self.restart.seen
    }

    /// Puts out these columns: more than those of its graphs, where an output has them already. A graph that cannot be replaced has
    /// columns of its own.
    pub fn set_columns(&mut self, columns: Vec<String>) {
        if let Some(swaps) = &mut self.swaps {
            swaps.set_columns(columns);
        }
    }

    /// Goes on with an output whose last row is at `written`, which only a session with a state does. Returns the instant up to which
    /// no row is written again.
    pub fn append_after(&mut self, written: Option<Instant>) -> Option<Instant> {
        self.restart.written = written.filter(|_| self.state.is_some());
        self.restart.seen.max(self.restart.written)
    }

    /// Reports when the output file is moved or replaced.
    pub fn watch_output(&mut self, output: OutputIdentity) {
        self.identity = Some(output);
    }

    /// Shows each row to a monitor, in the order in which they were added.
    pub fn watch(&mut self, monitor: &'a mut dyn Monitor) {
        self.monitors.push(monitor);
    }

    /// The engine at work.
    #[must_use]
    pub fn engine(&self) -> &Engine {
        self.live.engine()
    }

    /// The model at work.
    #[must_use]
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// What has been put out.
    #[must_use]
    pub fn output(&self) -> &OutputMonitor {
        &self.output
    }

    /// Takes an event, and puts out what comes of it. A row is skipped where the run before saw it, or its time is not after the last
    /// one: false.
    ///
    /// # Errors
    /// When the samples are not those of the graph, a graph named at the start cannot take over, or the sink fails.
    pub fn take(
        &mut self,
        event: Event,
        samples: &Samples,
        sink: &mut dyn Sink,
    ) -> Result<bool, RunError> {
        let reporter = self.reporter;
        if self.restart.skips(event, samples, reporter) {
            return Ok(false);
        }
        let monitors = self.monitors.iter_mut();
        let Event::Row(time) = event else {
            monitors.for_each(|monitor| monitor.segment());
            self.live.segment();
            return Ok(true);
        };
        let values = &samples.values;
        monitors.for_each(|monitor| monitor.row(time, values, &mut self.found));
        self.report_found(time, &samples.time_text);
        if let Some(swaps) = &mut self.swaps {
            swaps.before(&mut self.live, &mut self.model, time, reporter)?;
        }
        let stepped = match self.live.row(time, values) {
            Ok(stepped) => stepped,
            Err(EngineError::NotAfter { .. }) => return Ok(false),
            Err(error) => return Err(error.into()),
        };
        if let Some(swaps) = &mut self.swaps
            && swaps.show(&stepped)
        {
            let usual = self.model.sample_ranges();
            for monitor in &mut self.monitors {
                monitor.follow(stepped.plan, swaps.feed(), usual, &mut self.found);
            }
        }
        let (engine, monitors) = (self.live.engine(), self.monitors.iter_mut());
        let tick = TickView::of(time, engine);
        monitors.for_each(|monitor| monitor.stepped(&tick, &mut self.found));
        self.report_found(time, &samples.time_text);
        let engine = self.live.engine();
        let swaps = self.swaps.as_ref();
        let frame = Frame {
            time,
            time_text: &samples.time_text,
            revision: engine.revision(),
            outputs: swaps.map_or(engine.outputs(), SwapSchedule::shown),
        };
        self.output.look(time, frame.outputs);
        sink.put(&frame).map_err(RunError::Sink)?;
        self.save_now_and_then(sink)?;
        Ok(true)
    }

    /// Lets time pass without samples, so that what is too old becomes absent.
    ///
    /// # Errors
    /// As [`take`](Self::take).
    pub fn beat(&mut self, time: Instant, sink: &mut dyn Sink) -> Result<bool, RunError> {
        let empty = std::mem::take(&mut self.empty);
        let taken = self.take(Event::Row(time), &empty, sink);
        self.empty = empty;
        taken
    }

    /// Freezes what estimators learn while they run, or lets it go on.
    pub fn freeze(&mut self, frozen: bool) {
        self.live.order(Order::Freeze(frozen));
    }

    /// Lets a graph take over before the next row, or after its time in the shadow. `path` names it in reports.
    ///
    /// # Errors
    /// The model again, where the session has no [`Replacement`].
    pub fn swap(&mut self, path: PathBuf, model: Model) -> Result<(), Box<Model>> {
        match &mut self.swaps {
            Some(swaps) => swaps.add(path, model),
            None => return Err(Box::new(model)),
        }
        Ok(())
    }

    /// Takes all events of a source, and finishes.
    ///
    /// # Errors
    /// When the source can give no more, and as [`take`](Self::take) and [`finish`](Self::finish).
    pub fn run(&mut self, source: &mut dyn Source, sink: &mut dyn Sink) -> Result<(), RunError> {
        let session = &mut *self;
        let ended = drive(&mut Driven { session, sink }, source, 1, |_, _, _| Ok(()));
        match ended {
            Ok(_) => {
                self.restart.end(self.reporter);
                self.finish(sink)
            }
            Err(error) => {
                // What was put out until then is not lost; and what came before a row that cannot be read is known.
                let finished = sink.finish();
                if matches!(error, RunError::Source(_)) && finished.is_ok() {
                    let _ = self.save_at_the_end(sink);
                }
                Err(error)
            }
        }
    }

    /// Puts out what the sink holds back, saves the state, and reports what did not happen.
    ///
    /// # Errors
    /// When the sink fails, or the state cannot be written.
    pub fn finish(&mut self, sink: &mut dyn Sink) -> Result<(), RunError> {
        sink.finish().map_err(RunError::Sink)?;
        self.save_at_the_end(sink)?;
        let (engine, monitors) = (self.live.engine(), self.monitors.iter_mut());
        monitors.for_each(|monitor| monitor.end(engine, &mut self.found));
        let last = engine.last().unwrap_or(Instant::MIN);
        self.report_found(last, "");
        if let Some(swaps) = &mut self.swaps {
            swaps.end(&mut self.live, self.reporter);
        }
        Ok(())
    }

    /// Saves the state after the first row, when another graph has taken over and once a minute, after what came of it has left the
    /// program: a run that goes on from there does not predict it again. A machine rather goes without its state after a restart than
    /// without its predictions.
    fn save_now_and_then(&mut self, sink: &mut dyn Sink) -> Result<(), RunError> {
        let is_time = self.is_before_first || self.saved.elapsed() >= SAVE_EVERY;
        if is_time {
            self.is_before_first = false;
            self.saved = Clock::now();
            self.look_at_output();
        }
        let Some(state) = &mut self.state else {
            return Ok(());
        };
        let engine = self.live.engine();
        if !is_time && !state.is_outdated(engine) {
            return Ok(());
        }
        sink.flush().map_err(RunError::Sink)?;
        self.saved = Clock::now();
        if let Err(error) = state.save(engine, &self.model) {
            let at_start = false;
            self.reporter.report(Report::NotSaved { error, at_start });
        }
        Ok(())
    }

    fn save_at_the_end(&mut self, sink: &mut dyn Sink) -> Result<(), RunError> {
        self.look_at_output();
        if let Some(state) = &mut self.state {
            sink.flush().map_err(RunError::Sink)?;
            state.save(self.live.engine(), &self.model)?;
        }
        Ok(())
    }

    fn report_found(&mut self, at: Instant, time: &str) {
        for finding in self.found.drain(..) {
            let found = Report::Found(at, time.to_owned(), finding);
            self.reporter.report(found);
        }
    }

    fn look_at_output(&mut self) {
        if let Some(path) = self.identity.as_mut().and_then(OutputIdentity::moved) {
            self.reporter.report(Report::OutputMoved(path.to_owned()));
        }
    }
}

/// A session on its way to a sink.
struct Driven<'s, 'a> {
    session: &'s mut Session<'a>,
    sink: &'s mut dyn Sink,
}

impl Steps for Driven<'_, '_> {
    type Error = RunError;

    fn take(&mut self, event: Event, samples: &Samples) -> Result<bool, RunError> {
        self.session.take(event, samples, self.sink)
    }
}

#[cfg(test)]
mod tests;
