//! Decides the course of a replacement on the control thread: stage, shadow, commit, roll back.

mod copy;
mod watching;

use std::fmt;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use rtrb::{Consumer, Producer, RingBuffer};

use super::handover::{Feed, Happening, LiveEngine, Mark};
use super::notice::Notice;
use super::retained::Retained;
use super::shadow::{Shadow, Verdict};
use super::staged::{Staged, cold};
use super::{LiveOptions, StageError, Stepper};
use crate::compile::Plan;
use crate::diagnostic::panic_text;
use crate::engine::{Engine, NodeCarry, StateTransfer};
use crate::model::Model;
use crate::time::{Duration, Instant};
use watching::Watching;

/// Engines that may be on their way in either direction.
const ON_THE_WAY: usize = 4;

/// The end of a running graph from which it is replaced.
pub struct Control {
    options: LiveOptions,
    feed: Arc<[Feed]>,
    ticks: Consumer<f64>,
    departing: Producer<Box<LiveEngine>>,
    returning: Consumer<Box<LiveEngine>>,
    /// What runs, to the same bits; none after ticks have been missed.
    replica: Option<LiveEngine>,
    /// The plan of what runs.
    running: Arc<Plan>,
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
    /// What happened and has not been reported yet.
    notices: Vec<Notice>,
    look: Option<Look>,
    watching: Watching,
}

type Look = Box<dyn FnMut(Instant, &Engine) + Send>;

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
    let record = feed.len() + Mark::WIDTH;
    let (mirror, ticks) = RingBuffer::new(options.mirrored.max(1) * record);
    let (departing, arriving) = RingBuffer::new(ON_THE_WAY);
    let (leaving, returning) = RingBuffer::new(ON_THE_WAY);
    let frozen = engine.frozen();
    let stepper = Stepper::new(seat(engine), Arc::clone(&feed), mirror, arriving, leaving);
    let span = options.retain.max(running.warm_up);
    let control = Control {
        retained: Retained::new(feed.len(), span, options.memory),
        row: vec![f64::NAN; record],
        notices: Vec::new(),
        look: None,
        watching: Watching::default(),
        replica: Some(seat(replica)),
        running,
        options,
        feed,
        ticks,
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
        std::mem::take(&mut self.notices)
    }

    /// From now on `look` sees each tick, and what runs as it is after it. Ticks that are missed are not seen.
    pub fn look_on(&mut self, look: impl FnMut(Instant, &Engine) + Send + 'static) {
        self.look = Some(Box::new(look));
    }

    /// Takes in what there is. What happened is kept for whoever pumps.
    fn catch_up(&mut self) {
        let mut notices = std::mem::take(&mut self.notices);
        for _ in 0..self.options.mirrored.max(1) {
            let Ok(chunk) = self.ticks.read_chunk(self.row.len()) else {
                break;
            };
            let (first, second) = chunk.as_slices();
            self.row[..first.len()].copy_from_slice(first);
            self.row[first.len()..].copy_from_slice(second);
            chunk.commit_all();
            self.take_in(&mut notices);
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
    /// When it cannot take over, or another graph is on its way; what runs, and what was staged before, is untouched.
    pub fn stage(&mut self, model: &Model, carry_learned: bool) -> Result<&Staged, StageError> {
        self.catch_up();
        if self.committed.is_some() {
            return Err(StageError::Busy);
        }
        StageError::between(&self.running, &model.plan).map_or(Ok(()), Err)?;
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

    /// The graph that runs, to the same bits; none after ticks have been missed.
    #[must_use]
    pub fn replica(&self) -> Option<&Engine> {
        self.replica.as_ref().map(|replica| &replica.engine)
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
        let engine = live.engine.twin().map_err(StageError::NotCopied)?;
        let mut copy = LiveEngine::new(engine, &self.feed, live.event)
            .expect("a twin reads what its twin reads");
        copy.outputs.clone_from(&live.outputs);
        let sent = self.departing.push(Box::new(copy));
        sent.map_err(|_| StageError::Busy)
    }

    /// Does to the engines here what an event did on the engine thread.
    fn take_in(&mut self, notices: &mut Vec<Notice>) {
        let row = std::mem::take(&mut self.row);
        self.take_in_row(&row, notices);
        self.row = row;
    }

    fn take_in_row(&mut self, row: &[f64], notices: &mut Vec<Notice>) {
        let (mark, samples) = row.split_at(Mark::WIDTH);
        let mark = Mark::read([mark[0], mark[1], mark[2], mark[3]]);
        let missed = mark.event - self.event - 1;
        if missed > 0 {
            self.lose(missed, notices);
            self.event += missed;
        }
        if self.replica.is_none() {
            self.take_back(notices);
            self.take_copy(notices);
        }
        self.event = mark.event;
        match mark.what {
            Happening::Break => self.segment(),
            Happening::Freeze(frozen) => self.freeze(frozen),
            Happening::Tick(time) => self.tick(mark, time, samples, notices),
        }
    }

    fn segment(&mut self) {
        self.last = None;
        self.retained.segment();
        self.watching.segment();
        self.for_all(LiveEngine::segment);
        if let Some(shadow) = self
            .staged
            .as_mut()
            .and_then(|staged| staged.shadow.as_mut())
        {
            shadow.segment();
        }
    }

    fn freeze(&mut self, frozen: bool) {
        self.frozen = frozen;
        self.for_all(|live| live.freeze(frozen));
    }

    fn tick(&mut self, mark: Mark, time: Instant, samples: &[f64], notices: &mut Vec<Notice>) {
        let elapsed = self.last.map_or(Duration::ZERO, |last| time - last);
        self.last = Some(time);
        self.watching.row(time, samples);
        if let Some(previous) = &mut self.previous {
            previous.left -= elapsed;
            if previous.left < Duration::ZERO {
                self.previous = None;
            }
        }
        if mark.generation != self.generation {
            self.generation = mark.generation;
            self.took_over(mark, time, notices);
        }
        self.for_all(|live| {
            // A tick that ran there runs here: the engines are the same.
            let _ = live.step(time, samples);
        });
        self.retained.push(time, samples);
        if let Some(replica) = &self.replica {
            self.watching.stepped(time, replica);
            if let Some(look) = &mut self.look {
                look(time, &replica.engine);
            }
        }
        if let (Some(staged), Some(replica)) = (&mut self.staged, &self.replica)
            && let Some(shadow) = &mut staged.shadow
        {
            shadow.look(&replica.engine, &staged.live.engine, time, elapsed);
        }
    }

    fn for_all(&mut self, act: impl FnMut(&mut LiveEngine)) {
        let staged = self.staged.iter_mut().map(|staged| &mut staged.live);
        let committed = self.committed.iter_mut();
        let previous = self.previous.iter_mut();
        self.replica
            .iter_mut()
            .chain(staged)
            .chain(committed.filter_map(|committed| committed.live.as_mut()))
            .chain(previous.map(|previous| &mut previous.live))
            .for_each(act);
    }

    fn took_over(&mut self, mark: Mark, time: Instant, notices: &mut Vec<Notice>) {
        self.take_back(notices);
        let returned = self.returned.take();
        let Some(Committed {
            live,
            revision,
            plan,
            ..
        }) = self.committed.take()
        else {
            return;
        };
        // The engine that ran stands in where there is no replica of it; a copy of what has taken over stays.
        let is_copy = |of: &mut LiveEngine| of.is_replica && of.revision == revision;
        let copy = self.replica.take_if(|of| live.is_none() && is_copy(of));
        let old = self.replica.take().or_else(|| {
            returned
                .map(|returned| *returned)
                .filter(|returned| returned.event + 1 == mark.event)
        });
        notices.push(Notice::TookOver {
            revision,
            tick: mark.tick,
            time,
        });
        self.retained.keep(self.options.retain.max(plan.warm_up));
        self.running = plan;
        self.replica = copy;
        if let (Some(mut live), Some(old)) = (live, old) {
            live.take_over(&old.engine);
            self.replica = Some(live);
            self.previous = Some(Previous {
                live: old,
                left: self.options.keep_warm,
            });
        }
        self.watch_on(time);
    }

    /// Takes what the engine thread has sent back; it is freed here.
    fn take_back(&mut self, notices: &mut Vec<Notice>) {
        while let Ok(returned) = self.returning.pop() {
            if returned.is_replica {
                self.copy = Some(returned);
                continue;
            }
            if !returned.refused {
                self.returned = Some(returned);
                continue;
            }
            notices.push(Notice::SentBack);
            let Some(Committed {
                live: Some(live),
                origin,
                ..
            }) = self.committed.take()
            else {
                continue;
            };
            match origin {
                Origin::Staged { carry, past, gave } => {
                    self.staged = Some(Staged {
                        live,
                        carry,
                        past,
                        gave,
                        shadow: None,
                    });
                }
                Origin::Previous { left } => self.previous = Some(Previous { live, left }),
            }
        }
    }

    fn lose(&mut self, ticks: u64, notices: &mut Vec<Notice>) {
        notices.push(Notice::Missed { ticks });
        self.last = None;
        self.replica = None;
        self.staged = None;
        self.previous = None;
        // The engine thread has what was committed, and may yet take it over.
        if let Some(committed) = &mut self.committed {
            committed.live = None;
        }
        self.retained.clear();
    }
}

impl Committed {
    fn new(live: LiveEngine, origin: Origin) -> Self {
        Self {
            revision: live.revision.clone(),
            plan: Arc::clone(live.engine.plan()),
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
