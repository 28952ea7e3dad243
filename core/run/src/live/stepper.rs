//! Decides what the engine thread does at a tick: step, mirror, and take over a new engine when one has come.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use rtrb::{Consumer, Producer, RingBuffer};

use super::handover::{Feed, Happening, LiveEngine, Mark};
use super::tick_view::values;
use crate::compile::Plan;
use crate::engine::{Engine, EngineError};
use crate::time::Instant;

/// Ticks and what else happens that are kept for an engine that comes a little late.
const RECENT: u64 = 256;
/// Ticks by which a new engine catches up at each tick, so that no tick becomes long.
const CATCH_UP: u64 = 4;

/// The end of a running graph that the engine thread owns.
pub struct Stepper {
    pub(super) live: Box<LiveEngine>,
    feed: Arc<[Feed]>,
    /// None where there is no control.
    ticks: Option<Producer<f64>>,
    /// A ring with more room, which the control makes where ticks come fast.
    wider: Consumer<Producer<f64>>,
    arriving: Consumer<Box<LiveEngine>>,
    leaving: Producer<Box<LiveEngine>>,
    next: Option<Box<LiveEngine>>,
    recent: Vec<f64>,
    event: u64,
    tick: u64,
    generation: u64,
    missed: u64,
    /// Whether the control thread asks for a copy of what runs.
    is_asked: Arc<AtomicBool>,
}

/// What came of a tick.
#[derive(Debug)]
pub struct Stepped<'a> {
    /// How many graphs have taken over so far.
    pub generation: u64,
    /// The revision of the graph that made the outputs. Graphs of one revision compute the same, but may give it in another order.
    pub revision: &'a str,
    /// Its plan, in whose order the outputs are.
    pub plan: &'a Plan,
    /// The outputs; NaN where a node did not run or gave nothing.
    pub outputs: &'a [f64],
}

impl Stepper {
    /// An engine without a control: it is never replaced.
    ///
    /// # Panics
    /// Never: it reads what its plan reads.
    #[must_use]
    pub fn alone(engine: Engine) -> Self {
        let feed: Arc<[Feed]> = Feed::of(engine.plan()).into();
        let live = LiveEngine::new(engine, &feed, 0).expect("the feed is that of the plan");
        let (leaving, arriving) = RingBuffer::new(1);
        let (_, wider) = RingBuffer::new(1);
        Self::new(
            live,
            feed,
            (None, wider),
            (arriving, leaving),
            Arc::default(),
        )
    }

    pub(super) fn new(
        live: LiveEngine,
        feed: Arc<[Feed]>,
        (ticks, wider): (Option<Producer<f64>>, Consumer<Producer<f64>>),
        (arriving, leaving): (Consumer<Box<LiveEngine>>, Producer<Box<LiveEngine>>),
        is_asked: Arc<AtomicBool>,
    ) -> Self {
        let width = feed.len() + 1;
        Self {
            live: Box::new(live),
            feed,
            ticks,
            wider,
            arriving,
            leaving,
            next: None,
            recent: vec![f64::NAN; RECENT as usize * width],
            event: 0,
            tick: 0,
            generation: 0,
            missed: 0,
            is_asked,
        }
    }

    /// The channels that samples are given for, in this order.
    #[must_use]
    pub fn feed(&self) -> &[Feed] {
        &self.feed
    }

    /// How many ticks and segment breaks could not be mirrored because the control thread was behind.
    #[must_use]
    pub fn missed(&self) -> u64 {
        self.missed
    }

    /// Whether the control thread is far behind: what is beyond the ring is missed.
    #[must_use]
    pub fn is_crowded(&self) -> bool {
        let ticks = self.ticks.as_ref();
        ticks.is_some_and(|of| of.slots() < of.buffer().capacity() / 2)
    }

    /// Whether the control thread asks for a copy of what runs: [`mirror`](Self::mirror) sends one.
    #[must_use]
    pub fn is_asked(&self) -> bool {
        self.is_asked.load(Ordering::Relaxed)
    }

    /// Whether a graph has been committed, or is catching up, and has not taken over.
    #[must_use]
    pub fn has_next(&self) -> bool {
        self.next.is_some() || !self.arriving.is_empty()
    }

    /// Sends the control thread a copy of what runs, where it asks for one and there is room for what follows. It takes as long as a
    /// snapshot, and asks for memory: for a moment in which nothing is due. True where it was sent.
    pub fn mirror(&mut self) -> bool {
        let LiveEngine { engine, places, .. } = &*self.live;
        let can_copy = !self.leaving.is_full();
        if !self.is_asked() || self.is_crowded() || !can_copy {
            return false;
        }
        // One that cannot be copied now is not tried again at each turn.
        self.is_asked.store(false, Ordering::Relaxed);
        let twin = catch_unwind(AssertUnwindSafe(|| engine.twin()));
        let Ok(Ok(engine)) = twin else {
            return false;
        };
        let copy = LiveEngine {
            plan: Arc::clone(&self.live.plan),
            revision: self.live.revision.clone(),
            samples: self.live.samples.clone(),
            places: places.clone(),
            outputs: self.live.outputs.clone(),
            event: self.event,
            shown: Arc::clone(&self.live.shown),
            usual: Vec::new(),
            refused: false,
            is_replica: true,
            engine,
        };
        self.leaving.push(Box::new(copy)).is_ok()
    }

    /// The engine that runs.
    #[must_use]
    pub fn engine(&self) -> &Engine {
        &self.live.engine
    }

    /// Takes the measurements of one instant, in the order of [`feed`](Self::feed), NaN where there is no new value.
    ///
    /// A new graph that has been committed takes over before the tick.
    ///
    /// # Errors
    /// A time that is not after the last one, or another number of samples: the engine is as it was.
    pub fn step(&mut self, time: Instant, samples: &[f64]) -> Result<Stepped<'_>, EngineError> {
        if samples.len() != self.feed.len() {
            return Err(EngineError::WrongWidth {
                found: samples.len(),
                expected: self.feed.len(),
            });
        }
        // Only a tick that is taken can be the first of another graph.
        if self.live.engine.takes(time) {
            self.take_over();
        }
        self.live.step(time, samples)?;
        self.tick += 1;
        self.record(Happening::Tick(time), samples);
        let LiveEngine {
            engine, revision, ..
        } = &*self.live;
        Ok(Stepped {
            generation: self.generation,
            revision,
            plan: engine.plan(),
            outputs: engine.outputs(),
        })
    }

    /// The next tick belongs to another segment.
    pub fn segment(&mut self) {
        self.live.segment();
        self.record(Happening::Break, &[]);
    }

    /// Freezes what estimators learn while they run, or lets it go on; see [`Engine::freeze`](crate::engine::Engine::freeze).
    pub fn freeze(&mut self, frozen: bool) {
        self.live.freeze(frozen);
        self.record(Happening::Freeze(frozen), &[]);
    }

    /// Lets a committed engine catch up, and take over once it has.
    fn take_over(&mut self) {
        if self.next.is_none() {
            self.next = self.arriving.pop().ok();
        }
        let Some(next) = &mut self.next else { return };
        let behind = self.event - next.event;
        if next.refused || behind > RECENT {
            self.send_back();
            return;
        }
        let width = self.feed.len() + 1;
        for _ in 0..behind.min(CATCH_UP) {
            let row = (next.event % RECENT) as usize * width;
            let (what, samples) = (self.recent[row], &self.recent[row + 1..row + width]);
            match Happening::read(what) {
                Happening::Break => next.segment(),
                Happening::Freeze(frozen) => next.freeze(frozen),
                Happening::Tick(time) => {
                    if next.step(time, samples).is_err() {
                        self.send_back();
                        return;
                    }
                }
            }
        }
        if next.event < self.event || self.leaving.is_full() {
            return;
        }
        next.take_over(&self.live.engine);
        std::mem::swap(&mut self.live, next);
        self.generation += 1;
        self.release();
    }

    /// Sends an engine back that did not take over.
    fn send_back(&mut self) {
        if let Some(next) = &mut self.next {
            next.refused = true;
        }
        self.release();
    }

    /// Lets the engine beside the one that runs go; it is freed on the other side.
    fn release(&mut self) {
        if let Some(engine) = self.next.take()
            && let Err(rtrb::PushError::Full(engine)) = self.leaving.push(engine)
        {
            self.next = Some(engine);
        }
    }

    /// Writes an event down for an engine that comes late, and for the control thread.
    fn record(&mut self, what: Happening, samples: &[f64]) {
        if self.ticks.is_none() {
            return;
        }
        let width = self.feed.len() + 1;
        let row = (self.event % RECENT) as usize * width;
        self.recent[row] = what.write();
        self.recent[row + 1..row + 1 + samples.len()].copy_from_slice(samples);
        self.event += 1;
        self.pass_on(what, samples);
    }

    fn pass_on(&mut self, what: Happening, samples: &[f64]) {
        let LiveEngine { engine, shown, .. } = &*self.live;
        let width = match what {
            Happening::Tick(_) => samples.len() + engine.outputs().len() + shown.len(),
            Happening::Break | Happening::Freeze(_) => 0,
        };
        let mark = Mark {
            what,
            event: self.event,
            tick: self.tick,
            generation: self.generation,
            given_up: engine.panics().len() as u64,
            width: width as u64,
        };
        let Some(ticks) = &mut self.ticks else { return };
        if let Ok(wider) = self.wider.pop() {
            // The control has the other end of the one before, and reads it to its end.
            *ticks = wider;
        }
        let Ok(mut chunk) = ticks.write_chunk(Mark::WIDTH + width) else {
            self.missed += 1;
            return;
        };
        let (first, second) = chunk.as_mut_slices();
        let places = first.iter_mut().chain(second);
        let numbers = mark.write().into_iter().chain(samples.iter().copied());
        for (place, number) in places.zip(numbers.chain(values(engine, shown))) {
            *place = number;
        }
        chunk.commit_all();
    }
}

impl std::fmt::Debug for Stepper {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Stepper")
            .field("revision", &self.live.revision)
            .field("tick", &self.tick)
            .field("generation", &self.generation)
            .finish_non_exhaustive()
    }
}
