//! Steps a plan: what runs at a tick, in which order, and when truths reach those that learn.
//!
//! Three rooms: `tick` computes, `learning` hands truths over when they may be known, `state` is what goes on in
//! another engine. Sources and sinks are not known here.

mod at_work;
mod contributions;
mod error;
mod holding;
mod idle;
mod isolation;
pub mod leap;
mod learning;
mod sample_range;
mod state;
mod tick;

use std::collections::BTreeMap;
use std::sync::{Arc, OnceLock};

pub use crate::node::who_speaks;
pub use at_work::{When, naming_one};
pub use contributions::Contribution;
pub use error::EngineError;
pub use holding::{Held, Holding};
pub use learning::{Mode, Pair, Pairing, StepLength, times};
pub use sample_range::SampleRange;
pub use state::{
    Carry, EngineState, Fnv1a, NodeCarry, RestoreError, StateTransfer, fnv_1a, revision,
};
pub use tick::{Cursor, History};

pub use idle::Answer;

pub(crate) use at_work::{caught, naming};
use leap::Leaps;
use tick::Gathered;

use crate::channel::Extremes;
use crate::compile::{Entry, Plan, Step, admits, origins};
use crate::diagnostic::NodePanic;
use crate::node::{Evidence, Predictor};
use crate::time::{Duration, Instant};
use tick::{
    Estimate, NodeRunner, OutputSlots, PlannedSlot, Slots, TickContext, Work, runners, work,
};

/// What was fitted of a graph, estimators and features, by instance: `thermal.Z1`.
pub type Fitted = BTreeMap<String, Arc<dyn Predictor>>;

/// A running plan.
///
/// One thread steps it; a tick in the steady state neither allocates nor locks nor waits. Fitting, scoring, replaying and
/// live running all step one of these.
pub struct Engine {
    plan: Arc<Plan>,
    fitted: Fitted,
    /// Worked out when it is first asked for.
    revision: OnceLock<Arc<str>>,
    slots: Slots,
    gathered: Vec<Gathered>,
    /// Of the few slots that have one, in their order: see [`with_history`].
    histories: Box<[History]>,
    /// Those that have a history of what they held, with its place.
    recorded: Vec<(usize, usize)>,
    /// The planned channels, each with what it held before the tick.
    planned: Vec<PlannedSlot>,
    /// The nodes that are given truths after all outputs, and the slots of these.
    truths: Vec<(usize, usize)>,
    nodes: Box<[NodeRunner]>,
    leaps: Leaps,
    work: Box<[Work]>,
    last: Instant,
    /// Set between a segment break and the first tick after it: the last instant before the break.
    before_break: Option<Instant>,
    rejected: Vec<u64>,
    /// The lowest and the highest sample that counted, of each source.
    extremes: Vec<Extremes>,
    refused: u64,
    /// Estimators whose predictions are fed back, and the slots of their truths.
    fed_back: Vec<(usize, usize)>,
    /// Whether learning has been frozen on command.
    frozen: bool,
    /// The nodes that were given up after a panic; none where none may be.
    panics: Option<Vec<NodePanic>>,
    /// Room for the regressors of any estimator.
    row: Vec<f64>,
    /// The lowest and highest sample that count, of each source.
    ranges: Vec<(f64, f64)>,
    outputs: OutputSlots,
}

impl Engine {
    /// A plan ready to run, cold, with what has been fitted. An estimator that needs a fit and has none gives nothing.
    ///
    /// # Errors
    /// When something fitted does not belong to the plan.
    pub fn new(plan: Arc<Plan>, fitted: &Fitted) -> Result<Self, EngineError> {
        let leaps = Leaps::new(&plan);
        let nodes = runners(&plan, fitted, &leaps)?;
        let with_history: Vec<_> = with_history(&plan).collect();
        let planned = PlannedSlot::all(&plan, &with_history);
        let is_planned = |slot: usize| planned.iter().any(|of| of.slot == slot);
        let recorded = with_history.iter().copied().zip(0..);
        Ok(Self {
            recorded: recorded.filter(|(slot, _)| !is_planned(*slot)).collect(),
            planned,
            truths: nodes
                .iter()
                .enumerate()
                .filter_map(|(node, running)| Some((node, running.truth()?)))
                .collect(),
            slots: Slots::new(plan.channels.len()),
            gathered: plan
                .gathers
                .iter()
                .map(|gather| Gathered::new(gather, &with_history))
                .collect(),
            histories: plan
                .channels
                .iter()
                .filter_map(|channel| channel.history.map(History::new))
                .collect(),
            row: vec![
                0.0;
                nodes
                    .iter()
                    .filter_map(NodeRunner::estimate)
                    .map(Estimate::width)
                    .max()
                    .unwrap_or(0)
            ],
            work: work(&plan, &nodes),
            nodes,
            leaps,
            last: Instant::MIN,
            before_break: None,
            rejected: vec![0; plan.sources.len()],
            extremes: vec![Extremes::NONE; plan.sources.len()],
            refused: 0,
            fed_back: Vec::new(),
            frozen: false,
            panics: None,
            outputs: OutputSlots::new(&plan),
            ranges: plan.sources.iter().map(|source| source.range).collect(),
            fitted: fitted.clone(),
            revision: OnceLock::new(),
            plan,
        })
    }

    /// What the last tick gave, in the order of [`Plan::outputs`].
    #[must_use]
    pub fn outputs(&self) -> &[f64] {
        self.outputs.values()
    }

    /// The plan that is stepped.
    #[must_use]
    pub fn plan(&self) -> &Arc<Plan> {
        &self.plan
    }

    /// Takes the measurements of one instant and computes everything that follows from them.
    ///
    /// `samples` are in the order of [`Plan::sources`], in the units of the signals, NaN where a channel has no new value.
    /// The answer is in the order of [`Plan::outputs`], NaN where a node did not run or gave nothing at this tick.
    ///
    /// # Errors
    /// A time that is not after the last one, which is counted, or another number of samples: the engine is as it was.
    pub fn step(&mut self, time: Instant, samples: &[f64]) -> Result<&[f64], EngineError> {
        if samples.len() != self.plan.sources.len() {
            return Err(EngineError::WrongWidth {
                found: samples.len(),
                expected: self.plan.sources.len(),
            });
        }
        if time <= self.last {
            self.refused += 1;
            return Err(EngineError::NotAfter {
                time,
                last: self.last,
            });
        }
        if let Some(before) = self.before_break.take() {
            self.shift(time - before);
        }
        self.last = time;
        self.slots.tick += 1;
        self.take_in(time, samples);
        self.run_nodes(time);
        self.remember(time);
        self.outputs.put_out(&self.slots, time);
        Ok(self.outputs.values())
    }

    /// Takes several rows, one after the other, to the bits of as many [steps](Self::step); `look` sees the engine after each. Where thousands
    /// of engines take turns, what one knows is brought into the caches of the processor once for all of them.
    ///
    /// # Errors
    /// As of a step: the rows before it have been taken, and none after it.
    pub fn step_rows<'a>(
        &mut self,
        rows: impl IntoIterator<Item = (Instant, &'a [f64])>,
        mut look: impl FnMut(&Self, Instant),
    ) -> Result<(), EngineError> {
        for (time, samples) in rows {
            self.step(time, samples)?;
            look(self, time);
        }
        Ok(())
    }

    /// Runs the nodes in order. One that panics is given up where the engine isolates nodes, and the rest goes on.
    fn run_nodes(&mut self, time: Instant) {
        let mut nth = 0;
        while let Err((node, panic)) = caught(|at_work| {
            let (nodes, gathers) = (&mut *self.nodes, &*self.plan.gathers);
            let mut context = TickContext {
                now: time,
                slots: &mut self.slots,
                gathered: &mut self.gathered,
                leaps: &mut self.leaps,
                row: &mut self.row,
                frozen: self.frozen,
                at_work,
            };
            while let Some(work) = self.work.get_mut(nth) {
                nth += 1;
                match work {
                    Work::Step(Step::Gather(gather)) => {
                        let of = &gathers[*gather];
                        context.gathered[*gather].read(of, context.slots, &self.histories, time);
                    }
                    Work::Step(Step::Run(node)) => {
                        context.at_work.is(*node);
                        context.run(&mut nodes[*node]);
                    }
                    Work::Step(Step::Capture(node)) => {
                        context.at_work.is(*node);
                        context.capture(&mut nodes[*node]);
                    }
                    Work::Bank(bank) => bank.run(&mut context, nodes),
                    Work::Nothing => {}
                }
            }
        }) {
            self.give_up(node, panic);
        }
    }

    /// The instant of the last tick; none before the first.
    #[must_use]
    pub fn last(&self) -> Option<Instant> {
        let within = (self.last > Instant::MIN).then_some(self.last);
        within.or(self.before_break)
    }

    /// Whether a tick at this instant would be taken.
    pub fn takes(&self, time: Instant) -> bool {
        time > self.last
    }

    /// Freezes what estimators learn while they run, or lets it go on; votes, which weigh by recent errors, go on.
    ///
    /// Nothing is learned at a tick at which learning is frozen, and nothing later from a row or a truth of such a tick.
    pub fn freeze(&mut self, frozen: bool) {
        self.frozen = frozen;
    }

    /// Lets estimators predict from such past truths as a mode allows; for evaluations, before the first tick.
    ///
    /// Predictions that are fed back are kept in memory that grows as it must.
    pub fn predict_in(&mut self, mode: Mode) {
        self.fed_back.clear();
        let nodes = self.plan.nodes.iter().zip(&mut self.nodes);
        for (index, (node, running)) in nodes.enumerate() {
            if let Some(estimate) = running.estimate_mut()
                && let Some(link) = node.role.truth()
            {
                estimate.predict_in(mode, link, &self.plan.gathers);
                if estimate.feedback().is_some() {
                    self.fed_back.push((index, link.slot));
                }
            }
        }
        self.work = work(&self.plan, &self.nodes);
    }

    /// How long a step of a node was planned to be, which is none where it is as long as the time between truths; none of either
    /// where no past truth changes what it predicts in the mode of the engine.
    pub fn step_of(&self, node: usize) -> Option<Option<Duration>> {
        self.nodes.get(node)?.estimate()?.step()
    }

    /// Whether learning has been frozen on command.
    #[must_use]
    pub fn frozen(&self) -> bool {
        self.frozen
    }

    /// What was fitted.
    #[must_use]
    pub fn fitted(&self) -> &Fitted {
        &self.fitted
    }

    /// The revision of the graph that runs; see [`revision`].
    #[must_use]
    pub fn revision(&self) -> &str {
        self.revision
            .get_or_init(|| revision(&self.plan, &self.fitted).into())
    }

    /// The next tick belongs to another segment: windows, lags and filters start afresh, what was learned stays.
    pub fn segment(&mut self) {
        if self.last == Instant::MIN {
            return;
        }
        naming(&self.plan, When::Tick(self.last), |at_work| {
            for (nth, node) in self.nodes.iter_mut().enumerate() {
                at_work.is(nth);
                match node {
                    NodeRunner::Operator(node) => node.operator.segment(),
                    NodeRunner::Estimate(node) => {
                        if let Some(estimate) = &mut node.estimate {
                            estimate.segment(self.last, &self.gathered, !self.frozen);
                        }
                    }
                    NodeRunner::Vote(vote) => vote.segment(self.last),
                }
            }
        });
        self.leaps.segment();
        self.slots.clear();
        self.gathered.iter_mut().for_each(Gathered::clear);
        self.histories.iter_mut().for_each(History::clear);
        self.before_break = Some(self.last);
        self.last = Instant::MIN;
    }

    /// How often a channel's sample was rejected as infinite or outside its range, in the order of [`Plan::sources`].
    #[must_use]
    pub fn rejected(&self) -> &[u64] {
        &self.rejected
    }

    /// The measured channels of which samples were rejected, and how many.
    #[must_use]
    pub fn rejected_channels(&self) -> Vec<(String, u64)> {
        let counted = self.plan.sources.iter().zip(&self.rejected);
        counted
            .filter(|&(_, &count)| count > 0)
            .map(|(source, &count)| (source.name.clone(), count))
            .collect()
    }

    /// How many ticks were refused because their time was not after the last one.
    #[must_use]
    pub fn refused(&self) -> u64 {
        self.refused
    }

    /// Counts rejected samples and refused ticks, and takes the ranges of samples, from here on: those before are another run's.
    pub fn count_afresh(&mut self) {
        self.rejected.fill(0);
        self.extremes.fill(Extremes::NONE);
        self.refused = 0;
    }

    /// Whether a slot was given something at the present tick, be it nothing.
    ///
    /// # Panics
    /// Where the plan has no such slot: there is one for each of [`Plan::channels`].
    #[must_use]
    pub fn ran(&self, slot: usize) -> bool {
        self.slots.ran(slot)
    }

    /// The value that a slot was given at the present tick; NaN where its node did not run or gave nothing.
    ///
    /// # Panics
    /// Where the plan has no such slot.
    #[must_use]
    pub fn value(&self, slot: usize) -> f64 {
        self.slots.now(slot)
    }

    /// The stamp of a slot's last value.
    ///
    /// # Panics
    /// Where the plan has no such slot.
    #[must_use]
    pub fn stamp(&self, slot: usize) -> Instant {
        self.slots.given[slot].stamp
    }

    /// The first of all that a slot is made of, itself included, that lacks a value: a measured channel without a sample in this
    /// segment, or a node that never ran in it or gave nothing when it last did.
    ///
    /// # Panics
    /// Where the plan has no such slot.
    #[must_use]
    pub fn first_silent(&self, slot: usize) -> String {
        let plan = &*self.plan;
        let behind = origins::upstream(plan, vec![slot], |node| origins::inputs(plan, node));
        let may_rest = |slot: usize| plan.sources.get(slot).is_some_and(|of| of.optional);
        let lacks = |&slot: &usize| self.slots.values[slot].is_nan() && !may_rest(slot);
        let mut behind = (0..behind.len()).filter(|&slot| behind[slot]);
        let first = &plan.channels[behind.find(lacks).unwrap_or(slot)];
        let node = first.node.map(|node| plan.nodes[node].instance());
        node.unwrap_or_else(|| first.name.clone())
    }

    /// Why nothing of a slot counts at the present tick: what is behind it and gave nothing though all that it reads counts, or the measured
    /// channel whose last sample is too old.
    ///
    /// # Panics
    /// Where the plan has no such slot.
    #[must_use]
    pub fn lacking(&self, slot: usize) -> String {
        let plan = &*self.plan;
        let (mut at, mut seen) = (slot, vec![false; plan.channels.len()]);
        while let Some(node) = plan.channels[at].node.map(|node| &plan.nodes[node]) {
            seen[at] = true;
            let span = plan.channels[at].channel.span;
            let entries = node.role.inputs().flat_map(|of| &plan.gathers[of].entries);
            let age = |of: &Entry| self.last - of.lag - self.slots.given[of.slot].stamp;
            let counts = |of: &Entry| {
                !self.slots.values[of.slot].is_nan() && age(of) <= of.max_age.max(span)
            };
            let missing = entries.filter(|of| !seen[of.slot] && !counts(of));
            let is_absent = |of: &Entry| self.slots.values[of.slot].is_nan();
            let Some(next) = missing.max_by_key(|of| (is_absent(of), age(of))) else {
                return node.instance();
            };
            at = next.slot;
        }
        plan.channels[at].name.clone()
    }

    /// What a gather read at the present tick, and whether anything in it was fresh.
    ///
    /// # Panics
    /// Where the plan has no such gather.
    #[must_use]
    pub fn gathered(&self, gather: usize) -> (&[f64], bool) {
        (&self.gathered[gather].values, self.gathered[gather].fresh)
    }

    /// How many truths a combiner has seen, and how many of them it goes by; none for other nodes.
    pub fn evidence(&self, node: usize) -> Option<(u64, Evidence)> {
        let NodeRunner::Vote(vote) = &self.nodes[node] else {
            return None;
        };
        let when = When::Tick(self.last);
        naming_one(&self.plan, node, when, || vote.evidence())
    }

    fn take_in(&mut self, time: Instant, samples: &[f64]) {
        self.planned.iter_mut().for_each(|of| of.keep(&self.slots));
        for (slot, (&sample, &range)) in samples.iter().zip(&self.ranges).enumerate() {
            if sample.is_nan() {
                continue;
            }
            if admits(range, sample) {
                self.slots.set(slot, sample, time);
                self.extremes[slot].include(sample);
            } else {
                self.rejected[slot] += 1;
            }
        }
        for planned in &self.planned {
            planned.take(&mut self.slots, &mut self.histories, time);
        }
    }

    /// Writes down what later ticks will ask for, and hands truths over, now that all outputs of the tick are there.
    fn remember(&mut self, now: Instant) {
        self.leaps.remember(&self.slots, now);
        for &(slot, nth) in &self.recorded {
            if self.slots.ran(slot) {
                let stamp = self.slots.given[slot].stamp;
                self.histories[nth].push(now, self.slots.values[slot], stamp);
            }
        }
        for &(node, slot) in &self.fed_back {
            let estimate = self.nodes[node].estimate_mut();
            if let Some(feedback) = estimate.and_then(Estimate::feedback)
                && self.slots.ran(slot)
            {
                feedback.observe(self.slots.values[slot], self.slots.given[slot].stamp, now);
            }
        }
        let mut nth = 0;
        while let Err((node, panic)) = caught(|at_work| {
            while let Some(&(node, slot)) = self.truths.get(nth) {
                nth += 1;
                if !self.slots.fresh(slot) {
                    continue;
                }
                at_work.is(node);
                let truth = self.slots.values[slot];
                match &mut self.nodes[node] {
                    NodeRunner::Vote(vote) => vote.observe(truth, now),
                    other => {
                        if let Some(learning) = other.learning() {
                            learning.observe(truth, now, &self.gathered, !self.frozen);
                        }
                    }
                }
            }
        }) {
            nth -= 1;
            self.give_up(node, panic);
        }
    }

    fn shift(&mut self, shift: Duration) {
        for node in &mut self.nodes {
            match node {
                NodeRunner::Vote(vote) => vote.shift(shift),
                other => {
                    if let Some(learning) = other.learning() {
                        learning.shift(shift);
                    }
                }
            }
        }
    }
}

/// The slots of a plan that have a history, in their order.
fn with_history(plan: &Plan) -> impl Iterator<Item = usize> {
    let channels = plan.channels.iter().enumerate();
    channels.filter_map(|(slot, channel)| channel.history.map(|_| slot))
}

impl std::fmt::Debug for Engine {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Engine")
            .field("graph", &self.plan.name)
            .field("tick", &self.slots.tick)
            .field("last", &self.last)
            .finish_non_exhaustive()
    }
}
