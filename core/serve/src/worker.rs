//! What the engine thread does: samples in, ticks through the engine, decisions into the journal. It never waits.

use athermal_run::live::{Stepped, Stepper};

use crate::engine::EngineError;
use crate::journal::{Record, Recorder, output_hash};
use crate::moment::Moment;
use crate::outside::Outside;
use crate::sequencer::{Admission, Decision, Sample, Sequencer};
use crate::service::Snapshot;
use crate::time::{Duration, Instant};

/// So many records are worth waking the journal thread for, without a tick.
const FEW: u64 = 8;

/// The engine thread's work. The thread sleeps until something arrives or [`due`](Self::due).
#[derive(Debug)]
pub struct Worker {
    sequencer: Sequencer,
    stepper: Stepper,
    recorder: Recorder,
    generation: u64,
    /// The last tick and a stamp, where another segment began because the tick was of the future.
    went_back: Option<(Instant, Instant)>,
    outside: Outside,
    ticks: u64,
    beats: u64,
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
    /// It may leave once so many records are written; see [`Progress::wait_written`](crate::journal::Progress::wait_written).
    pub records: u64,
    /// How many ticks, beats, breaks and freezes there are then.
    pub happenings: u64,
    /// The outputs, and the graph that made them.
    pub stepped: Stepped<'a>,
}

impl Worker {
    /// What there is to work with.
    #[must_use]
    pub fn new(sequencer: Sequencer, stepper: Stepper, recorder: Recorder) -> Self {
        Self {
            outside: Outside::new(stepper.feed(), stepper.engine().plan()),
            sequencer,
            stepper,
            recorder,
            generation: 0,
            went_back: None,
            ticks: 0,
            beats: 0,
        }
    }

    /// Takes a sample.
    pub fn arrive(&mut self, sample: Sample, now: Moment) -> Admission {
        let admission = self.sequencer.arrive(sample, now);
        if let Some(record) = Record::of(admission) {
            self.recorder.record(record);
        }
        admission
    }

    /// When something is to be done, if nothing arrives before.
    #[must_use]
    pub fn due(&self) -> Option<Moment> {
        self.sequencer.due()
    }

    /// Does all that is due. `put` is given what comes of it, tick by tick.
    ///
    /// # Errors
    /// When the rules have other channels than the graph.
    pub fn pass(&mut self, now: Moment, put: impl FnMut(&Output<'_>)) -> Result<(), EngineError> {
        self.pass_while(now, |_| true, put)?;
        self.recorder.wake();
        Ok(())
    }

    /// The same for as long as `goes_on`: what is due then stays so. The journal thread is not woken for what is few.
    ///
    /// # Errors
    /// As [`pass`](Self::pass).
    pub fn pass_while(
        &mut self,
        now: Moment,
        mut goes_on: impl FnMut(&Self) -> bool,
        mut put: impl FnMut(&Output<'_>),
    ) -> Result<(), EngineError> {
        let before = self.recorder.happenings();
        while goes_on(self) && self.decide(now, false, &mut put)?.is_some() {}
        if self.recorder.happenings() != before || self.recorder.new_records() >= FEW {
            self.recorder.wake();
        }
        self.recorder.mend(self.sequencer.timeline());
        Ok(())
    }

    /// Wakes the journal thread, for a time in which nothing is due.
    pub fn rest(&mut self) {
        self.recorder.wake();
    }

    /// Where another segment began because the last tick was of the future: that tick, and a stamp of the time that it is. Once.
    pub fn went_back(&mut self) -> Option<(Instant, Instant)> {
        self.went_back.take()
    }

    /// Whether the control thread asks for a copy of what runs.
    #[must_use]
    pub fn is_asked(&self) -> bool {
        self.stepper.is_asked()
    }

    /// Sends the control thread a copy of what runs, where it asks for one. It takes as long as a checkpoint: for a moment in which
    /// nothing is due.
    pub fn mirror(&mut self) {
        self.stepper.mirror();
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
        self.recorder.wake();
        Ok(is_done)
    }

    /// Freezes learning, or lets it go on.
    pub fn freeze(&mut self, frozen: bool) {
        self.stepper.freeze(frozen);
        self.recorder.record(Record::Freeze(frozen));
    }

    /// The times of what follows may start again.
    ///
    /// # Errors
    /// As [`pass`](Self::pass).
    pub fn segment(
        &mut self,
        now: Moment,
        put: impl FnMut(&Output<'_>),
    ) -> Result<(), EngineError> {
        self.finish(now, put)?;
        self.sequencer.segment();
        self.stepper.segment();
        self.recorder.record(Record::Break { afresh: true });
        Ok(())
    }

    /// What a source gives next is left of so many samples.
    pub fn thinned(&mut self, source: usize, samples: u64) {
        let source = source as u32;
        self.recorder.record(Record::Thinned { source, samples });
    }

    /// Writes a remark into the journal.
    pub fn note(&mut self, text: Box<str>) {
        self.recorder.record(Record::Note(text));
    }

    /// The sequencer, for what is known of sources.
    pub fn sequencer(&mut self) -> &mut Sequencer {
        &mut self.sequencer
    }

    /// The journal.
    #[must_use]
    pub fn recorder(&self) -> &Recorder {
        &self.recorder
    }

    /// Whether the replica is far behind.
    #[must_use]
    pub fn is_crowded(&self) -> bool {
        self.stepper.is_crowded()
    }

    /// Writes down what is known now.
    pub fn publish(&self, snapshot: &mut Snapshot, now: Moment) {
        let (sequencer, timeline) = (&self.sequencer, self.sequencer.timeline());
        snapshot.counts.clone_from_slice(sequencer.counts());
        snapshot.stamps.copy_from_slice(timeline.stamps());
        snapshot.outside.copy_from_slice(self.outside.counts());
        snapshot.hurried = sequencer.hurried();
        snapshot.waiting = timeline.waiting().len();
        snapshot.last = timeline.last();
        snapshot.newest = sequencer.newest(now);
        snapshot.is_synchronised = sequencer.is_synchronised();
        snapshot.happenings = self.recorder.happenings();
        (snapshot.ticks, snapshot.beats) = (self.ticks, self.beats);
    }

    /// What is left when the work ends.
    #[must_use]
    pub fn into_parts(self) -> (Sequencer, Stepper, Recorder) {
        (self.sequencer, self.stepper, self.recorder)
    }

    /// Does the next thing that is due; none where there is none.
    fn decide(
        &mut self,
        now: Moment,
        at_the_end: bool,
        put: &mut impl FnMut(&Output<'_>),
    ) -> Result<Option<()>, EngineError> {
        let decision = if at_the_end {
            self.sequencer.finish(now)
        } else {
            self.sequencer.pass(now)
        };
        let (at, row, is_beat) = match decision {
            None => return Ok(None),
            Some(Decision::Tick { at, row }) => (at, row, false),
            Some(Decision::Beat { at, row }) => (at, row, true),
            Some(Decision::Sample(admission)) => {
                if let Some(record) = Record::of(admission) {
                    self.recorder.record(record);
                }
                return Ok(Some(()));
            }
            Some(Decision::Break) => {
                self.stepper.segment();
                self.recorder.record(Record::Break { afresh: false });
                return Ok(Some(()));
            }
            Some(Decision::Back { last, to }) => {
                self.went_back = Some((last, to));
                self.stepper.segment();
                self.recorder.record(Record::Break { afresh: true });
                return Ok(Some(()));
            }
            Some(Decision::Lag { source, least }) => {
                let source = source as u32;
                self.recorder.record(Record::Lag { source, least });
                return Ok(Some(()));
            }
            Some(Decision::Shift { source, offset }) => {
                let source = source as u32;
                self.recorder.record(Record::Shift { source, offset });
                return Ok(Some(()));
            }
        };
        let stepped = self.stepper.step(at, row)?;
        if stepped.generation != self.generation {
            self.generation = stepped.generation;
            self.outside.follow(stepped.plan);
            if let Ok(revision) = u64::from_str_radix(stepped.revision, 16) {
                self.recorder.record(Record::Swap { revision });
            }
        }
        self.outside.look(row);
        *if is_beat {
            &mut self.beats
        } else {
            &mut self.ticks
        } += 1;
        let hash = output_hash(stepped.outputs);
        let records = self.recorder.record(if is_beat {
            Record::Beat { at, hash }
        } else {
            Record::Tick { at, hash }
        });
        put(&Output {
            at,
            is_beat,
            behind: self.sequencer.age(now),
            is_superseded: self.sequencer.is_superseded(),
            records,
            happenings: self.recorder.happenings(),
            stepped,
        });
        Ok(Some(()))
    }
}
