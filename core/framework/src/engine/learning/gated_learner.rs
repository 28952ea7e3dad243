//! What an estimator learns from while it runs, and what it is kept from.

use std::sync::Arc;

use super::embargo::{DueTruth, Embargo};
use super::mode::{Mode, StepLength};
use crate::compile::{PlannedLearning, TrainingLimits, TruthLink};
use crate::engine::state::NodeState;
use crate::engine::tick::Gathered;
use crate::node::{Admission, Learner, LearningGate, LinearForm, Predictor, Restored, Speaks};
use crate::time::{Duration, Instant};

/// A learner in a running plan, with the truths that the embargo still withholds from it.
#[derive(Debug)]
pub(crate) struct GatedLearner {
    learner: Box<dyn Learner>,
    withheld: Embargo,
    gate: Gate,
    freeze: Option<usize>,
    mode: Mode,
    step: StepLength,
    /// Whether a run knows of the truth of its own tick.
    at_once: bool,
    /// Who speaks now.
    speaks: Speaks,
    /// Whether the errors by which that is decided are others since.
    stale: bool,
    /// Whether it may predict otherwise than when it was asked last.
    changed: bool,
    /// A row in which nothing is there.
    nothing: Vec<f64>,
}

/// What became of a truth that the embargo let through: the ones of the port `learning`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub(crate) enum LearnOutcome {
    /// It was learned from.
    Learned = 0,
    /// Learning was frozen on command.
    FrozenOnCommand = 1,
    /// Learning was frozen by a channel.
    FrozenByChannel = 2,
    /// It missed its prediction by too much.
    Outlier = 3,
    /// A regressor lay outside the range of the fit: a level follows it all the same, and nothing else is learned.
    OutsideRange = 4,
    /// It lay outside the limits of `train.abs_truth`.
    OutsideLimits = 5,
    /// The run that it belongs to lacked a regressor.
    Incomplete = 6,
    /// It says little, or its window has taught as often as it may.
    PassedOver = 7,
}

impl GatedLearner {
    /// Goes on from a fit; none for a predictor that stays as it was fitted.
    pub(crate) fn new(
        predictor: &Arc<dyn Predictor>,
        planned: PlannedLearning,
        truth: TruthLink,
        training: TrainingLimits,
    ) -> Option<Self> {
        let width = predictor.uses().len();
        let mut learner = predictor.learner()?;
        let own = LearningGate::new(planned.limits, truth.span, &mut *learner);
        Some(Self {
            at_once: truth.allows_present() && learner.extrapolates(),
            speaks: own.speaks(Instant::MIN),
            stale: true,
            learner,
            changed: false,
            // With each row stands whether learning was frozen at the run.
            withheld: Embargo::new(truth, width + 1),
            freeze: planned.freeze,
            gate: Gate {
                predictor: Arc::clone(predictor),
                training,
                own,
            },
            mode: Mode::OneStep,
            step: StepLength::new(truth.ahead.max(truth.span)),
            nothing: vec![f64::NAN; width],
        })
    }

    /// Learns as late as a mode wants.
    pub(crate) fn predict_in(&mut self, mode: Mode) {
        self.mode = mode;
    }

    /// How long a step was planned to be; none where it is as long as the time between truths.
    pub fn step(&self) -> Option<Duration> {
        self.step.planned()
    }

    /// The newest arrival that a prediction made at `now` may know of.
    fn newest(&self, now: Instant) -> Instant {
        let newest = self.withheld.newest(now);
        match self.mode {
            Mode::OneStep | Mode::FreeRun => newest,
            // Several steps are counted back from the newest truth that one step knows of.
            mode => {
                let after = Duration::from_ns(i64::from(!self.at_once));
                newest.min(now - after) - mode.earlier(self.step.length())
            }
        }
    }

    /// Asks who speaks: the learner, or its fit while that stands in.
    #[inline]
    fn ask<'a, T>(
        &'a self,
        learner: impl FnOnce(&'a dyn Learner) -> T,
        fit: impl FnOnce(&'a dyn Predictor) -> T,
    ) -> T {
        if self.speaks == Speaks::Learner {
            return learner(&*self.learner);
        }
        match self.learner.as_fitted() {
            Some(of_fit) => learner(of_fit),
            None => fit(&*self.gate.predictor),
        }
    }

    pub(crate) fn predict(&self, row: &[f64], now: Instant) -> f64 {
        let of = now + self.withheld.link().ahead;
        self.ask(|of_now| of_now.predict(row, of), |fit| fit.predict(row))
    }

    pub(crate) fn std_dev(&self, row: &[f64], now: Instant) -> f64 {
        let of = now + self.withheld.link().ahead;
        self.ask(|of_now| of_now.std_dev(row, of), |fit| fit.std_dev(row))
    }

    pub(crate) fn novelty(&self, row: &[f64]) -> f64 {
        self.ask(|of_now| of_now.novelty(row), |fit| fit.novelty(row))
    }

    /// What it predicts now in the middle of the rows of the fit.
    pub(crate) fn centre(&self, now: Instant) -> f64 {
        let of = now + self.withheld.link().ahead;
        self.ask(|of_now| of_now.centre(of), Predictor::centre)
    }

    /// The slot of the truth.
    pub(crate) fn truth(&self) -> usize {
        self.withheld.link().slot
    }

    /// Whether a truth is taken before the run of its tick; else it is after all outputs.
    pub(crate) fn at_once(&self) -> bool {
        self.at_once
    }

    /// What the prediction is, where it is a linear form.
    pub(crate) fn form(&self) -> Option<LinearForm<'_>> {
        let form = self.ask(Learner::linear, Predictor::linear);
        // What is given the truth of its own tick first cannot be predicted with others.
        form.filter(|_| !self.at_once)
    }

    /// Whether it may predict otherwise than when this was asked last.
    pub(crate) fn has_changed(&mut self) -> bool {
        std::mem::take(&mut self.changed)
    }

    /// Writes the regressors of a run down, where all that are needed were there.
    pub(crate) fn run(
        &mut self,
        row: Option<&[f64]>,
        now: Instant,
        gathered: &[Gathered],
        on: bool,
    ) {
        let row = row.unwrap_or(&self.nothing);
        let frozen = [self.frozen(gathered, on)];
        self.withheld.run(now, [row, &frozen]);
        let of = now + self.withheld.link().ahead;
        self.learner.run(row, of, self.newest(now));
    }

    /// The same for a linear form, whose regressors may lie in two pieces.
    #[inline]
    pub(crate) fn ran(
        &mut self,
        [first, others]: [&[f64]; 2],
        now: Instant,
        gathered: &[Gathered],
        on: bool,
    ) {
        let frozen = [self.frozen(gathered, on)];
        self.withheld.run(now, [first, others, &frozen]);
    }

    /// Takes a truth that has just been measured.
    pub(crate) fn observe(&mut self, truth: f64, now: Instant, gathered: &[Gathered], on: bool) {
        let frozen = self.frozen(gathered, on);
        self.step.truth(now);
        self.withheld.observe(truth, now, frozen);
    }

    /// Learns from what the embargo lets through at `now`; gives what the port `learning` says, and when the newest truth had arrived,
    /// where either has changed. It said `said` before.
    pub(crate) fn release(
        &mut self,
        now: Instant,
        gathered: &[Gathered],
        on: bool,
        said: f64,
    ) -> Option<(f64, Instant)> {
        let frozen = self.frozen(gathered, on);
        let newest = self.newest(now);
        let outcome = self.learn_up_to(newest, frozen);
        let spoke = self.speaks;
        // Between truths only silence changes that: sums over windows are none of each tick.
        let own = &self.gate.own;
        if let Some(memory) = own.memory
            && (std::mem::take(&mut self.stale) || own.standing.is_silent(now, memory))
        {
            self.speaks = own.speaks(now);
        }
        self.changed |= outcome.is_some() || spoke != self.speaks;
        let (became, arrived) = match outcome {
            Some((outcome, arrived)) => (outcome as u8, arrived),
            None if said >= 0.0 && said as u8 / 10 * 10 != self.speaks as u8 => {
                (said as u8 % 10, now)
            }
            None => return None,
        };
        Some((f64::from(became + self.speaks as u8), arrived))
    }

    #[inline]
    fn learn_up_to(&mut self, newest: Instant, frozen: f64) -> Option<(LearnOutcome, Instant)> {
        let (learner, gate) = (&mut *self.learner, &mut self.gate);
        let free = self.mode == Mode::FreeRun;
        let mut outcome = None;
        self.withheld.release(newest, |released| {
            if !(free && learner.is_settled()) {
                outcome = Some((gate.offer(learner, released, frozen), released.arrived));
            }
        });
        self.stale |= outcome.is_some();
        outcome
    }

    /// The segment has ended with this tick: the embargo guards its predictions, of which none is still to come.
    pub(crate) fn segment(&mut self, last: Instant, gathered: &[Gathered], on: bool) {
        let frozen = self.frozen(gathered, on);
        self.learn_up_to(last, frozen);
        self.withheld.clear();
        self.changed = true;
        self.step.segment();
    }

    /// Moves what is remembered to the clock of the segment that begins.
    pub(crate) fn shift(&mut self, shift: Duration) {
        self.learner.segment(shift);
        self.gate.own.segment(shift);
        self.stale = true;
    }

    pub(crate) fn snapshot(&self) -> NodeState {
        let mut state = NodeState::pack(Some(self.learner.snapshot()));
        state.learning = Some(self.withheld.state());
        let own = &self.gate.own;
        state.recent = Some(own.recent);
        state.standing = own.memory.map(|_| own.standing.clone());
        state
    }

    pub(crate) fn restore(&mut self, state: &NodeState) -> Restored {
        let answer = match state.unpack() {
            Ok(Some(own)) => self.learner.restore(own),
            Ok(None) => Restored::cold("it did not learn before"),
            Err(cold) => cold,
        };
        (self.changed, self.stale) = (true, true);
        if !matches!(answer, Restored::Cold { .. }) {
            if let Some(from) = &state.learning {
                self.withheld.restore(from);
            }
            let own = &mut self.gate.own;
            own.recent = state.recent.unwrap_or(own.recent);
            if let Some(from) = &state.standing {
                own.standing.go_on_from(from);
            }
        }
        answer
    }

    /// Why nothing of this tick is learned from, as a number; 0 where it is.
    fn frozen(&self, gathered: &[Gathered], on: bool) -> f64 {
        let mut channels = self
            .freeze
            .iter()
            .flat_map(|&freeze| &gathered[freeze].values);
        let became = if !on && !self.learner.tracks_state() {
            LearnOutcome::FrozenOnCommand
        } else if channels.any(|&value| value != 0.0) {
            // NaN too: without a clear 0, learning does not go on.
            LearnOutcome::FrozenByChannel
        } else {
            LearnOutcome::Learned
        };
        f64::from(became as u8)
    }
}

/// What keeps a learner from rows that would spoil it.
#[derive(Debug)]
struct Gate {
    predictor: Arc<dyn Predictor>,
    training: TrainingLimits,
    own: LearningGate,
}

impl Gate {
    /// Lets a learner learn from a pair, unless something speaks against it.
    fn offer(
        &mut self,
        learner: &mut dyn Learner,
        released: DueTruth<'_>,
        frozen: f64,
    ) -> LearnOutcome {
        let DueTruth {
            row,
            truth,
            arrived,
            note: frozen_at_arrival,
        } = released;
        let (row, frozen_at_run) = row.split_at(row.len() - 1);
        let frozen = frozen.max(frozen_at_run[0]).max(frozen_at_arrival);
        if frozen == f64::from(LearnOutcome::FrozenOnCommand as u8) {
            return LearnOutcome::FrozenOnCommand;
        }
        if frozen > 0.0 {
            return LearnOutcome::FrozenByChannel;
        }
        if row.iter().any(|value| value.is_nan()) {
            return LearnOutcome::Incomplete;
        }
        if !self.training.admits(truth) {
            return LearnOutcome::OutsideLimits;
        }
        let fit = &*self.predictor;
        match self.own.offer(learner, fit, row, truth, arrived) {
            Admission::Learned => LearnOutcome::Learned,
            Admission::Outlier => LearnOutcome::Outlier,
            Admission::OutsideRange => LearnOutcome::OutsideRange,
            Admission::SaysLittle | Admission::TooMany => LearnOutcome::PassedOver,
        }
    }
}
