//! Decides the course of a replacement on the control thread: stage, shadow, commit, roll back.

use std::fmt;
use std::sync::Arc;

use rtrb::{Consumer, Producer, RingBuffer};

use super::handover::{Feed, Mark, Seated};
use super::retained::Retained;
use super::shadow::{Shadow, Verdict};
use super::{LiveOptions, Stepper};
use crate::compile::Plan;
use crate::engine::{Carry, Engine, EngineError, NodeCarry, Untouched};
use crate::model::Model;
use crate::recording::Event;
use crate::time::{Duration, Instant};

/// Engines that may be on their way in either direction.
const ON_THE_WAY: usize = 4;

/// The end of a running graph from which it is replaced.
pub struct Control {
    options: LiveOptions,
    feed: Arc<[Feed]>,
    ticks: Consumer<f64>,
    departing: Producer<Box<Seated>>,
    returning: Consumer<Box<Seated>>,
    /// What runs, to the same bits; none after ticks have been missed.
    replica: Option<Seated>,
    /// The plan of what runs.
    running: Arc<Plan>,
    retained: Retained,
    staged: Option<Staged>,
    /// What has been committed, until the engine thread has taken it over.
    committed: Option<Seated>,
    previous: Option<Previous>,
    tick: u64,
    generation: u64,
    row: Vec<f64>,
}

/// A graph that is ready to take over, and kept so.
pub struct Staged {
    seated: Seated,
    carry: Vec<NodeCarry>,
    shadow: Option<Shadow>,
}

/// The graph before the last swap, kept warm.
struct Previous {
    seated: Seated,
    until: Option<Instant>,
}

/// What has happened since the last look.
#[derive(Debug, Clone, PartialEq)]
pub enum Notice {
    /// A committed graph took over before the tick of this number.
    TookOver {
        /// Its revision.
        revision: String,
        /// The first tick that it stepped.
        tick: u64,
        /// The instant of that tick.
        time: Instant,
    },
    /// The engine thread sent a graph back because it came too late; it can be committed again.
    SentBack,
    /// Ticks were missed: states can no longer be carried, until a graph warmed by the retained past takes over.
    Missed {
        /// How many.
        ticks: u64,
    },
}

/// Why a graph cannot take over.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum StageError {
    /// It reads channels that no samples are given for.
    MissingChannels {
        /// The channels.
        channels: Vec<String>,
    },
    /// What was fitted does not belong to it.
    Engine(EngineError),
    /// Nothing is staged.
    NothingStaged,
    /// There is no graph before, or it is no longer warm.
    NothingToTakeBack,
    /// Another graph has been committed and not yet taken over.
    Busy,
}

impl fmt::Display for StageError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::MissingChannels { channels } => write!(
                f,
                "the new graph reads {}, for which no samples are given: name all graphs at the start, or add the channels",
                channels.join(", ")
            ),
            Self::Engine(error) => write!(f, "{error}"),
            Self::NothingStaged => write!(f, "no graph is staged: stage one first"),
            Self::NothingToTakeBack => write!(
                f,
                "there is no graph to go back to: none was replaced, or too long ago"
            ),
            Self::Busy => write!(
                f,
                "a committed graph has not been taken over yet: wait for the next tick"
            ),
        }
    }
}

impl std::error::Error for StageError {}

pub(super) fn pair(model: &Model, options: LiveOptions) -> Result<(Stepper, Control), EngineError> {
    let mut feed = Feed::of(&model.plan);
    for channel in &options.channels {
        if !feed.contains(channel) {
            feed.push(channel.clone());
        }
    }
    let feed: Arc<[Feed]> = feed.into();
    let seat = || -> Result<Seated, EngineError> {
        let engine = Engine::new(Arc::clone(&model.plan), &model.fitted)?;
        Ok(Seated::new(engine, &feed, 0).expect("the feed has all channels of the plan"))
    };
    let record = feed.len() + Mark::WIDTH;
    let (mirror, ticks) = RingBuffer::new(options.mirrored.max(1) * record);
    let (departing, arriving) = RingBuffer::new(ON_THE_WAY);
    let (leaving, returning) = RingBuffer::new(ON_THE_WAY);
    let stepper = Stepper::new(seat()?, Arc::clone(&feed), mirror, arriving, leaving);
    let span = options.retain.max(model.plan.warm_up);
    let control = Control {
        retained: Retained::new(feed.len(), span, options.memory),
        row: vec![f64::NAN; record],
        replica: Some(seat()?),
        running: Arc::clone(&model.plan),
        options,
        feed,
        ticks,
        departing,
        returning,
        staged: None,
        committed: None,
        previous: None,
        tick: 0,
        generation: 0,
    };
    Ok((stepper, control))
}

impl Control {
    /// Takes in the ticks that have been stepped since the last call, and tells what happened. Call it often enough that
    /// the ring does not fill: at least once in [`LiveOptions::mirrored`] ticks.
    pub fn pump(&mut self) -> Vec<Notice> {
        let mut notices = Vec::new();
        while let Ok(chunk) = self.ticks.read_chunk(self.row.len()) {
            let (first, second) = chunk.as_slices();
            self.row[..first.len()].copy_from_slice(first);
            self.row[first.len()..].copy_from_slice(second);
            chunk.commit_all();
            self.take_in(&mut notices);
        }
        while let Ok(returned) = self.returning.pop() {
            // What comes back is freed here, off the engine thread.
            if returned.refused {
                self.committed = None;
                notices.push(Notice::SentBack);
            }
        }
        notices
    }

    /// Makes a graph ready to take over: all that it can is carried from what runs, the rest is warmed by the retained past.
    ///
    /// With `carry_learned`, what was learned of an estimator is carried although it has been fitted anew.
    ///
    /// # Errors
    /// When it cannot take over; what runs is untouched.
    pub fn stage(&mut self, model: &Model, carry_learned: bool) -> Result<&Staged, StageError> {
        self.pump();
        let engine =
            Engine::new(Arc::clone(&model.plan), &model.fitted).map_err(StageError::Engine)?;
        let mut seated = Seated::new(engine, &self.feed, 0)
            .map_err(|channels| StageError::MissingChannels { channels })?;
        let mut warmed = false;
        self.retained.for_each(|time, samples| match time {
            Some(time) => warmed |= seated.step(time, samples).is_ok(),
            None => seated.engine.segment(),
        });
        let carry = match &self.replica {
            Some(replica) => {
                let (old, new) = (&replica.engine, &seated.engine);
                let untouched = Untouched::between(
                    (old.plan(), old.fitted()),
                    (new.plan(), new.fitted()),
                    carry_learned,
                );
                let changes: std::collections::BTreeMap<String, (String, bool)> = new
                    .plan()
                    .nodes
                    .iter()
                    .map(|node| (node.instance(), untouched.changed(old, new, node)))
                    .collect();
                let state = old.state();
                seated.engine.adopt(
                    &state,
                    &untouched,
                    |node| changes.get(&node.instance()).cloned().unwrap_or_default(),
                    warmed,
                )
            }
            None => cold(&seated.engine, warmed),
        };
        seated.tick = self.tick;
        self.staged = Some(Staged {
            seated,
            carry,
            shadow: None,
        });
        self.staged.as_ref().ok_or(StageError::NothingStaged)
    }

    /// Compares the staged graph with what runs for a while; see [`Control::verdict`].
    ///
    /// # Errors
    /// When nothing is staged.
    pub fn shadow(&mut self, duration: Duration, margin: f64) -> Result<(), StageError> {
        let (Some(staged), Some(replica)) = (&mut self.staged, &self.replica) else {
            return Err(StageError::NothingStaged);
        };
        staged.shadow = Some(Shadow::new(
            &replica.engine,
            &staged.seated.engine,
            duration,
            margin,
        ));
        Ok(())
    }

    /// What the comparison has come to; none where there is none.
    #[must_use]
    pub fn verdict(&self) -> Option<Verdict> {
        let staged = self.staged.as_ref()?;
        let shadow = staged.shadow.as_ref()?;
        Some(shadow.verdict(&self.replica.as_ref()?.engine, &staged.seated.engine))
    }

    /// The graph that is staged.
    #[must_use]
    pub fn staged(&self) -> Option<&Staged> {
        self.staged.as_ref()
    }

    /// Lets go of what is staged; what runs goes on.
    pub fn discard(&mut self) {
        self.staged = None;
    }

    /// Lets the staged graph take over before the next tick.
    ///
    /// # Errors
    /// When nothing is staged, or a graph is still on its way.
    pub fn commit(&mut self) -> Result<(), StageError> {
        self.pump();
        if self.committed.is_some() {
            return Err(StageError::Busy);
        }
        let staged = self.staged.take().ok_or(StageError::NothingStaged)?;
        self.hand_over(staged.seated)
    }

    /// Lets the graph before the last swap take over again, as it would be had it never been replaced.
    ///
    /// # Errors
    /// When there is none that is still warm.
    pub fn rollback(&mut self) -> Result<(), StageError> {
        self.pump();
        if self.committed.is_some() {
            return Err(StageError::Busy);
        }
        let previous = self.previous.take().ok_or(StageError::NothingToTakeBack)?;
        self.hand_over(previous.seated)
    }

    /// The graph that runs, to the same bits; none after ticks have been missed.
    #[must_use]
    pub fn replica(&self) -> Option<&Engine> {
        self.replica.as_ref().map(|replica| &replica.engine)
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

    fn hand_over(&mut self, mut seated: Seated) -> Result<(), StageError> {
        seated.follow(&self.running);
        let copy = copy(&seated, &self.feed).map_err(StageError::Engine)?;
        match self.departing.push(Box::new(copy)) {
            Ok(()) => {
                self.committed = Some(seated);
                Ok(())
            }
            Err(_) => Err(StageError::Busy),
        }
    }

    /// Does to the engines here what a tick did on the engine thread.
    fn take_in(&mut self, notices: &mut Vec<Notice>) {
        let row = std::mem::take(&mut self.row);
        self.take_in_row(&row, notices);
        self.row = row;
    }

    fn take_in_row(&mut self, row: &[f64], notices: &mut Vec<Notice>) {
        let (mark, samples) = row.split_at(Mark::WIDTH);
        let mark = Mark::read([mark[0], mark[1], mark[2]]);
        let Some(time) = mark.time else {
            self.retained.segment();
            self.for_all(|seated| seated.engine.segment());
            return;
        };
        let missed = mark.tick - self.tick - 1;
        if missed > 0 {
            self.lose(missed, notices);
        }
        if mark.generation != self.generation {
            self.generation = mark.generation;
            self.took_over(mark.tick, time, notices);
        }
        self.tick = mark.tick;
        self.for_all(|seated| {
            // A tick that ran there runs here: the engines are the same.
            let _ = seated.step(time, samples);
        });
        self.retained.push(time, samples);
        if let (Some(staged), Some(replica)) = (&mut self.staged, &self.replica)
            && let Some(shadow) = &mut staged.shadow
        {
            shadow.look(&replica.engine, &staged.seated.engine, Event::Row(time));
        }
        let keep = self.options.keep_warm;
        if let Some(previous) = &mut self.previous {
            let until = *previous.until.get_or_insert(time + keep);
            if time > until {
                self.previous = None;
            }
        }
    }

    fn for_all(&mut self, mut act: impl FnMut(&mut Seated)) {
        self.replica.iter_mut().for_each(&mut act);
        self.staged
            .iter_mut()
            .map(|staged| &mut staged.seated)
            .for_each(&mut act);
        self.committed.iter_mut().for_each(&mut act);
        self.previous
            .iter_mut()
            .map(|previous| &mut previous.seated)
            .for_each(&mut act);
    }

    fn took_over(&mut self, tick: u64, time: Instant, notices: &mut Vec<Notice>) {
        let Some(mut seated) = self.committed.take() else {
            return;
        };
        // The engine that ran comes back before the first tick of the new one; it stands in where there is no replica.
        let returned = self.returning.pop().ok().map(|returned| *returned);
        let old = self.replica.take().or(returned);
        if let Some(old) = &old {
            seated.take_over(&old.engine);
        }
        notices.push(Notice::TookOver {
            revision: seated.revision.clone(),
            tick,
            time,
        });
        self.running = Arc::clone(seated.engine.plan());
        self.retained
            .keep(self.options.retain.max(self.running.warm_up));
        self.replica = Some(seated);
        self.previous = old.map(|seated| Previous {
            seated,
            until: None,
        });
    }

    fn lose(&mut self, ticks: u64, notices: &mut Vec<Notice>) {
        notices.push(Notice::Missed { ticks });
        self.replica = None;
        self.staged = None;
        self.committed = None;
        self.previous = None;
        self.retained.clear();
    }
}

impl Staged {
    /// What becomes of each node, in the order of the new plan.
    #[must_use]
    pub fn carry(&self) -> &[NodeCarry] {
        &self.carry
    }

    /// The revision of the graph.
    #[must_use]
    pub fn revision(&self) -> &str {
        &self.seated.revision
    }
}

/// An engine that goes on exactly as another one.
fn copy(of: &Seated, feed: &[Feed]) -> Result<Seated, EngineError> {
    let engine = of.engine.twin()?;
    let mut copy = Seated::new(engine, feed, of.tick).expect("a twin reads what its twin reads");
    copy.outputs.clone_from(&of.outputs);
    Ok(copy)
}

fn cold(engine: &Engine, warmed: bool) -> Vec<NodeCarry> {
    let reason = || "ticks were missed, so that nothing is known of what runs".to_owned();
    let outcome = || {
        if warmed {
            Carry::Warmed { reason: reason() }
        } else {
            Carry::Cold { reason: reason() }
        }
    };
    engine
        .plan()
        .nodes
        .iter()
        .map(|node| NodeCarry {
            node: node.instance(),
            outcome: outcome(),
        })
        .collect()
}

impl fmt::Debug for Control {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Control")
            .field("tick", &self.tick)
            .field("generation", &self.generation)
            .finish_non_exhaustive()
    }
}

impl fmt::Debug for Staged {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Staged")
            .field("revision", &self.seated.revision)
            .finish_non_exhaustive()
    }
}
