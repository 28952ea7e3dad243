//! Cuts a recording into stretches of one length, as a rule UTC days, and sums the examples of each. Not a fit from the sums.

use std::collections::BTreeMap;
use std::hash::Hasher as _;
use std::sync::Arc;

use serde_json::value::RawValue;

use super::FitError;
use super::block::{Block, Content, Examples, Group, State};
use super::blocks::{BlockError, check, rows_identity};
use super::collect::{Collector, Share, Sink, Trainee};
use super::doubt::Truths;
use super::rates::Spacing;
use super::train::trainer_of;
use crate::channel::Extremes;
use crate::compile::{Plan, TruthLink};
use crate::engine::{Engine, Fitted, Fnv1a, When, naming_one};
use crate::node::{Trainer, TrainingError};
use crate::recording::{AHEAD, Event, Recording, Samples, Steps, drive};
use crate::score::Means;
use crate::time::{Duration, Instant};

/// So many rows are summed at a time.
const BATCH: usize = 256;

/// Steps a plan over a recording and hands on a block for each stretch of that length that has rows, counted from 1970-01-01, in order; of
/// those that are not `wanted` none is made. Below they are called days, which they are as a rule. A day is stepped by an engine that has seen the day before and no more, so that its block does not depend on the rest of the
/// recording. `progress` is called with the number of ticks stepped so far.
///
/// # Errors
/// When the plan has nodes that sums do not suffice ([`BlockError`]), the recording cannot be read or goes back to a day before, or
/// `take` fails.
pub fn blocks_of(
    plan: &Arc<Plan>,
    recording: &dyn Recording,
    length: Duration,
    wanted: &dyn Fn(i64) -> bool,
    progress: &mut dyn FnMut(u64),
    take: &mut dyn FnMut(Block) -> Result<(), FitError>,
) -> Result<(), FitError> {
    check(plan, length)?;
    let mut cutter = Cutter {
        plan,
        length_ns: length.as_ns(),
        graph: rows_identity(plan),
        wanted,
        take,
        day: None,
        last: None,
        is_break: true,
        current: None,
        next: None,
    };
    let mut source = recording.open(plan)?;
    let mut stepped = 0;
    drive::<_, FitError>(&mut cutter, &mut *source, AHEAD, |_, event, _| {
        stepped += u64::from(matches!(event, Event::Row(_)));
        if stepped.is_multiple_of(4096) {
            progress(stepped);
        }
        Ok(())
    })?;
    cutter.end_day()
}

/// The day that is summed, and beside it the one after, for which it is the day before.
struct Cutter<'a> {
    plan: &'a Arc<Plan>,
    length_ns: i64,
    graph: String,
    wanted: &'a dyn Fn(i64) -> bool,
    take: &'a mut dyn FnMut(Block) -> Result<(), FitError>,
    day: Option<i64>,
    last: Option<Instant>,
    /// Whether times may start again.
    is_break: bool,
    current: Option<DayInWork>,
    next: Option<DayInWork>,
}

impl Steps for Cutter<'_> {
    type Error = FitError;

    fn take(&mut self, event: Event, samples: &Samples) -> Result<bool, FitError> {
        match event {
            Event::Segment => self.is_break = true,
            Event::Row(now) => {
                let is_refused = !self.is_break && self.last.is_some_and(|last| now <= last);
                if !is_refused {
                    self.go_to(now.as_ns().div_euclid(self.length_ns))?;
                    (self.last, self.is_break) = (Some(now), false);
                }
            }
        }
        for day in self.current.iter_mut().chain(&mut self.next) {
            day.take(event, samples)?;
        }
        Ok(true)
    }
}

impl Cutter<'_> {
    fn go_to(&mut self, day: i64) -> Result<(), FitError> {
        if self.day == Some(day) {
            return Ok(());
        }
        if self.day.is_some_and(|before| day < before) {
            return Err(BlockError::GoesBack { day }.into());
        }
        self.end_day()?;
        self.day = Some(day);
        let warm = self.next.take().filter(|next| next.block.day == day);
        let fresh = |of: i64| -> Result<Option<DayInWork>, FitError> {
            let make = || DayInWork::new(self.plan, of, self.graph.clone());
            (self.wanted)(of).then(make).transpose()
        };
        self.current = match warm {
            Some(warm) => Some(warm),
            None => fresh(day)?,
        };
        self.next = fresh(day + 1)?;
        if let Some(current) = &mut self.current {
            current.begin();
        }
        Ok(())
    }

    fn end_day(&mut self) -> Result<(), FitError> {
        match self.current.take() {
            Some(day) => (self.take)(day.end(self.plan)?),
            None => Ok(()),
        }
    }
}

/// A day that is stepped, from the beginning of the day before on.
struct DayInWork {
    block: Block,
    engine: Engine,
    collector: Collector,
    sums: Vec<Summing>,
    means: Means,
    spacing: Spacing,
    hash: Fnv1a,
    /// Whether the day itself has begun.
    has_begun: bool,
    /// Whether the next row begins a segment.
    is_break: bool,
}

impl DayInWork {
    fn new(plan: &Arc<Plan>, day: i64, graph: String) -> Result<Self, FitError> {
        let nodes: Vec<usize> = fitted_nodes(plan).collect();
        let collector = Collector::new(plan, &nodes, 0);
        let trainees = collector.trainees.iter();
        Ok(Self {
            block: Block::new(day, graph),
            engine: Engine::new(Arc::clone(plan), &Fitted::new())?,
            sums: trainees.map(|of| Summing::new(plan, of)).collect(),
            collector,
            means: Means::new(plan),
            spacing: Spacing::new(plan),
            hash: Fnv1a::default(),
            has_begun: false,
            is_break: true,
        })
    }

    /// The rows from here on are of the day itself.
    fn begin(&mut self) {
        self.has_begun = true;
        self.hash.write(b"day");
        self.engine.count_afresh();
    }

    fn take(&mut self, event: Event, samples: &Samples) -> Result<(), FitError> {
        let Event::Row(now) = event else {
            self.is_break = true;
            self.engine.segment();
            self.spacing.look(&self.engine, event, false);
            self.collector
                .look::<Summing>(&self.engine, event, &Share::all(), None);
            return Ok(());
        };
        // What came before the first row is not known where that row is the first that is read.
        if std::mem::take(&mut self.is_break) {
            self.hash.write(b"segment");
            self.block.segments += u64::from(self.has_begun);
        }
        self.hash.write(&now.as_ns().to_le_bytes());
        for value in &samples.values {
            let bits = if value.is_nan() { f64::NAN } else { *value }.to_bits();
            self.hash.write(&bits.to_le_bytes());
        }
        if !self.engine.take(event, samples)? {
            return Ok(());
        }
        let (engine, sums) = (&self.engine, &mut self.sums);
        self.spacing.look(engine, event, self.has_begun);
        if !self.has_begun {
            self.collector
                .look(engine, event, &Share::none(), Some(sums));
            return Ok(());
        }
        self.collector
            .look(engine, event, &Share::all(), Some(sums));
        self.means.look(|slot| engine.value(slot));
        self.block.ticks += 1;
        let (from, to) = self.block.period;
        self.block.period = (from.min(now.as_ns()), to.max(now.as_ns()));
        Ok(())
    }

    fn end(self, plan: &Plan) -> Result<Block, FitError> {
        let mut block = self.block;
        block.rows = format!("{:016x}", self.hash.finish());
        block.refused = self.engine.refused();
        block.rejected = self.engine.rejected_channels();
        block.ranges = self.engine.sample_ranges();
        block.levels = self.means.sums();
        block.steps = self.spacing.kept();
        let silent = self.collector.silent.iter();
        block.silent = silent
            .map(|&slot| plan.channels[slot].name.clone())
            .collect();
        for (trainee, sums) in self.collector.trainees.iter().zip(self.sums) {
            let node = plan.nodes[trainee.node].instance();
            let groups = naming_one(plan, trainee.node, When::Fit, || sums.end());
            block.estimators.push(Examples {
                ran: self.collector.ran(trainee),
                without_run: trainee.dropped.without_run,
                outside_limits: trainee.dropped.outside_limits,
                leapt: trainee.dropped.leapt,
                groups: groups.map_err(|error| BlockError::NoSums {
                    node: node.clone(),
                    error,
                })?,
                node,
            });
        }
        Ok(block)
    }
}

/// The nodes that are fitted, by their positions.
pub(super) fn fitted_nodes(plan: &Plan) -> impl Iterator<Item = usize> {
    let nodes = plan.nodes.iter().enumerate();
    nodes.filter_map(|(nth, node)| node.rows().map(|_| nth))
}

/// Sums the examples of one estimator.
struct Summing {
    plan: Arc<Plan>,
    /// The estimator, and its truth.
    of: (usize, TruthLink),
    groups: Vec<GroupInWork>,
    known: BTreeMap<Vec<State>, usize>,
    states: Vec<State>,
    row: Vec<f64>,
    /// The group of the last example.
    last: usize,
}

struct GroupInWork {
    states: Vec<State>,
    /// The examples that are not summed yet.
    rows: Vec<f64>,
    order: usize,
    truths: Truths,
    extremes: Vec<Extremes>,
    trainer: Option<Box<dyn Trainer>>,
}

impl Summing {
    fn new(plan: &Arc<Plan>, trainee: &Trainee) -> Self {
        Self {
            plan: Arc::clone(plan),
            of: (trainee.node, trainee.link),
            groups: Vec::new(),
            known: BTreeMap::new(),
            states: Vec::new(),
            row: Vec::new(),
            last: 0,
        }
    }

    /// The groups in the order of their first examples.
    fn end(self) -> Result<Vec<Group>, TrainingError> {
        let groups = self.groups.into_iter();
        groups.map(|group| group.end(&self.plan, self.of)).collect()
    }
}

impl Sink for Summing {
    fn row<'a>(&mut self, _: Instant, parts: impl Iterator<Item = &'a [f64]> + Clone, truth: f64) {
        let values = parts.flatten();
        self.states.clear();
        self.states
            .extend(values.clone().map(|value| State::of(*value)));
        let known = self.groups.get(self.last);
        if known.is_none_or(|group| group.states != self.states) {
            self.last = match self.known.get(&self.states) {
                Some(&nth) => nth,
                None => {
                    self.known.insert(self.states.clone(), self.groups.len());
                    self.groups.push(GroupInWork::new(self.states.clone()));
                    self.groups.len() - 1
                }
            };
        }
        self.row.clear();
        self.row
            .extend(values.copied().filter(|value| !value.is_nan()));
        let group = &mut self.groups[self.last];
        group.truths.count(truth);
        self.row.push(truth);
        for (range, value) in group.extremes.iter_mut().zip(&self.row) {
            range.include(*value);
        }
        group.rows.extend_from_slice(&self.row);
        if group.rows.len() >= BATCH * group.order {
            group.sum(&self.plan, self.of);
        }
    }

    fn run(&mut self, _: Instant, _: &[f64]) {}

    fn segment(&mut self) {}
}

impl GroupInWork {
    fn new(states: Vec<State>) -> Self {
        let present = states.iter().filter(|state| **state == State::Present);
        let order = present.count() + 1;
        Self {
            states,
            rows: Vec::new(),
            order,
            truths: Truths::default(),
            extremes: vec![Extremes::NONE; order],
            trainer: None,
        }
    }

    /// Sums the examples that are not yet.
    fn sum(&mut self, plan: &Plan, of: (usize, TruthLink)) {
        let trainer = self.trainer.get_or_insert_with(|| {
            let present = self.states.iter().enumerate();
            let present = present.filter(|(_, state)| **state == State::Present);
            let present: Vec<usize> = present.map(|(nth, _)| nth).collect();
            let (mut trainer, _) = trainer_of(plan, of, &present, 0);
            // Rows are not kept from here on.
            trainer.summed();
            trainer
        });
        for row in self.rows.chunks_exact(self.order) {
            let (truth, regressors) = (row[self.order - 1], &row[..self.order - 1]);
            trainer.row(regressors, truth);
        }
        self.rows.clear();
    }

    fn end(mut self, plan: &Plan, of: (usize, TruthLink)) -> Result<Group, TrainingError> {
        let examples = self.rows.len() / self.order;
        // Sums are a triangle: fewer examples take less room themselves.
        if self.trainer.is_some() || 2 * examples > self.order {
            self.sum(plan, of);
        }
        let content = match self.trainer.as_mut().and_then(|trainer| trainer.summed()) {
            None => Content::Rows(self.rows),
            Some(summed) => {
                let extremes = self.extremes.iter();
                let unreadable = |error: serde_json::Error| TrainingError::Unsolvable {
                    reason: error.to_string(),
                };
                Content::Sums {
                    truths: self.truths,
                    extremes: extremes.map(|of| (of.lowest, of.highest)).collect(),
                    sums: RawValue::from_string(summed.sums()?).map_err(unreadable)?,
                }
            }
        };
        Ok(Group {
            states: self.states,
            content,
        })
    }
}
