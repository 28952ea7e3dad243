//! A graph at work: what arrives becomes ticks, ticks go through the engine, decisions are taken down, and another graph may take over.
//! No thread, file or clock is in it: whoever hosts it brings these.

use super::keep::Keep;
use super::monitor::Finding;
use super::outside::Outside;
use super::record::Record;
use super::sequencer::{Admission, Counts, Decision, Leader, Sample, Sequencer};
use super::{
    Control, LiveOptions, Moment, Notice, StageError, Staged, Stepped, Stepper, pair_from,
};
use crate::engine::{Engine, EngineError, RestoreError};
use crate::model::Model;
use crate::time::{Duration, Instant};

/// A graph at work.
///
/// A host whose source is in order hands over [`row`](Self::row)s. One with several senders has a [`Sequencer`] make ticks of what
/// [arrives](Self::arrive), and comes back when something is [due](Self::due). The [`Control`] is the graph's own where the host has one
/// thread, and stays with another thread otherwise.
///
/// A host that pulls rows, and lets another graph take over:
///
/// ```
/// use athermal_run::live::{LiveGraph, LiveOptions};
/// use athermal_run::model::Model;
/// use athermal_core::time::Instant;
///
/// fn host(first: &Model, second: &Model, rows: &[(Instant, Vec<f64>)]) -> Result<f64, Box<dyn std::error::Error>> {
///     let mut graph = LiveGraph::replaceable(first.engine()?, LiveOptions::default())?;
///     let mut last = f64::NAN;
///     for (nth, (at, row)) in rows.iter().enumerate() {
///         if nth == 100 {
///             graph.stage(second, false)?;
///             graph.control().map_or(Ok(()), |of| of.commit())?;
///         }
///         last = graph.row(*at, row)?.outputs[0];
///         let (notices, _) = graph.events();
///         notices.iter().for_each(|of| println!("{of:?}"));
///     }
///     Ok(last)
/// }
/// ```
#[derive(Debug)]
pub struct LiveGraph<K = ()> {
    sequencer: Option<Sequencer>,
    stepper: Stepper,
    control: Option<Control>,
    keep: K,
    generation: u64,
    /// The last tick and a stamp, where another segment began because the tick was of the future.
    went_back: Option<(Instant, Instant)>,
    outside: Outside,
    ticks: u64,
    beats: u64,
}

/// What is asked of a graph between two ticks.
#[derive(Debug)]
pub enum Order {
    /// Learning is frozen, or goes on.
    Freeze(bool),
    /// A remark for whoever reads what was taken down.
    Note(Box<str>),
    /// The host's time, which is known to be right.
    Synchronise(Instant, Moment),
    /// A source is connected.
    Connected(usize, Moment),
    /// A source is away.
    Away(usize, Moment),
    /// A source has come to its end.
    Ended(usize),
    /// What a source gives next is left of so many samples.
    Thinned(usize, u64),
}

/// What came of a tick.
#[derive(Debug)]
pub struct Output<'a> {
    /// The instant.
    pub at: Instant,
    /// Whether it was made by time alone.
    pub is_beat: bool,
    /// How old the tick is: by how much more its source lags behind the host than it did at the least.
    pub behind: Duration,
    /// Whether a newer tick is due already, so that it is no command.
    pub is_superseded: bool,
    /// It may leave once so many records are written.
    pub records: u64,
    /// How many ticks, beats, breaks and freezes there are then.
    pub happenings: u64,
    /// The outputs, and the graph that made them.
    pub stepped: Stepped<'a>,
}

/// What is known of a graph at work beside what it computes.
#[derive(Debug, Clone)]
pub struct Snapshot {
    /// What became of the samples of each channel.
    pub counts: Vec<Counts>,
    /// How many ticks were cut early because too many samples waited.
    pub hurried: u64,
    /// How many samples are too far ahead and not decided on.
    pub waiting: usize,
    /// How many ticks, beats, breaks and freezes there were, those of earlier runs included.
    pub happenings: u64,
    /// The last tick.
    pub last: Instant,
    /// The newest stamp, and the time since.
    pub newest: Option<Instant>,
    /// The stamp of each channel's newest sample that was stepped; [`Instant::MIN`] before the first.
    pub stamps: Vec<Instant>,
    /// Whether the host's time is known to be right. Until then clocks of sources are not judged by it.
    pub is_synchronised: bool,
    /// How many accepted samples of each channel are infinite or outside of the range of their signal, and absent at their ticks.
    pub outside: Vec<u64>,
    /// How many ticks were stepped since the start: those that samples made…
    pub ticks: u64,
    /// …and those that time alone did.
    pub beats: u64,
}

impl Snapshot {
    /// Of so many channels, before anything is known.
    #[must_use]
    pub fn new(channels: usize) -> Self {
        Self {
            counts: vec![Counts::default(); channels],
            hurried: 0,
            waiting: 0,
            happenings: 0,
            last: Instant::MIN,
            newest: None,
            stamps: vec![Instant::MIN; channels],
            is_synchronised: false,
            outside: vec![0; channels],
            ticks: 0,
            beats: 0,
        }
    }
}

impl LiveGraph {
    /// An engine whose rows come in order, of which nothing is taken down, and which cannot be replaced.
    #[must_use]
    pub fn of_rows(engine: Engine) -> Self {
        Self::new(None, Stepper::alone(engine), ())
    }

    /// The same with a control, so that it can be replaced. What runs is stepped twice only while something needs that. Ask for its
    /// [`events`](Self::events) at least once in 200 rows.
    ///
    /// # Errors
    /// When a node does not take its own state back, so that the engine cannot be copied.
    pub fn replaceable(engine: Engine, options: LiveOptions) -> Result<Self, RestoreError> {
        let options = LiveOptions {
            mirrors: false,
            ..options
        };
        let (stepper, control) = pair_from(engine, options)?;
        Ok(Self {
            control: Some(control),
            ..Self::new(None, stepper, ())
        })
    }
}

impl<K: Keep> LiveGraph<K> {
    /// What there is to work with; the control is on another thread.
    #[must_use]
    pub fn new(sequencer: Option<Sequencer>, stepper: Stepper, keep: K) -> Self {
        Self {
            outside: Outside::new(stepper.feed(), stepper.engine().plan()),
            sequencer,
            stepper,
            control: None,
            keep,
            generation: 0,
            went_back: None,
            ticks: 0,
            beats: 0,
        }
    }

    /// Takes a sample.
    pub fn arrive(&mut self, sample: Sample, now: Moment) -> Admission {
        let admission = match &mut self.sequencer {
            Some(sequencer) => sequencer.arrive(sample, now),
            None => Admission::Held,
        };
        self.admitted(admission);
        admission
    }

    fn admitted(&mut self, admission: Admission) {
        if let Some(record) = Record::of(admission) {
            self.keep.record(record);
        }
    }

    /// Steps the samples of one instant, in the order of the feed, NaN where there is no new value.
    ///
    /// # Errors
    /// A time that is not after the last one, or another number of samples: the engine is as it was.
    pub fn row(&mut self, at: Instant, row: &[f64]) -> Result<Stepped<'_>, EngineError> {
        let stepped = self.stepper.step(at, row)?;
        self.ticks += 1;
        self.keep.tick(at, false, stepped.outputs);
        Ok(stepped)
    }

    /// When something is to be done, if nothing arrives before.
    #[must_use]
    pub fn due(&self) -> Option<Moment> {
        self.sequencer.as_ref()?.due()
    }

    /// Does all that is due. `put` is given what comes of it, tick by tick.
    ///
    /// # Errors
    /// When the rules have other channels than the graph.
    pub fn pass(&mut self, now: Moment, put: impl FnMut(&Output<'_>)) -> Result<(), EngineError> {
        self.pass_while(now, |_| true, put)?;
        self.keep.sync();
        Ok(())
    }

    /// The same for as long as `goes_on`: what is due then stays so.
    ///
    /// # Errors
    /// As [`pass`](Self::pass).
    pub fn pass_while(
        &mut self,
        now: Moment,
        mut goes_on: impl FnMut(&Self) -> bool,
        mut put: impl FnMut(&Output<'_>),
    ) -> Result<(), EngineError> {
        let before = self.keep.happenings();
        while goes_on(self) && self.decide(now, false, &mut put)?.is_some() {}
        if let Some(sequencer) = &self.sequencer {
            let has_ticked = self.keep.happenings() != before;
            self.keep.passed(has_ticked, sequencer.timeline());
        }
        Ok(())
    }

    /// Where another segment began because the last tick was of the future: that tick, and a stamp of the time that it is. Once.
    pub fn went_back(&mut self) -> Option<(Instant, Instant)> {
        self.went_back.take()
    }

    /// Steps all that waits, without waiting any longer. For the end of all sources.
    ///
    /// # Errors
    /// As [`pass`](Self::pass).
    pub fn finish(&mut self, now: Moment, put: impl FnMut(&Output<'_>)) -> Result<(), EngineError> {
        self.finish_while(now, |_| true, put).map(|_| ())
    }

    /// The same for as long as `goes_on`: true once nothing waits.
    ///
    /// # Errors
    /// As [`pass`](Self::pass).
    pub fn finish_while(
        &mut self,
        now: Moment,
        mut goes_on: impl FnMut(&Self) -> bool,
        mut put: impl FnMut(&Output<'_>),
    ) -> Result<bool, EngineError> {
        let mut is_done = false;
        while !is_done && goes_on(self) {
            is_done = self.decide(now, true, &mut put)?.is_none();
        }
        self.keep.sync();
        Ok(is_done)
    }

    /// The times of what follows may start again.
    pub fn segment(&mut self) {
        if let Some(sequencer) = &mut self.sequencer {
            sequencer.segment();
        }
        self.break_off(true);
    }

    /// Does what is asked between two ticks.
    pub fn order(&mut self, order: Order) {
        match (order, &mut self.sequencer) {
            (Order::Freeze(frozen), _) => {
                self.stepper.freeze(frozen);
                self.keep.record(Record::Freeze(frozen));
            }
            (Order::Note(text), _) => _ = self.keep.record(Record::Note(text)),
            (Order::Thinned(source, samples), _) => {
                let source = source as u32;
                self.keep.record(Record::Thinned { source, samples });
            }
            (Order::Synchronise(host, now), Some(of)) => of.synchronise(host, now),
            (Order::Connected(source, now), Some(of)) => of.connected(source, now),
            (Order::Away(source, now), Some(of)) => of.away(source, now),
            (Order::Ended(source), Some(of)) => of.ended(source),
            (_, None) => {}
        }
    }

    /// Whether somebody asks for a copy of what runs, or for what it knows: [`rest`](Self::rest) gives it.
    #[must_use]
    pub fn is_asked(&self) -> bool {
        self.stepper.is_asked() || self.keep.wants_checkpoint()
    }

    /// Does what takes as long as a checkpoint and asks for memory, where somebody asks for it: for a moment in which nothing is due.
    pub fn rest(&mut self) {
        self.stepper.mirror();
        // What has been committed and has not taken over would be lacking.
        if self.keep.wants_checkpoint() && !self.stepper.has_next() {
            self.keep.checkpoint(self.stepper.engine());
        }
    }

    /// The engine at work.
    #[must_use]
    pub fn engine(&self) -> &Engine {
        self.stepper.engine()
    }

    /// What makes ticks of samples, where the graph is not given rows.
    #[must_use]
    pub fn sequencer(&self) -> Option<&Sequencer> {
        self.sequencer.as_ref()
    }

    /// Whose clock is ahead of a sample that was not accepted.
    #[must_use]
    pub fn leader(&self, of: Admission, now: Moment) -> Option<Leader> {
        self.sequencer.as_ref()?.leader(of, now)
    }

    /// What is taken down.
    pub fn keep(&mut self) -> &mut K {
        &mut self.keep
    }

    /// Whether the control thread is far behind.
    #[must_use]
    pub fn is_crowded(&self) -> bool {
        self.stepper.is_crowded()
    }

    /// Writes down what is known now.
    pub fn facts(&self, snapshot: &mut Snapshot, now: Moment) {
        (snapshot.ticks, snapshot.beats) = (self.ticks, self.beats);
        snapshot.happenings = self.keep.happenings();
        snapshot.outside.copy_from_slice(self.outside.counts());
        let Some(sequencer) = &self.sequencer else {
            return;
        };
        let timeline = sequencer.timeline();
        snapshot.counts.clone_from_slice(sequencer.counts());
        snapshot.stamps.copy_from_slice(timeline.stamps());
        snapshot.hurried = sequencer.hurried();
        snapshot.waiting = timeline.waiting().len();
        snapshot.last = timeline.last();
        snapshot.newest = sequencer.newest(now);
        snapshot.is_synchronised = sequencer.is_synchronised();
    }

    /// What happened since the last call, and what was found, where the graph has its own control.
    pub fn events(&mut self) -> (Vec<Notice>, Vec<(Instant, Finding)>) {
        let control = self.control.as_mut();
        control.map_or_else(Default::default, |of| (of.pump(), of.found()))
    }

    /// The control, where the graph has its own.
    pub fn control(&mut self) -> Option<&mut Control> {
        self.control.as_mut()
    }

    /// Makes a graph ready to take over, where this one has its own control: see [`Control::stage`].
    ///
    /// # Errors
    /// When it cannot take over, or there is no control; what runs, and what was staged before, is untouched.
    pub fn stage(&mut self, model: &Model, carry_learned: bool) -> Result<&Staged, StageError> {
        let control = self.control.as_mut().ok_or(StageError::NoControl)?;
        if !control.needs_replica() {
            self.stepper.mirror();
        }
        control.stage(model, carry_learned)
    }

    /// What is left when the work ends.
    #[must_use]
    pub fn into_parts(self) -> (Option<Sequencer>, Stepper, K) {
        (self.sequencer, self.stepper, self.keep)
    }

    fn break_off(&mut self, afresh: bool) {
        self.stepper.segment();
        self.keep.record(Record::Break { afresh });
    }

    /// Does the next thing that is due; none where there is none.
    fn decide(
        &mut self,
        now: Moment,
        at_the_end: bool,
        put: &mut impl FnMut(&Output<'_>),
    ) -> Result<Option<()>, EngineError> {
        let Some(sequencer) = &mut self.sequencer else {
            return Ok(None);
        };
        let decision = match at_the_end {
            true => sequencer.finish(now),
            false => sequencer.pass(now),
        };
        let (at, row, is_beat) = match decision {
            None => return Ok(None),
            Some(Decision::Tick { at, row }) => (at, row, false),
            Some(Decision::Beat { at, row }) => (at, row, true),
            Some(other) => {
                match other {
                    Decision::Sample(admission) => self.admitted(admission),
                    Decision::Break => self.break_off(false),
                    Decision::Back { last, to } => {
                        self.went_back = Some((last, to));
                        self.break_off(true);
                    }
                    Decision::Lag { source, least } => {
                        let source = source as u32;
                        self.keep.record(Record::Lag { source, least });
                    }
                    Decision::Shift { source, offset } => {
                        let source = source as u32;
                        self.keep.record(Record::Shift { source, offset });
                    }
                    Decision::Tick { .. } | Decision::Beat { .. } => {}
                }
                return Ok(Some(()));
            }
        };
        let stepped = self.stepper.step(at, row)?;
        if stepped.generation != self.generation {
            self.generation = stepped.generation;
            self.outside.follow(stepped.plan);
            if let Ok(revision) = u64::from_str_radix(stepped.revision, 16) {
                self.keep.record(Record::Swap { revision });
            }
        }
        self.outside.look(row);
        *if is_beat {
            &mut self.beats
        } else {
            &mut self.ticks
        } += 1;
        let records = self.keep.tick(at, is_beat, stepped.outputs);
        put(&Output {
            at,
            is_beat,
            behind: sequencer.age(now),
            is_superseded: sequencer.is_superseded(),
            records,
            happenings: self.keep.happenings(),
            stepped,
        });
        Ok(Some(()))
    }
}
