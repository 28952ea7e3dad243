//! A service: sources, an engine thread with its journal, sinks, and a control thread, which is the caller's.
//!
//! ```text
//!  source threads ─ring─▶ engine thread: sequencer → stepper ─ring─▶ sink threads
//!                              │ records                                ▲ wait until written
//!                              ├─ring─▶ journal thread ─────────────────┘
//!                              └─ring─▶ control (the caller): replica, checkpoints, swaps, reports
//! ```

mod asked;
mod command;
mod ending;
mod engine_thread;
mod error;
mod event;
mod frames;
mod handle;
mod host_clock;
mod observer;
mod position;
mod prediction_error;
mod replacing;
mod sink_thread;
mod sinks;
mod source_thread;
mod sources;
mod status;
#[cfg(test)]
mod tests;
mod watch;
mod watcher;
mod wiring;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::thread::{Builder, JoinHandle, Thread};
use std::time::{Duration as Wait, Instant as Clock};

use athermal_run::live::{Feed, LiveGraph, LiveOptions, Notice, Order, pair_from};
use athermal_run::model::{Card, Model};
use rtrb::{Consumer, Producer, RingBuffer};

pub use crate::keeper::{CommitError, Held};
pub use asked::ChannelSamples;
pub use athermal_run::live::Snapshot;
pub use ending::Ended;
pub use error::ServiceError;
pub use event::{Ahead, OwnEvents, ServiceEvent, event_kinds};
pub use frames::SinkCounts;
pub use handle::{NoAnswer, ServiceHandle};
pub use observer::Observer;
pub use prediction_error::{PredictionError, PredictionErrors};
pub use watcher::{LastTicks, Seen, Watcher};

use crate::aside::{Aside, within};
use crate::bell::{Bell, Mailbox};
use crate::checkpoint::Checkpoints;
use crate::companion::Shared as OfCompanions;
use crate::compile::Plan;
use crate::connector::{SourceCounts, Stop};
use crate::deployment::{DeclaredSink, Deployment};
use crate::facts::SectionFacts;
use crate::folder::{FolderError, StateFolder, StatePaths, may_pass};
use crate::host;
use crate::journal::{FeedNames, JournalOptions, Keep, Progress, Recorder, oldest, retire};
use crate::keeper::Keeper;
use crate::moment::MonotonicClock;
use crate::recovery::{Recovered, RecoveryReport};
use crate::sequencer::Sequencer;
use crate::time::{Duration, Instant};
use engine_thread::{EngineThread, Remark, Request};
use handle::Work;
use host_clock::HostClock;
pub(crate) use observer::Observers;
use replacing::Comparison;
use sinks::OpenSink;
use status::Shared;
use watch::Watch;
use wiring::{fed, keep, rules};

/// How often old files of the journal are looked at.
const RETIRE: Wait = Wait::from_secs(60);

/// How a service is run.
#[derive(Debug, Clone)]
pub struct ServiceOptions {
    /// The state folder.
    pub state: PathBuf,
    /// Whether commands are not put out.
    pub is_dry: bool,
    /// Whether estimators learn nothing.
    pub frozen: bool,
    /// The machine file.
    pub machine: PathBuf,
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
            machine: PathBuf::new(),
            host_time: host::synchronised,
        }
    }
}

type Section = Box<dyn Fn() -> Box<dyn SectionFacts> + Send>;

/// A service at work.
pub struct Service {
    name: String,
    handle: ServiceHandle,
    asked: Receiver<Work>,
    observers: Observers,
    watcher: Watcher,
    /// How models were fitted, by their revisions.
    cards: BTreeMap<String, Card>,
    /// What companions know.
    sections: Vec<(&'static str, Section)>,
    companions: Vec<Box<dyn Send>>,
    shared_by_companions: OfCompanions,
    /// How many ticks, beats, breaks and freezes there were at the start.
    happened: u64,
    comparison: Option<Comparison>,
    is_asked_to_end: bool,
    /// The revision of the graph that the machine file gave.
    given: String,
    keeper: Keeper,
    engine: JoinHandle<LiveGraph<Recorder>>,
    orders: Producer<Request>,
    remarks: Consumer<Remark>,
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
    /// The model that was given, where it could not be kept yet.
    unkept: Option<Model>,
    keep: Keep,
    retired: Clock,
    retiring: Aside<()>,
    journal_is_degraded: bool,
    /// Whether the whole is, for the threads of sinks.
    sinks_know: Arc<AtomicBool>,
    /// How many nodes were given up and reported.
    given_up: usize,
    has_failed: bool,
    /// How many rows were put out or made again when that was looked at, and since when there are as many.
    put: (u64, Clock),
    began: Clock,
    /// The thread that started it, which is woken by what happens.
    control: Thread,
    /// When it last waited.
    waited: Clock,
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
            companions,
        } = deployment;
        let folder = StateFolder::open(&options.state)?;
        // A disk that cannot be written is a state, and no reason to do without corrections.
        let unkept = match model.revision().map(|of| folder.keep_model(model, &of)) {
            Some(Err(FolderError::NotWritten { error, .. })) if may_pass(&error) => {
                Some(model.clone())
            }
            Some(kept) => kept.map(|()| None)?,
            None => None,
        };
        let wiring = |of: &DeclaredSink| of.wiring(&model.plan, folder.path());
        let wired = |of: &DeclaredSink| (Arc::clone(&of.parameters), wiring(of));
        let messengers = sinks.iter().map(wired).collect();
        let open = |declared: DeclaredSink| {
            let wiring = wiring(&declared);
            OpenSink::open(declared, wiring, &folder)
        };
        let sinks = sinks.into_iter().map(open).collect::<Result<Vec<_>, _>>()?;
        let names: Vec<_> = sources.iter().map(|of| of.name.clone()).collect();
        let given = Feed::of(&model.plan);
        let checkpoints = Checkpoints::new(folder.checkpoints(), runtime.keep.checkpoints);
        let feed = |plan: &Plan| FeedNames::new(&fed(plan, &given), names.clone());
        // What sinks lack they make again.
        let recovered = Recovered::find(&folder, &checkpoints, model, feed, u64::MAX, |_, _| ())?;
        let happenings = recovered.happenings();
        let journal = JournalOptions {
            sync: wait(runtime.sync),
            ..JournalOptions::default()
        };
        let (prepare, begin) = (folder.preparation(), recovered.begin());
        let recorder = Recorder::start_after(prepare, &folder.journal(), begin, journal)?;
        let progress = Arc::clone(recorder.progress());
        let clock = MonotonicClock::start();
        let feed = fed(recovered.engine.plan(), &given);
        let rules = rules(&runtime, &sources, &feed);
        let stamps = recovered.timeline.stamps().to_vec();
        let mut sequencer = Sequencer::resume(rules, recovered.timeline, clock.now());
        let mut host = HostClock::new(options.host_time, clock, &sources);
        if let Some(guess) = host::now() {
            sequencer.guess(guess, clock.now());
        }
        if let Some((time, now)) = host.look(true) {
            sequencer.synchronise(time, now);
        }
        let live = LiveOptions {
            mirrors: false,
            isolates: true,
            retain: runtime.retain,
            channels: given.clone(),
            ..LiveOptions::default()
        };
        // What ran before goes on unless another graph is given than then.
        let given = model.revision().unwrap_or_default();
        let is_another = recovered.model.revision() != model.revision();
        let differs = is_another && folder.given().as_ref() != Some(&given);
        folder.commits().retain(..=happenings);
        let was_frozen = recovered.engine.frozen();
        let (stepper, mut control) = pair_from(recovered.engine, live)?;
        let (observers, watcher) = (Observers::default(), Watcher::default());
        observers.add(Box::new(watcher.clone()));
        control.watch(recovered.model.sample_ranges());
        let looking = observers.clone();
        control.look_on(move |tick| looking.tick(tick));
        let every = wait(runtime.checkpoint);
        let keeper = Keeper::new(
            control,
            (checkpoints, folder.commits()),
            Arc::clone(&progress),
            happenings,
            every,
        );
        let mut graph = LiveGraph::new(Some(sequencer), stepper, recorder);
        if was_frozen != options.frozen {
            graph.order(Order::Freeze(options.frozen));
        }
        let (to_engine, orders) = RingBuffer::new(64);
        let (remarks, from_engine) = RingBuffer::new(256);
        let (tell, events) = channel();
        let tell = Mailbox::new(tell, &Bell::here());
        let shared = Arc::new(Shared::new(feed.len()));
        let (stop_sources, stop_sinks) = (Stop::default(), Stop::default());
        // Sinks first: nothing that comes is put out into nowhere.
        let sinks_know = Arc::default();
        let threads = (&progress, &stop_sinks, &tell, &sinks_know);
        let running = sinks::start(sinks, options.is_dry, (&folder, happenings), threads)?;
        let (out, sink_threads, sink_counts) = running;
        // The engine thread waits for the links of sources, which need to know it.
        let (hand_over, links) = channel();
        let engine_thread = {
            let (shared, tell, control) = (Arc::clone(&shared), tell.clone(), Bell::here());
            spawn("engine", move || {
                let sources = links.recv().unwrap_or_default();
                let thread = EngineThread {
                    graph,
                    clock,
                    sources,
                    sinks: out,
                    orders,
                    remarks,
                    shared,
                    events: tell,
                    control,
                };
                thread.run()
            })?
        };
        let open = sources::open(
            sources,
            model,
            folder.path(),
            (&feed, &stamps),
            (engine_thread.thread(), &progress),
            (runtime.wait, runtime.future),
        )?;
        let _ = hand_over.send(open.links);
        let (handle, asked) = ServiceHandle::new();
        let stem = options.machine.file_stem();
        let stem = stem.map(|of| of.to_string_lossy().into_owned());
        let name = model.graph.name.clone().or(stem).unwrap_or_default();
        let mut service = Self {
            name,
            handle,
            asked,
            observers,
            watcher,
            cards: BTreeMap::new(),
            sections: Vec::new(),
            companions: Vec::new(),
            shared_by_companions: OfCompanions::default(),
            happened: happenings,
            comparison: None,
            is_asked_to_end: false,
            given,
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
            source_threads: Vec::new(),
            watches: open.watches,
            host,
            sinks: sink_counts,
            sink_threads,
            channels: feed.iter().map(|of| of.name.clone()).collect(),
            events,
            own: Vec::new(),
            folder,
            unkept,
            keep: keep(&runtime),
            retired: Clock::now(),
            retiring: Aside::default(),
            journal_is_degraded: false,
            sinks_know,
            given_up: 0,
            has_failed: false,
            put: (0, Clock::now()),
            began: Clock::now(),
            control: std::thread::current(),
            waited: Clock::now(),
        };
        service.note_fit(model);
        service.note_fit(&recovered.model);
        service.own.extend(service.host.first());
        if differs {
            service.replace(model);
        } else if !is_another {
            service.note_given(&service.given.clone());
        }
        // Only now: all that comes is stepped by the graph that was given.
        for source in open.inlets {
            let (stop, tell) = (service.stop_sources.clone(), tell.clone());
            let thread = spawn("source", move || source.run(&stop, &tell))?;
            service.source_threads.push(thread);
        }
        let beside = service.beside(options, messengers);
        for companion in companions {
            match companion.start(&beside) {
                Ok(running) => service.companions.push(running),
                Err(error) => {
                    // What else goes wrong then is no news.
                    let _ = service.stop();
                    return Err(ServiceError::Companion(error));
                }
            }
        }
        Ok((service, recovered.report))
    }

    /// What happened since the last call. Call it ten times a second, or after [`wait`](Self::wait): it also takes checkpoints.
    pub fn pump(&mut self) -> Vec<ServiceEvent> {
        let mut events = std::mem::take(&mut self.own);
        let sinks = self.sinks.iter().map(|(_, of)| of);
        let safe = sinks
            .clone()
            .map(|of| of.safe.load(Ordering::Relaxed))
            .min();
        self.keeper.checkpoints().need(safe.unwrap_or(u64::MAX));
        let counts = sinks.flat_map(|of| [&of.put, &of.again]);
        let put = counts.map(|of| of.load(Ordering::Relaxed)).sum();
        if put != self.put.0 {
            self.put = (put, Clock::now());
        }
        match self.keeper.pump() {
            Ok(notices) => events.extend(notices.into_iter().map(ServiceEvent::Swap)),
            Err(error) => events.push(ServiceEvent::NoCheckpoint(error)),
        }
        events.extend(self.found());
        while let Ok(work) = self.asked.try_recv() {
            work(self);
        }
        while let Ok(remark) = self.remarks.pop() {
            events.push(match remark {
                Remark::NotAccepted(place, admission, count, leader) => {
                    let channel = |of: usize| self.channels.get(of).cloned();
                    ServiceEvent::NotAccepted {
                        admission,
                        channel: channel(place),
                        count,
                        leader: leader.and_then(|of| {
                            Some(Ahead {
                                source: self.sources.get(of.source)?.0.clone(),
                                channel: channel(of.channel).unwrap_or_default(),
                                ahead: of.ahead,
                            })
                        }),
                    }
                }
                Remark::WentBack(last, to) => ServiceEvent::WentBack { last, to },
            });
        }
        let remark = |(source, words)| ServiceEvent::SourceRemark { source, words };
        events.extend(self.heard.try_iter().map(remark));
        while let Ok(event) = self.events.try_recv() {
            self.has_failed |= matches!(event, ServiceEvent::EngineFailed(_));
            events.push(event);
        }
        let given_up = self.keeper.look().given_up();
        let new = given_up.iter().skip(self.given_up).cloned();
        events.extend(new.map(ServiceEvent::NodeGivenUp));
        self.given_up = given_up.len();
        self.sinks_know.store(self.is_degraded(), Ordering::Relaxed);
        if self.observers.look_inside() && !self.keeper.control().needs_replica() {
            self.engine.thread().unpark();
        }
        let status = self.progress.status();
        if status.is_degraded != self.journal_is_degraded {
            self.journal_is_degraded = status.is_degraded;
            self.keep_model();
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
            self.keep_model();
            let (folder, keep) = (StatePaths::clone(&self.folder), self.keep);
            let checkpoints = self.keeper.checkpoints().clone();
            self.retiring.take();
            self.retiring.start(move || {
                // What stays does no harm.
                let needed = checkpoints.oldest().ok().flatten().unwrap_or_default();
                let _ = retire(&folder.journal(), keep, needed);
                if let Ok(Some(oldest)) = oldest(&folder.journal()) {
                    folder.commits().retain(oldest..);
                }
            });
        }
        self.compare(&mut events);
        for event in &events {
            if let ServiceEvent::Swap(Notice::TookOver { revision, .. }) = event {
                self.note_given(revision);
            }
        }
        self.observers.events(&events);
        events
    }

    /// Reports something that happened, as if it had happened here.
    pub fn report(&mut self, event: ServiceEvent) {
        self.own.push(event);
    }

    /// What companions have for each other.
    #[must_use]
    pub fn shared(&self) -> &OfCompanions {
        &self.shared_by_companions
    }

    /// To ask it from other threads.
    #[must_use]
    pub fn handle(&self) -> ServiceHandle {
        self.handle.clone()
    }

    /// Lets somebody look on.
    pub fn observe(&mut self, observer: Box<dyn Observer>) {
        self.observers.add(observer);
    }

    /// Gives facts that a companion knows a place among those of the service: see [`register_facts!`](crate::register_facts).
    pub fn contribute<T: SectionFacts + 'static>(
        &mut self,
        section: &'static str,
        read: impl Fn() -> T + Send + 'static,
    ) {
        let read: Section = Box::new(move || Box::new(read()));
        self.sections.push((section, read));
    }

    /// Takes a checkpoint, which is saved once the journal is synced up to it. After how many ticks, beats, breaks and freezes it is;
    /// none where none can be taken.
    pub fn checkpoint(&mut self, by: &str) -> Option<u64> {
        self.note(&format!("{by}: checkpoint"));
        self.await_replica();
        self.keeper.take_now()
    }

    /// Freezes learning, or lets it go on, before the next tick.
    pub fn freeze(&mut self, frozen: bool) {
        self.order(Order::Freeze(frozen));
    }

    /// Writes a remark into the journal.
    pub fn note(&mut self, text: &str) {
        self.order(Order::Note(text.into()));
    }

    fn found(&mut self) -> impl Iterator<Item = ServiceEvent> {
        let found = self.keeper.control().found().into_iter();
        found.map(|(at, finding)| ServiceEvent::Found(at, finding))
    }

    fn order(&mut self, order: Order) {
        self.request(Request::Order(order));
    }

    fn request(&mut self, request: Request) {
        if self.orders.push(request).is_ok() {
            self.engine.thread().unpark();
        }
    }

    /// Lets the graph that was given take over from the one that ran last.
    fn replace(&mut self, model: &Model) {
        let by = "start";
        let staged = self.stage(model, by).map(|of| of.carry().to_vec());
        let event = match staged.and_then(|carry| self.commit(by).map(|()| carry)) {
            Ok(carry) => ServiceEvent::Staged {
                revision: self.given.clone(),
                carry,
            },
            Err(error) => ServiceEvent::NotStaged(error.to_string()),
        };
        self.own.push(event);
    }

    /// Keeps in mind that the graph that was given ran: a restart with the same one goes on with what ran last.
    fn note_given(&self, revision: &str) {
        if revision == self.given {
            let (folder, revision) = (StatePaths::clone(&self.folder), revision.to_owned());
            // Where it cannot be written, a restart lets the given graph take over again.
            let _ = within(move || folder.note_given(&revision));
        }
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
