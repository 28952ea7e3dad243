//! A service: sources, an engine thread with its journal, sinks, and a control thread, which is the caller's.
//!
//! ```text
//!  source threads ─ring─▶ engine thread: sequencer → stepper ─ring─▶ sink threads
//!                              │ records                                ▲ wait until written
//!                              ├─ring─▶ journal thread ─────────────────┘
//!                              └─ring─▶ control (the caller): replica, checkpoints, swaps, reports
//! ```

mod command;
mod engine_thread;
mod error;
mod event;
mod frames;
mod host_clock;
mod position;
mod sink_thread;
mod sinks;
mod source_thread;
mod sources;
mod status;
#[cfg(test)]
mod tests;
mod watch;
mod wiring;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, channel};
use std::thread::{Builder, JoinHandle};
use std::time::{Duration as Wait, Instant as Clock};

use athermal_run::live::{Feed, LiveOptions, pair_from};
use athermal_run::model::Model;
use rtrb::{Consumer, Producer, RingBuffer};

pub use error::ServiceError;
pub use event::ServiceEvent;
pub use frames::SinkCounts;
pub use status::Snapshot;

use crate::aside::Aside;
use crate::checkpoint::Checkpoints;
use crate::compile::Plan;
use crate::connector::{SourceCounts, Stop};
use crate::deployment::Deployment;
use crate::folder::{StateFolder, StatePaths};
use crate::host;
use crate::journal::{
    FeedNames, JournalOptions, JournalStatus, Keep, Progress, Recorder, oldest, retire,
};
use crate::keeper::{CommitError, Keeper};
use crate::moment::MonotonicClock;
use crate::recovery::{Recovered, RecoveryReport};
use crate::sequencer::{Admission, Sequencer};
use crate::time::{Duration, Instant};
use crate::worker::Worker;
use engine_thread::{EngineThread, Order};
use host_clock::HostClock;
use sinks::OpenSink;
use status::Shared;
use watch::Watch;
use wiring::{fed, keep, outputs, rules};

/// How often old files of the journal are looked at.
const RETIRE: Wait = Wait::from_secs(60);
/// How long the threads may take to end.
const ENDS: Wait = Wait::from_secs(5);

/// How a service is run.
#[derive(Debug, Clone)]
pub struct ServiceOptions {
    /// The state folder.
    pub state: PathBuf,
    /// Whether commands are not put out.
    pub is_dry: bool,
    /// Whether estimators learn nothing.
    pub frozen: bool,
    /// Asks for the host's time, where it is known to be right: [`host::synchronised`].
    pub host_time: fn() -> Option<Instant>,
}

impl ServiceOptions {
    /// A service that puts everything out and learns, with its state in a folder.
    #[must_use]
    pub fn new(state: PathBuf) -> Self {
        Self {
            state,
            is_dry: false,
            frozen: false,
            host_time: host::synchronised,
        }
    }
}

/// A service at work.
pub struct Service {
    keeper: Keeper,
    engine: JoinHandle<Worker>,
    orders: Producer<Order>,
    remarks: Consumer<(Admission, u64)>,
    /// What sources left out, by their names.
    heard: Receiver<(String, String)>,
    shared: Arc<Shared>,
    progress: Arc<Progress>,
    stop_sources: Stop,
    stop_sinks: Stop,
    sources: Vec<(String, Arc<SourceCounts>)>,
    source_threads: Vec<JoinHandle<()>>,
    watches: Vec<Watch>,
    host: HostClock,
    sinks: Vec<(String, Arc<SinkCounts>)>,
    sink_threads: Vec<JoinHandle<()>>,
    channels: Vec<String>,
    events: Receiver<ServiceEvent>,
    own: Vec<ServiceEvent>,
    folder: StateFolder,
    keep: Keep,
    retired: Clock,
    retiring: Aside<()>,
    is_degraded: bool,
    /// How many nodes were given up and reported.
    given_up: usize,
    has_failed: bool,
}

/// What is left of a service that has ended.
#[derive(Debug)]
pub struct Ended {
    /// What became of the samples of each channel.
    pub channels: Vec<(String, crate::sequencer::Counts)>,
    /// How many ticks, beats, breaks and freezes there were, those of earlier runs included.
    pub happenings: u64,
    /// How many ticks were cut early because too many samples waited.
    pub hurried: u64,
    /// How the journal is.
    pub journal: JournalStatus,
    /// Whether the engine could not go on.
    pub has_failed: bool,
}

impl Service {
    /// Starts a service from where its state folder says that it was. `model` is the graph that is to run.
    ///
    /// # Errors
    /// When the state cannot be used, or a source or sink cannot be what the machine file asks for.
    pub fn start(
        model: &Model,
        deployment: Deployment,
        options: &ServiceOptions,
    ) -> Result<(Self, RecoveryReport), ServiceError> {
        let Deployment {
            runtime,
            sources,
            sinks,
        } = deployment;
        let folder = StateFolder::open(&options.state)?;
        if let Some(revision) = model.revision() {
            folder.keep_model(model, &revision)?;
        }
        let time = &model.plan.time;
        let units = outputs(&model.plan);
        let open = |declared: crate::deployment::DeclaredSink| {
            let wiring = sinks::wiring(&declared, &units, time);
            OpenSink::open(declared, wiring, &folder)
        };
        let sinks: Result<Vec<_>, _> = sinks.into_iter().map(open).collect();
        let mut sinks = sinks?;
        let least = sinks.iter_mut().filter_map(OpenSink::least).min();
        let names: Vec<_> = sources.iter().map(|of| of.name.clone()).collect();
        let given = Feed::of(&model.plan);
        let checkpoints = Checkpoints::new(folder.checkpoints(), runtime.keep.checkpoints);
        let feed = |plan: &Plan| FeedNames::new(&fed(plan, &given), names.clone());
        let mut failed = None;
        let recovered = Recovered::find(
            &folder,
            &checkpoints,
            model,
            feed,
            least.unwrap_or(u64::MAX),
            |happenings, engine| {
                for sink in &mut sinks {
                    let again = sink.again(happenings, engine);
                    failed = failed.take().or(again.err());
                }
            },
        )?;
        failed.map_or(Ok(()), Err)?;
        let happenings = recovered.happenings();
        for sink in &mut sinks {
            sink.settle(happenings)?;
        }
        let journal = JournalOptions {
            sync: wait(runtime.sync),
            ..JournalOptions::default()
        };
        let recorder = Recorder::start(&folder.journal(), recovered.begin(), journal)?;
        let progress = Arc::clone(recorder.progress());
        let clock = MonotonicClock::start();
        let feed = fed(recovered.engine.plan(), &given);
        let rules = rules(&runtime, &sources, &feed);
        let stamps = recovered.timeline.stamps().to_vec();
        let mut sequencer = Sequencer::resume(rules, recovered.timeline, clock.now());
        let mut host = HostClock::new(options.host_time, clock, &sources);
        if let Some((time, now)) = host.look(true) {
            sequencer.synchronise(time, now);
        }
        let live = LiveOptions {
            isolates: true,
            channels: given.clone(),
            ..LiveOptions::default()
        };
        let differs = recovered.model.revision() != model.revision();
        let was_frozen = recovered.engine.frozen();
        let (stepper, control) = pair_from(recovered.engine, live)?;
        let every = wait(runtime.checkpoint);
        let keeper = Keeper::new(
            control,
            (checkpoints, folder.commits()),
            Arc::clone(&progress),
            happenings,
            every,
        );
        let mut worker = Worker::new(sequencer, stepper, recorder);
        if was_frozen != options.frozen {
            worker.freeze(options.frozen);
        }
        let (to_engine, orders) = RingBuffer::new(64);
        let (remarks, from_engine) = RingBuffer::new(256);
        let (tell, events) = channel();
        let shared = Arc::new(Shared::new(feed.len()));
        let (stop_sources, stop_sinks) = (Stop::default(), Stop::default());
        // Sinks first: nothing that comes is put out into nowhere.
        let running = sinks::start(sinks, options.is_dry, (&progress, &stop_sinks, &tell))?;
        let (out, sink_threads, sink_counts) = running;
        // The engine thread waits for the links of sources, which need to know it.
        let (hand_over, links) = channel();
        let engine_thread = {
            let (shared, tell) = (Arc::clone(&shared), tell.clone());
            spawn("engine", move || {
                let sources = links.recv().unwrap_or_default();
                let thread = EngineThread {
                    worker,
                    clock,
                    sources,
                    sinks: out,
                    orders,
                    remarks,
                    shared,
                    events: tell,
                };
                thread.run()
            })?
        };
        let open = sources::open(
            sources,
            model,
            (&feed, &stamps),
            (engine_thread.thread(), &progress),
        )?;
        let _ = hand_over.send(open.links);
        let source_threads = open.inlets.into_iter().map(|source| {
            let (stop, tell) = (stop_sources.clone(), tell.clone());
            spawn("source", move || source.run(&stop, &tell))
        });
        let source_threads = source_threads.collect::<Result<Vec<_>, _>>()?;
        let mut service = Self {
            keeper,
            engine: engine_thread,
            orders: to_engine,
            remarks: from_engine,
            heard: open.heard,
            shared,
            progress,
            stop_sources,
            stop_sinks,
            sources: open.counts,
            source_threads,
            watches: open.watches,
            host,
            sinks: sink_counts,
            sink_threads,
            channels: feed.iter().map(|of| of.name.clone()).collect(),
            events,
            own: Vec::new(),
            folder,
            keep: keep(&runtime),
            retired: Clock::now(),
            retiring: Aside::default(),
            is_degraded: false,
            given_up: 0,
            has_failed: false,
        };
        service.own.extend(service.host.first());
        if differs {
            service.replace(model);
        }
        Ok((service, recovered.report))
    }

    /// What happened since the last call. Call it ten times a second: it also takes checkpoints.
    pub fn pump(&mut self) -> Vec<ServiceEvent> {
        let mut events = std::mem::take(&mut self.own);
        match self.keeper.pump() {
            Ok(notices) => events.extend(notices.into_iter().map(ServiceEvent::Swap)),
            Err(error) => events.push(ServiceEvent::NoCheckpoint(error)),
        }
        while let Ok((admission, count)) = self.remarks.pop() {
            events.push(ServiceEvent::NotAccepted { admission, count });
        }
        let remark = |(source, words)| ServiceEvent::SourceRemark { source, words };
        events.extend(self.heard.try_iter().map(remark));
        while let Ok(event) = self.events.try_recv() {
            self.has_failed |= matches!(event, ServiceEvent::EngineFailed(_));
            events.push(event);
        }
        let replica = self.keeper.control().replica();
        let panics = replica.map_or(&[][..], crate::engine::Engine::panics);
        for panic in panics.iter().skip(self.given_up) {
            events.push(ServiceEvent::NodeGivenUp(panic.to_string()));
        }
        self.given_up = panics.len();
        let status = self.progress.status();
        if status.is_degraded != self.is_degraded {
            self.is_degraded = status.is_degraded;
            events.push(ServiceEvent::Journal(status));
        }
        if let Some((time, now)) = self.host.look(false) {
            self.order(Order::Synchronise(time, now));
            self.note("the host's clock is synchronised");
            events.push(ServiceEvent::HostClock {
                is_synchronised: true,
            });
        }
        let now = Clock::now();
        self.watches.iter_mut().for_each(|watch| watch.look(now));
        if self.retired.elapsed() >= RETIRE {
            self.retired = Clock::now();
            let (folder, keep) = (StatePaths::clone(&self.folder), self.keep);
            let checkpoints = self.keeper.checkpoints().clone();
            self.retiring.take();
            self.retiring.start(move || {
                // What stays does no harm.
                let needed = checkpoints.oldest().ok().flatten().unwrap_or_default();
                let _ = retire(&folder.journal(), keep, needed);
                if let Ok(Some(oldest)) = oldest(&folder.journal()) {
                    folder.commits().forget(oldest);
                }
            });
        }
        events
    }

    /// Whether all sources have come to their ends, or the engine cannot go on.
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.engine.is_finished()
    }

    /// How often the engine thread has gone round: it lives for as long as this grows.
    #[must_use]
    pub fn beat(&self) -> u64 {
        self.shared.beat.load(Ordering::Relaxed)
    }

    /// What the engine thread knew within the last second or two.
    #[must_use]
    pub fn snapshot(&self) -> Snapshot {
        self.shared.read()
    }

    /// The channels, in the order of [`Snapshot::counts`].
    #[must_use]
    pub fn channels(&self) -> &[String] {
        &self.channels
    }

    /// The sources, and what each counts.
    #[must_use]
    pub fn sources(&self) -> &[(String, Arc<SourceCounts>)] {
        &self.sources
    }

    /// The sinks, and what each counts.
    #[must_use]
    pub fn sinks(&self) -> &[(String, Arc<SinkCounts>)] {
        &self.sinks
    }

    /// How the journal is.
    #[must_use]
    pub fn journal(&self) -> JournalStatus {
        self.progress.status()
    }

    /// Freezes learning, or lets it go on, before the next tick.
    pub fn freeze(&mut self, frozen: bool) {
        self.order(Order::Freeze(frozen));
    }

    /// Writes a remark into the journal.
    pub fn note(&mut self, text: &str) {
        self.order(Order::Note(text.into()));
    }

    /// Lets a graph take over before the next tick, with what it can take of the states of what runs.
    ///
    /// # Errors
    /// When it cannot take over; what runs is untouched.
    pub fn swap(&mut self, model: &Model) -> Result<Vec<crate::engine::NodeCarry>, CommitError> {
        if let Some(revision) = model.revision() {
            self.folder.keep_model(model, &revision)?;
        }
        let carry = self.keeper.control().stage(model, false)?.carry().to_vec();
        self.keeper.commit()?;
        Ok(carry)
    }

    /// Ends: what waits is stepped, rows are put out, the journal is synced, and a checkpoint is taken.
    ///
    /// # Errors
    /// When the last checkpoint cannot be written. Everything is in the journal all the same.
    pub fn stop(mut self) -> Result<(Ended, Vec<ServiceEvent>), ServiceError> {
        self.stop_sources.ask();
        self.order(Order::Stop);
        let mut events = Vec::new();
        let began = Clock::now();
        while !self.engine.is_finished() && began.elapsed() < ENDS {
            events.extend(self.pump());
            std::thread::sleep(Wait::from_millis(2));
        }
        let worker = self.engine.is_finished().then(|| self.engine.join());
        let mut has_failed = self.has_failed;
        if let Some(Ok(worker)) = worker {
            let (_, _, recorder) = worker.into_parts();
            recorder.finish();
        } else {
            has_failed = true;
        }
        let ended = |thread: &JoinHandle<()>| thread.is_finished();
        while !self.sink_threads.iter().all(ended) && began.elapsed() < ENDS {
            std::thread::sleep(Wait::from_millis(2));
        }
        self.stop_sinks.ask();
        let snapshot = self.shared.read();
        events.extend(self.events.try_iter());
        let ended = Ended {
            channels: self.channels.into_iter().zip(snapshot.counts).collect(),
            happenings: snapshot.happenings,
            hurried: snapshot.hurried,
            journal: self.progress.status(),
            has_failed,
        };
        if !has_failed {
            self.keeper.finish()?;
        }
        // A source that does not stop does not keep the program from ending.
        drop(self.source_threads);
        Ok((ended, events))
    }

    fn order(&mut self, order: Order) {
        if self.orders.push(order).is_ok() {
            self.engine.thread().unpark();
        }
    }

    /// Lets the graph that was given take over from the one that ran last.
    fn replace(&mut self, model: &Model) {
        let event = match self.swap(model) {
            Ok(carry) => ServiceEvent::Staged {
                revision: model.revision().unwrap_or_default(),
                carry,
            },
            Err(error) => ServiceEvent::NotStaged(error.to_string()),
        };
        self.own.push(event);
    }
}

impl std::fmt::Debug for Service {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Service")
            .field("sources", &self.sources)
            .field("sinks", &self.sinks)
            .finish_non_exhaustive()
    }
}

fn wait(duration: Duration) -> Wait {
    Wait::from_nanos(duration.as_ns().max(0) as u64)
}

fn spawn<T: Send + 'static>(
    name: &str,
    work: impl FnOnce() -> T + Send + 'static,
) -> Result<JoinHandle<T>, ServiceError> {
    let thread = Builder::new().name(name.to_owned()).spawn(work);
    thread.map_err(ServiceError::Thread)
}

/// The folder that a service keeps its state in where the machine file names none: beside that file.
#[must_use]
pub fn usual_state(machine: &Path) -> PathBuf {
    machine.with_extension("state")
}
