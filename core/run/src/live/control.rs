//! Decides the course of a replacement on the control thread: stage, shadow, commit, roll back.

mod copy;
mod taking;
mod watching;

use std::fmt;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use rtrb::{Consumer, Producer, RingBuffer};

use super::handover::{Feed, LiveEngine, Mark};
use super::notice::Notice;
use super::retained::Retained;
use super::shadow::{Shadow, Verdict};
use super::staged::{Staged, cold};
use super::tick_view::TickView;
use super::{LiveOptions, StageError, Stepper};
use crate::compile::Plan;
use crate::diagnostic::panic_text;
use crate::engine::{Engine, NodeCarry, StateTransfer};
use crate::model::Model;
use crate::time::{Duration, Instant};
use watching::Watching;

/// So many ticks have room at first, unless there is a replica all the time.
const FIRST: usize = 256;
/// Where so many wait at once, they come fast, and get all the room that they may have.
const SEVERAL: usize = 4;
/// Engines that may be on their way in either direction.
const ON_THE_WAY: usize = 4;

/// The end of a running graph from which it is replaced.
pub struct Control {
    options: LiveOptions,
    feed: Arc<[Feed]>,
    ticks: Consumer<f64>,
    /// To hand a ring with more room over, once; and its end here until the one before has been read.
    wider: Option<Producer<Producer<f64>>>,
    next_ticks: Option<Consumer<f64>>,
    departing: Producer<Box<LiveEngine>>,
    returning: Consumer<Box<LiveEngine>>,
    /// What runs, to the same bits: for as long as something needs it, and not after ticks have been missed.
    replica: Option<LiveEngine>,
    /// Whether something has needed it since the last pump.
    is_needed: bool,
    /// Whether ticks were missed, and no copy of what runs has come since.
    is_lost: bool,
    /// Asks the engine thread for a copy of what runs.
    is_asked: Arc<AtomicBool>,
    /// The plan of what runs, its revision, and the slots of it that are mirrored.
    running: Arc<Plan>,
    revision: String,
    shown: Arc<[usize]>,
    /// The nodes that were given up, as far as they are known here, and how many there are.
    given_up: Vec<String>,
    given_up_there: usize,
    retained: Retained,
    staged: Option<Staged>,
    /// What has been committed, until the engine thread has taken it over or sent it back.
    committed: Option<Committed>,
    /// What the engine thread has sent back after a hand-over that is not yet known here.
    returned: Option<Box<LiveEngine>>,
    /// A copy of what runs, after something was missed, until all that came before it has been taken in.
    copy: Option<Box<LiveEngine>>,
    previous: Option<Previous>,
    event: u64,
    last: Option<Instant>,
    /// Whether learning is frozen on command.
    frozen: bool,
    generation: u64,
    row: Vec<f64>,
    /// How many numbers a tick takes, of the graph that ran first.
    record: usize,
    /// What happened and has not been reported yet.
    notices: Vec<Notice>,
    look: Option<Look>,
    watching: Watching,
}

/// What runs.
#[derive(Debug, Clone, Copy)]
pub struct Running<'a> {
    /// Its plan.
    pub plan: &'a Arc<Plan>,
    /// Its revision.
    pub revision: &'a str,
    /// Whether learning is frozen on command.
    pub frozen: bool,
}

type Look = Box<dyn FnMut(&TickView<'_>) + Send>;

/// The graph before the last swap, kept warm for a while yet.
struct Previous {
    live: LiveEngine,
    left: Duration,
}

/// A graph of which a copy is on its way to the engine thread.
struct Committed {
    /// None once ticks have been missed since.
    live: Option<LiveEngine>,
    revision: String,
    plan: Arc<Plan>,
    shown: Arc<[usize]>,
    origin: Origin,
}

/// Where a graph goes that the engine thread sends back.
enum Origin {
    Staged {
        carry: Vec<NodeCarry>,
        past: Duration,
        gave: Vec<bool>,
    },
    Previous {
        left: Duration,
    },
}

/// The two ends of an engine of which there is a replica.
pub(super) fn pair(
    mut engine: Engine,
    mut replica: Engine,
    options: LiveOptions,
) -> (Stepper, Control) {
    if options.isolates {
        engine.isolate_panics();
        replica.isolate_panics();
    }
    let running = Arc::clone(engine.plan());
    let mut feed = Feed::of(&running);
    for channel in &options.channels {
        if !feed.contains(channel) {
            feed.push(channel.clone());
        }
    }
    let feed: Arc<[Feed]> = feed.into();
    let seat =
        |engine| LiveEngine::new(engine, &feed, 0).expect("the feed has all channels of the plan");
    let live = seat(engine);
    let record = Mark::WIDTH + feed.len() + running.outputs.len() + live.shown.len();
    let begin = match options.mirrors {
        true => options.mirrored,
        false => options.mirrored.min(FIRST),
    };
    let (mirror, ticks) = RingBuffer::new(begin.max(1) * record);
    let (wider, to_come) = RingBuffer::new(1);
    let wider = (begin < options.mirrored).then_some(wider);
    let (departing, arriving) = RingBuffer::new(ON_THE_WAY);
    let (leaving, returning) = RingBuffer::new(ON_THE_WAY);
    let (frozen, revision) = (live.engine.frozen(), live.revision.clone());
    let (shown, is_asked) = (Arc::clone(&live.shown), Arc::<AtomicBool>::default());
    let ends = (arriving, leaving);
    let stepper = Stepper::new(
        live,
        Arc::clone(&feed),
        (Some(mirror), to_come),
        ends,
        Arc::clone(&is_asked),
    );
    let span = options.retain.max(running.warm_up);
    let control = Control {
        retained: Retained::new(feed.len(), span, options.memory),
        row: Vec::new(),
        notices: Vec::new(),
        look: None,
        watching: Watching::default(),
        replica: Some(seat(replica)),
        is_needed: true,
        is_lost: false,
        is_asked,
        running,
        revision,
        shown,
        given_up: Vec::new(),
        given_up_there: 0,
        options,
        feed,
        ticks,
        wider,
        next_ticks: None,
        record,
        departing,
        returning,
        staged: None,
        committed: None,
        returned: None,
        copy: None,
        previous: None,
        event: 0,
        last: None,
        frozen,
        generation: 0,
    };
    (stepper, control)
}

impl Control {
    /// Takes in ticks that have been stepped since the last call, [`LiveOptions::mirrored`] of them at most, and returns what happened.
    /// Call it often enough that the ring does not fill: at least once in so many ticks.
    pub fn pump(&mut self) -> Vec<Notice> {
        self.catch_up();
        let is_kept = self.options.mirrors
            || self.is_lost
            || std::mem::take(&mut self.is_needed)
            || self.staged.is_some()
            || self.committed.is_some()
            || self.previous.is_some()
            || self.watching.looks_inside()
            || self.given_up.len() < self.given_up_there;
        if !is_kept {
            self.replica = None;
        }
        self.is_asked
            .store(is_kept && self.replica.is_none(), Ordering::Relaxed);
        std::mem::take(&mut self.notices)
    }

    /// Asks for the replica, until the next [`pump`](Self::pump) but one: whether it is there. Until then the engine thread is to
    /// [`mirror`](Stepper::mirror) what runs.
    pub fn needs_replica(&mut self) -> bool {
        self.is_needed = true;
        self.catch_up();
        self.is_asked
            .store(self.replica.is_none(), Ordering::Relaxed);
        self.replica.is_some()
    }

    /// From now on `look` sees each tick. Ticks that are missed are not seen.
    pub fn look_on(&mut self, look: impl FnMut(&TickView<'_>) + Send + 'static) {
        self.look = Some(Box::new(look));
        self.look_into();
    }

    /// What runs is known with all that whoever looks on may ask for.
    fn look_into(&mut self) {
        if let (Some(replica), Some(_)) = (&mut self.replica, &self.look) {
            replica.look_into();
        }
    }

    /// Takes in what there is. What happened is kept for whoever pumps.
    fn catch_up(&mut self) {
        let mut notices = std::mem::take(&mut self.notices);
        if self.ticks.slots() >= SEVERAL * self.record
            && let Some(mut wider) = self.wider.take()
        {
            let (mirror, ticks) = RingBuffer::new(self.options.mirrored * self.record);
            self.next_ticks = wider.push(mirror).is_ok().then_some(ticks);
        }
        for _ in 0..self.options.mirrored.max(1) {
            let mut mark = [f64::NAN; Mark::WIDTH];
            if self.ticks.is_abandoned()
                && self.ticks.is_empty()
                && let Some(next) = self.next_ticks.take()
            {
                self.ticks = next;
            }
            if self.ticks.pop_entire_slice(&mut mark).is_err() {
                break;
            }
            self.take_in(Mark::read(mark), &mut notices);
        }
        self.take_back(&mut notices);
        self.take_copy_at_rest(&mut notices);
        self.notices = notices;
    }

    /// Makes a graph ready to take over: all that it can is carried from what runs, the rest is warmed by the retained past.
    ///
    /// With `carry_learned`, what was learned of an estimator is carried although it has been fitted anew.
    ///
    /// # Errors
    /// When it cannot take over, another graph is on its way, or there is no [replica](Self::needs_replica) yet; what runs, and what was
    /// staged before, is untouched.
    pub fn stage(&mut self, model: &Model, carry_learned: bool) -> Result<&Staged, StageError> {
        self.catch_up();
        if self.committed.is_some() {
            return Err(StageError::Busy);
        }
        StageError::between(&self.running, &model.plan).map_or(Ok(()), Err)?;
        if !self.needs_replica() && !self.is_lost {
            return Err(StageError::NoCopy);
        }
        // What runs goes on whatever the code of a node does to what is being made.
        let made = catch_unwind(AssertUnwindSafe(|| self.made_ready(model, carry_learned)));
        let staged = made.unwrap_or_else(|panic| {
            let text = panic_text(&*panic);
            Err(StageError::Panicked { text })
        })?;
        Ok(self.staged.insert(staged))
    }

    /// A graph that is ready to take over.
    fn made_ready(&self, model: &Model, carry_learned: bool) -> Result<Staged, StageError> {
        let engine =
            Engine::new(Arc::clone(&model.plan), &model.fitted).map_err(StageError::Engine)?;
        let mut live = LiveEngine::new(engine, &self.feed, 0)
            .map_err(|channels| StageError::MissingChannels { channels })?;
        live.engine.freeze(self.frozen);
        if self.options.isolates {
            live.engine.isolate_panics();
        }
        let mut warmed = false;
        let outputs = model.plan.outputs.iter();
        let slots: Vec<_> = outputs.map(|output| output.slot).collect();
        let mut gave = vec![false; slots.len()];
        self.retained.for_each(|time, samples| match time {
            Some(time) => {
                warmed |= live.step(time, samples).is_ok();
                for (gave, &slot) in gave.iter_mut().zip(&slots) {
                    *gave |= !live.engine.value(slot).is_nan();
                }
            }
            None => live.segment(),
        });
        let carry = match &self.replica {
            Some(replica) => {
                let transfer = StateTransfer::between(&replica.engine, &live.engine, carry_learned);
                let state = replica.engine.state();
                live.engine.adopt(&state, &transfer, warmed)
            }
            None => cold(&live.engine, warmed),
        };
        live.event = self.event;
        live.usual = model.sample_ranges().to_vec();
        Ok(Staged {
            live,
            carry,
            past: self.retained.span(),
            gave,
            shadow: None,
        })
    }

    /// Compares the staged graph with what runs for a while; see [`Control::verdict`].
    ///
    /// # Errors
    /// When nothing is staged, or ticks were missed.
    pub fn shadow(&mut self, duration: Duration, margin: f64) -> Result<(), StageError> {
        self.catch_up();
        let staged = self.staged.as_mut().ok_or(StageError::NothingStaged)?;
        let replica = self.replica.as_ref().ok_or(StageError::NotMirrored)?;
        staged.shadow = Some(Shadow::new(
            &replica.engine,
            &staged.live.engine,
            duration,
            margin,
        ));
        Ok(())
    }

    /// What the comparison has come to; none where there is none.
    #[must_use]
    pub fn verdict(&self) -> Option<Verdict> {
        Some(self.staged.as_ref()?.shadow.as_ref()?.verdict())
    }

    /// The graph that is staged.
    #[must_use]
    pub fn staged(&self) -> Option<&Staged> {
        self.staged.as_ref()
    }

    /// The graph that is staged and the one before the last swap, as each would take over after [`events`](Self::events).
    #[must_use]
    pub fn beside(&self) -> [Option<&Engine>; 2] {
        let staged = self.staged.as_ref().map(|of| &of.live.engine);
        [staged, self.previous.as_ref().map(|of| &of.live.engine)]
    }

    /// Lets go of what is staged; what runs goes on.
    pub fn discard(&mut self) {
        self.staged = None;
    }

    /// Lets the staged graph take over before the next tick, whatever a comparison has come to.
    ///
    /// # Errors
    /// When nothing is staged, or a graph is still on its way; what is staged stays so.
    pub fn commit(&mut self) -> Result<(), StageError> {
        self.catch_up();
        let mut staged = self.staged.take().ok_or(StageError::NothingStaged)?;
        // A rollback may have come between, to a graph that it was not set against.
        let unfit = StageError::between(&self.running, staged.live.engine.plan());
        if let Err(error) = unfit.map_or_else(|| self.send(&mut staged.live), Err) {
            self.staged = Some(staged);
            return Err(error);
        }
        let Staged {
            live,
            carry,
            past,
            gave,
            ..
        } = staged;
        let origin = Origin::Staged { carry, past, gave };
        self.committed = Some(Committed::new(live, origin));
        Ok(())
    }

    /// Lets the graph before the last swap take over again, as it would be had it never been replaced.
    ///
    /// # Errors
    /// When there is none that is still warm, or a graph is still on its way.
    pub fn rollback(&mut self) -> Result<(), StageError> {
        self.catch_up();
        let mut previous = self.previous.take().ok_or(StageError::NothingToTakeBack)?;
        if let Err(error) = self.send(&mut previous.live) {
            self.previous = Some(previous);
            return Err(error);
        }
        let Previous { live, left } = previous;
        self.committed = Some(Committed::new(live, Origin::Previous { left }));
        Ok(())
    }

    /// The graph that runs, to the same bits; none while nothing needs it, and after ticks have been missed.
    #[must_use]
    pub fn replica(&self) -> Option<&Engine> {
        self.replica.as_ref().map(|replica| &replica.engine)
    }

    /// What runs, after the ticks that have been taken in; none after ticks have been missed.
    #[must_use]
    pub fn running(&self) -> Option<Running<'_>> {
        (!self.is_lost).then_some(Running {
            plan: &self.running,
            revision: &self.revision,
            frozen: self.frozen,
        })
    }

    /// The nodes of what runs that were given up, in the order of their panics, and why.
    #[must_use]
    pub fn given_up(&self) -> &[String] {
        &self.given_up
    }

    /// How many ticks, segment breaks and freezes have been taken in: the replica is that of the running graph after so many.
    #[must_use]
    pub fn events(&self) -> u64 {
        self.event
    }

    /// Whether a graph is on its way to the engine thread: committed, and neither taken over nor sent back.
    pub fn is_on_the_way(&mut self) -> bool {
        self.catch_up();
        self.committed.is_some()
    }

    /// How much of the past is retained.
    #[must_use]
    pub fn retained(&self) -> Duration {
        self.retained.span()
    }

    /// The retained past as a recording of a plan, for fitting it again. Channels that the past lacks are absent.
    #[must_use]
    pub fn recording(&self, plan: &Plan, from: Instant, to: Instant) -> crate::recording::Table {
        let place = |feed: &Feed| self.feed.iter().position(|fed| fed == feed);
        let places: Vec<_> = Feed::of(plan).iter().map(place).collect();
        let mut table = crate::recording::Table::default();
        self.retained.for_each(|time, samples| match time {
            Some(time) if time >= from && time <= to => {
                let row: Vec<f64> = places
                    .iter()
                    .map(|place| place.map_or(f64::NAN, |place| samples[place]))
                    .collect();
                table.push(time, &row);
            }
            Some(_) => {}
            None => table.segment(),
        });
        table
    }

    /// Sends a copy of a graph to the engine thread.
    fn send(&mut self, live: &mut LiveEngine) -> Result<(), StageError> {
        if self.committed.is_some() {
            return Err(StageError::Busy);
        }
        live.follow(&self.running);
        let engine = live.engine.twin_on(&live.plan);
        let engine = engine.map_err(StageError::NotCopied)?;
        let mut copy = LiveEngine::new(engine, &self.feed, live.event)
            .expect("a twin reads what its twin reads");
        copy.outputs.clone_from(&live.outputs);
        let sent = self.departing.push(Box::new(copy));
        sent.map_err(|_| StageError::Busy)
    }
}

impl Committed {
    fn new(live: LiveEngine, origin: Origin) -> Self {
        Self {
            revision: live.revision.clone(),
            plan: Arc::clone(&live.plan),
            shown: Arc::clone(&live.shown),
            live: Some(live),
            origin,
        }
    }
}

impl fmt::Debug for Control {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Control")
            .field("event", &self.event)
            .field("generation", &self.generation)
            .finish_non_exhaustive()
    }
}
