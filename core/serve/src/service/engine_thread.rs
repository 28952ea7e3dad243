//! The engine thread: takes what sources give, steps what is due, hands rows to sinks. In the steady state it allocates, locks and
//! waits for nothing but the next arrival or the next moment at which something is due.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::thread::Thread;
use std::time::Duration as Wait;

use athermal_run::live::{Keep as _, LiveGraph, Order, Output};
use rtrb::{Consumer, Producer};

use super::ServiceEvent;
use super::frames::FrameSender;
use super::status::Shared;
use crate::bell::{Bell, Mailbox};
use crate::compile::Plan;
use crate::connector::{Arrival, SourceLink};
use crate::diagnostic::panic_text;
use crate::engine::EngineError;
use crate::journal::Recorder;
use crate::moment::{Moment, MonotonicClock};
use crate::sequencer::{Admission, Leader, Sequencer};
use crate::time::{Duration, Instant};

/// How many arrivals of a source are taken before time is looked at again.
const BATCH: usize = 256;
/// Something came twice within this: much comes.
const BUSY: Duration = Duration::from_ns(100_000_000);
/// Where a tick is due so soon, samples go into the journal together with it.
const SOON: Wait = Wait::from_millis(250);
/// The longest sleep while the journal has a gap, which is to end soon.
const GAP: Wait = Wait::from_millis(100);
/// The longest sleep where sources are held back until the journal thread or the replica has caught up.
const HOLD: Wait = Wait::from_millis(1);
/// For how long the control thread is waited for at most, which may hang; and for how long a copy for it may wait for a moment at which
/// nothing is due.
const PATIENCE: Duration = Duration::from_ns(1_000_000_000);

/// What the control thread asks of the engine thread.
#[derive(Debug)]
pub(super) enum Request {
    Order(Order),
    /// To step what waits, and end.
    Stop,
}

/// What the engine thread has to report.
#[derive(Debug)]
pub(super) enum Remark {
    /// A sample of a channel was not accepted, for the so many-th time; whose clock is ahead of it.
    NotAccepted(usize, Admission, u64, Option<Leader>),
    /// The last tick was of the future: it is the time of a stamp.
    WentBack(Instant, Instant),
}

/// All that the engine thread has.
pub(super) struct EngineThread {
    pub(super) graph: LiveGraph<Recorder>,
    pub(super) clock: MonotonicClock,
    pub(super) sources: Vec<SourceLink>,
    pub(super) sinks: Sinks,
    pub(super) orders: Consumer<Request>,
    pub(super) remarks: Producer<Remark>,
    pub(super) shared: Arc<Shared>,
    pub(super) events: Mailbox<ServiceEvent>,
    /// Of the control thread.
    pub(super) control: Bell,
}

/// Where rows go.
#[derive(Default)]
pub(super) struct Sinks {
    all: Vec<SinkEnd>,
    /// How many graphs had taken over when the columns were looked up.
    generation: Option<u64>,
    revision: u64,
}

/// A sink, as far as the engine thread knows it.
struct SinkEnd {
    sender: FrameSender,
    columns: Vec<String>,
    thread: Thread,
}

impl Sinks {
    /// One more, with its columns.
    pub(super) fn add(&mut self, sender: FrameSender, columns: Vec<String>, thread: Thread) {
        self.all.push(SinkEnd {
            sender,
            columns,
            thread,
        });
    }

    fn put(&mut self, output: &Output<'_>) {
        let stepped = &output.stepped;
        if self.generation != Some(stepped.generation) {
            self.generation = Some(stepped.generation);
            self.revision = u64::from_str_radix(stepped.revision, 16).unwrap_or_default();
            self.wire(stepped.plan);
        }
        for sink in &mut self.all {
            sink.sender.send(output, self.revision);
            sink.thread.unpark();
        }
    }

    /// No more will come.
    fn end(&mut self) {
        for SinkEnd { sender, thread, .. } in self.all.drain(..) {
            drop(sender);
            thread.unpark();
        }
    }

    /// Looks up where the columns stand among the outputs of a graph that has taken over.
    fn wire(&mut self, plan: &Plan) {
        for sink in &mut self.all {
            let place = |column: &String| plan.outputs.iter().position(|of| of.name == *column);
            sink.sender.wire(sink.columns.iter().map(place));
        }
    }
}

impl EngineThread {
    /// Runs until it is to stop, or all sources have ended. Gives the graph back.
    pub(super) fn run(mut self) -> LiveGraph<Recorder> {
        let ran = catch_unwind(AssertUnwindSafe(|| self.work()));
        let failure = match ran {
            Ok(Ok(())) => None,
            Ok(Err(error)) => Some(error.to_string()),
            Err(panic) => Some(panic_text(&*panic)),
        };
        if let Some(failure) = failure {
            self.events.send(ServiceEvent::EngineFailed(failure));
        }
        self.publish();
        self.sinks.end();
        self.shared.has_ended.store(true, Ordering::Release);
        self.control.ring();
        self.graph
    }

    fn work(&mut self) -> Result<(), EngineError> {
        let mut left = self.sources.len();
        let (mut published, mut sound) = (Moment::START, self.clock.now());
        // Since when nothing that takes a moment has been asked for in vain.
        let mut copied = self.clock.now();
        let mut is_stopped = false;
        // When something came the last two times.
        let mut came = [Moment::START; 2];
        loop {
            self.shared.beat.fetch_add(1, Ordering::Relaxed);
            let was_stopped = is_stopped;
            let before = self.graph.keep().happenings();
            let records = self.graph.keep().event();
            while let Ok(request) = self.orders.pop() {
                match request {
                    Request::Order(order) => self.graph.order(order),
                    Request::Stop => is_stopped = true,
                }
            }
            let mut has_more = false;
            let now = self.clock.now();
            let is_ahead = self.graph.is_crowded();
            sound = if is_ahead { sound } else { now };
            let is_patient = now - sound < PATIENCE;
            let is_behind = self.graph.keep().is_crowded();
            let is_crowded = is_behind || is_ahead && is_patient;
            // Sources of clocks too wait for a journal thread that gets on.
            let sequencer = self.graph.sequencer();
            let is_full = is_behind || sequencer.is_some_and(Sequencer::is_crowded);
            for nth in 0..self.sources.len() {
                let source = &self.sources[nth];
                let is_held = was_stopped || is_full && source.is_giving();
                if !is_held && (!is_crowded || !source.waits) {
                    has_more |= self.take(nth, &mut left)?;
                }
            }
            let now = self.clock.now();
            if self.graph.keep().event() != records {
                // Where much comes it is acknowledged soon: a broker may wait for that.
                if now - came[0] < BUSY {
                    self.graph.keep().sync();
                }
                came = [came[1], now];
            }
            let sinks = &mut self.sinks;
            // What the control thread cannot take in is stepped later: a backlog of any length.
            let goes_on = |graph: &LiveGraph<_>| !is_patient || !graph.is_crowded();
            self.graph
                .pass_while(now, goes_on, |output| sinks.put(output))?;
            if let Some((last, to)) = self.graph.went_back() {
                let _ = self.remarks.push(Remark::WentBack(last, to));
                self.sources.iter().for_each(SourceLink::turn);
            }
            if self.graph.keep().happenings() != before {
                self.control.ring();
            }
            let is_over = is_stopped || left == 0;
            let put = |output: &Output<'_>| sinks.put(output);
            if is_over && self.graph.finish_while(now, goes_on, put)? {
                return Ok(());
            }
            if now - published >= Shared::EVERY.0 {
                published = now;
                self.publish();
            }
            copied = if self.graph.is_asked() { copied } else { now };
            if now - copied >= PATIENCE {
                copied = now;
                self.graph.rest();
            }
            if has_more {
                continue;
            }
            // What is due waits for the control thread, and sources for what is due.
            let is_held = is_crowded || self.graph.is_crowded();
            let longest = match (is_held || is_full, self.graph.keep().has_gap()) {
                (true, _) => HOLD,
                (false, true) => GAP,
                (false, false) => until(published + Shared::EVERY.1, self.clock.now()),
            };
            let due = self.graph.due().filter(|_| !is_held);
            let now = self.clock.now();
            let nap = due.map_or(longest, |due| until(due, now).min(longest));
            if !nap.is_zero() && !is_held {
                self.graph.rest();
            }
            if nap > SOON || is_held {
                self.graph.keep().sync();
            }
            if !nap.is_zero() {
                std::thread::park_timeout(nap);
            }
        }
    }

    /// Takes what a source has given; true where there may be more.
    fn take(&mut self, nth: usize, left: &mut usize) -> Result<bool, EngineError> {
        // Samples of a row that are still to come: they are there already.
        let (mut taken, mut together) = (0, 0);
        while taken < BATCH || together > 0 {
            taken += 1;
            let Some(arrival) = self.sources[nth].next() else {
                self.recorded(nth);
                return Ok(false);
            };
            let now = self.clock.now();
            match arrival {
                Arrival::Row(samples) => together = samples,
                Arrival::Thinned(samples) => self.graph.order(Order::Thinned(nth, samples)),
                Arrival::Sample(sample) => {
                    together = together.saturating_sub(1);
                    let admission = self.graph.arrive(sample, now);
                    if !matches!(
                        admission,
                        Admission::Accepted(_) | Admission::Waits(_) | Admission::Held
                    ) {
                        self.remark(sample.channel as usize, admission);
                    }
                }
                Arrival::Connected => self.graph.order(Order::Connected(nth, now)),
                Arrival::Away => self.graph.order(Order::Away(nth, now)),
                Arrival::Segment => {
                    let sinks = &mut self.sinks;
                    self.graph.finish(now, |output| sinks.put(output))?;
                    self.graph.segment();
                }
                Arrival::Ended => {
                    self.graph.order(Order::Ended(nth));
                    *left -= 1;
                }
            }
        }
        self.recorded(nth);
        Ok(true)
    }

    fn recorded(&mut self, nth: usize) {
        let sequencer = self.graph.sequencer();
        if !sequencer.is_some_and(|of| of.holds(nth)) {
            self.sources[nth].recorded(self.graph.keep().event());
        }
    }

    /// Hands the first of a reason on, the tenth, the hundredth …
    fn remark(&mut self, channel: usize, admission: Admission) {
        let sequencer = self.graph.sequencer();
        let counts = sequencer.and_then(|of| of.counts().get(channel));
        let count = counts.map_or(1, |counts| counts.of(admission));
        if count
            .checked_ilog10()
            .is_some_and(|of| 10_u64.pow(of) == count)
        {
            let leader = self.graph.leader(admission, self.clock.now());
            let remark = Remark::NotAccepted(channel, admission, count, leader);
            let _ = self.remarks.push(remark);
            self.control.ring();
        }
    }

    fn publish(&mut self) {
        let now = self.clock.now();
        // Whoever reads does so for a moment; otherwise a second later does.
        if let Ok(mut snapshot) = self.shared.snapshot.try_lock() {
            self.graph.facts(&mut snapshot, now);
        }
    }
}

/// How long until a moment.
fn until(moment: Moment, now: Moment) -> Wait {
    Wait::from_nanos((moment - now).as_ns().max(0) as u64)
}
