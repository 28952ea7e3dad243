//! Decides how a fit is made of blocks in place of rows, and which nodes that suffices; not how rows become blocks.

use std::fmt;
use std::sync::{Arc, Mutex};

use serde_json::{Value, json};

use super::block::{Block, Examples};
use super::collect::{Collector, Trainee};
use super::cut::fitted_nodes;
use super::levels::levels;
use super::progress::{FitProgress, Listener};
use super::rates::Spacing;
use super::train::{Made, Making, begin, end, in_threads, trainer_of};
use super::{FitError, FitOptions, FitReport};
use crate::compile::{Plan, PlannedRole, meaning};
use crate::engine::{Fitted, When, fnv_1a, naming_one};
use crate::node::TrainingError;
use crate::recording::SourceError;
use crate::score::Means;
use crate::time::{Duration, Instant};

/// Why a fit cannot be made by blocks.
#[derive(Debug, Clone, PartialEq)]
pub enum BlockError {
    /// Nodes need more of the rows than sums.
    NeedsRows {
        /// Each with its kind.
        nodes: Vec<(String, &'static str)>,
    },
    /// Nodes learn from what others were fitted to.
    NeedsFits {
        /// Each with its kind.
        nodes: Vec<(String, &'static str)>,
    },
    /// A node looks back farther than a block is long.
    LooksBack {
        /// The node.
        node: String,
        /// How far it does; none where it depends on all of the past.
        span: Option<Duration>,
        /// How long a block is.
        length: Duration,
    },
    /// The rows go back to a block that has ended.
    GoesBack {
        /// Which one, counted from 1970-01-01.
        day: i64,
    },
    /// The rows of a node cannot be summed.
    NoSums {
        /// The node.
        node: String,
        /// Why.
        error: TrainingError,
    },
    /// A block is not one of this graph, or not in the order of time.
    Stray {
        /// Which one, counted from 1970-01-01.
        day: i64,
    },
    /// There is no block.
    None,
}

impl fmt::Display for BlockError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let named = |nodes: &[(String, &'static str)]| {
            let named = nodes
                .iter()
                .map(|(node, kind)| format!("`{node}` ({kind})"));
            named.collect::<Vec<_>>().join(", ")
        };
        match self {
            Self::NeedsRows { nodes } => write!(
                f,
                "blocks hold sums in place of rows, from which least squares are solved, and not what {} learns from; fit without blocks, \
                 or use a kind that is fitted by least squares",
                named(nodes)
            ),
            Self::NeedsFits { nodes } => write!(
                f,
                "{} learns from what other nodes were fitted to, which blocks do not hold; fit without blocks",
                named(nodes)
            ),
            Self::LooksBack { node, span, length } => {
                let span = span.map_or("all of the past".to_owned(), |span| span.to_string());
                write!(
                    f,
                    "`{node}` looks back {span}, and a block of {length} knows the one before and no more; fit without blocks, make them longer, or \
                     shorten windows"
                )
            }
            Self::GoesBack { day } => write!(
                f,
                "the rows go back to block {day} since 1970-01-01, which has ended; blocks are made of rows in the order of time: fit logs \
                 that overlap one by one, or without blocks"
            ),
            Self::NoSums { node, error } => write!(f, "`{node}`: {error}"),
            Self::Stray { day } => write!(
                f,
                "block {day} since 1970-01-01 is of another graph, or not in the order of time; make it anew from the rows"
            ),
            Self::None => write!(f, "there is no block to fit on"),
        }
    }
}

impl std::error::Error for BlockError {}

impl From<BlockError> for FitError {
    fn from(error: BlockError) -> Self {
        Self::Blocks(error)
    }
}

/// Blocks that can be read more than once, in the order of their days.
pub trait Blocks {
    /// How many there are.
    fn count(&self) -> usize;

    /// Hands one on.
    ///
    /// # Errors
    /// When it cannot be read.
    fn read(&self, nth: usize, take: &mut dyn FnMut(&Block)) -> Result<(), SourceError>;
}

impl Blocks for Vec<Block> {
    fn count(&self) -> usize {
        self.len()
    }

    fn read(&self, nth: usize, take: &mut dyn FnMut(&Block)) -> Result<(), SourceError> {
        self.get(nth).into_iter().for_each(take);
        Ok(())
    }
}

/// Checks that sums over blocks of a length suffice to fit a plan.
///
/// # Errors
/// Which nodes need the rows.
pub fn check(plan: &Plan, length: Duration) -> Result<(), BlockError> {
    let named = |nodes: Vec<usize>| -> Vec<(String, &'static str)> {
        let of = |nth: usize| (plan.nodes[nth].instance(), plan.nodes[nth].kind.name);
        nodes.into_iter().map(of).collect()
    };
    let above = levels(plan).into_iter().skip(1);
    let nodes: Vec<usize> = above.flat_map(|level| level.nodes).collect();
    if !nodes.is_empty() {
        return Err(BlockError::NeedsFits {
            nodes: named(nodes),
        });
    }
    let needs_rows = |&node: &usize| {
        let PlannedRole::Estimator { fit, .. } = &plan.nodes[node].role else {
            return true;
        };
        let all: Vec<usize> = (0..fit.regressors.len()).collect();
        let (mut trainer, _) = trainer_of(plan, (node, fit.truth), &all, 0);
        trainer.summed().is_none()
    };
    let nodes: Vec<usize> = fitted_nodes(plan).filter(needs_rows).collect();
    if !nodes.is_empty() {
        return Err(BlockError::NeedsRows {
            nodes: named(nodes),
        });
    }
    let warm_ups = plan.warm_ups();
    for node in fitted_nodes(plan) {
        let behind = plan.behind(plan.reads(&plan.nodes[node]));
        let ahead = plan.nodes[node]
            .role
            .truth()
            .map_or(Duration::ZERO, |of| of.ahead + of.limit);
        for (nth, other) in plan.nodes.iter().enumerate() {
            if nth != node && !behind[other.slots.clone()].contains(&true) {
                continue;
            }
            let span = (!other.endless).then_some(warm_ups[nth] + ahead);
            if span.is_none_or(|span| span > length) {
                let node = other.instance();
                return Err(BlockError::LooksBack { node, span, length });
            }
        }
    }
    Ok(())
}

/// A checksum of what makes examples of rows: the signals, the features that estimators read, and which regressors and truths these
/// have. How an estimator is fitted on its examples is no part of it.
#[must_use]
pub fn rows_identity(plan: &Plan) -> String {
    let mut whole = meaning(plan);
    let nodes = whole["nodes"].take();
    let behind = plan.behind(fitted_nodes(plan).flat_map(|node| plan.reads(&plan.nodes[node])));
    let features = plan
        .nodes
        .iter()
        .filter(|node| behind[node.slots.clone()].contains(&true));
    let features = features.map(|node| (node.instance(), nodes[node.instance()].clone()));
    let features: serde_json::Map<String, Value> = features.collect();
    let estimators = fitted_nodes(plan).filter_map(|nth| {
        let (node, fit) = (&plan.nodes[nth], plan.nodes[nth].role.fit()?);
        let (truth, limits) = (&fit.truth, fit.training);
        let limits = [limits.below, limits.above].map(f64::to_bits);
        let spans = [truth.ahead, truth.span, truth.limit].map(Duration::as_ns);
        let of = &plan.channels[truth.slot];
        let unit = of.channel.unit.to_string();
        Some(json!([
            node.instance(),
            fit.regressors,
            of.name,
            unit,
            limits,
            spans
        ]))
    });
    let examples = json!({
        "time": whole["time"],
        "signals": whole["signals"],
        "features": features,
        "estimators": estimators.collect::<Vec<_>>(),
    });
    format!("{:016x}", fnv_1a(examples.to_string().as_bytes()))
}

/// Trains every estimator of a plan on blocks: to the bit the same whether they were made just now or are read again.
///
/// Blocks are summed in the order of their days, and no fold cuts one. Each is read two or three times and let go, so that memory does
/// not grow with rows. Beside a [`fit`](super::fit()) on the rows, folds end at days, and what needs the rows themselves is missing: the
/// novelty of regressors, and singular values where regressors hang together.
///
/// # Errors
/// When sums do not suffice the plan, or a block cannot be read or is of another graph. An estimator that cannot be fitted stands in the
/// report.
pub fn fit_from_blocks(
    plan: &Arc<Plan>,
    blocks: &(impl Blocks + ?Sized),
    options: &FitOptions,
    progress: &mut (dyn FnMut(FitProgress<'_>) + Send),
) -> Result<(Fitted, FitReport), FitError> {
    // They were made of rows, and looked back far enough.
    check(plan, Duration::from_ns(i64::MAX))?;
    let nodes: Vec<usize> = fitted_nodes(plan).collect();
    let (listener, identity) = (Listener::new(progress), rows_identity(plan));
    let mut fit = FromBlocks {
        plan,
        collector: Collector::new(plan, &nodes, 0),
        means: Means::new(plan),
        spacing: Spacing::new(plan),
        report: FitReport::default(),
        last: None,
    };
    each(blocks, |block| {
        if block.graph != identity || fit.last.is_some_and(|last| block.day <= last) {
            return Err(BlockError::Stray { day: block.day });
        }
        fit.count(block)
    })?;
    if fit.last.is_none() {
        return Err(BlockError::None.into());
    }
    fit.report.levels = fit.means.levels(plan);
    fit.report.rates = fit.spacing.usual(plan);
    let mut makings = fit.make(blocks, nodes.iter().map(|_| Vec::new()), &listener)?;
    let constants: Vec<Vec<usize>> = makings.iter().map(Making::constant).collect();
    if constants.iter().any(|constant| !constant.is_empty()) {
        makings = fit.make(blocks, constants.into_iter(), &listener)?;
    }
    let makings: Vec<_> = makings
        .into_iter()
        .map(|making| Mutex::new(Some(making)))
        .collect();
    let made = in_threads(makings.len(), options.threads, |nth| {
        let trainee = &fit.collector.trainees[nth];
        let mut making = makings[nth]
            .lock()
            .unwrap_or_else(|broken| broken.into_inner());
        let making = making.take()?;
        Some(naming_one(plan, trainee.node, When::Fit, || -> Made {
            end(plan, &fit.collector, trainee, making, false, &listener)
        }))
    });
    let mut fitted = Fitted::new();
    for (of, predictor) in made.into_iter().flatten() {
        if let Some(predictor) = predictor {
            fitted.insert(of.node.clone(), Arc::from(predictor));
        }
        fit.report.estimators.push(of);
    }
    Ok((fitted, fit.report))
}

/// Looks at each block, once.
fn each(
    blocks: &(impl Blocks + ?Sized),
    mut look: impl FnMut(&Block) -> Result<(), BlockError>,
) -> Result<(), FitError> {
    for nth in 0..blocks.count() {
        let mut looked = Ok(());
        let read = blocks.read(nth, &mut |block| looked = look(block));
        read.map_err(FitError::Recording)?;
        looked?;
    }
    Ok(())
}

/// A fit on blocks under way.
struct FromBlocks<'a> {
    plan: &'a Plan,
    /// What is known of the rows of all blocks, without a row.
    collector: Collector,
    means: Means,
    spacing: Spacing,
    report: FitReport,
    last: Option<i64>,
}

impl FromBlocks<'_> {
    /// The examples of an estimator in a block.
    fn examples<'b>(
        plan: &Plan,
        trainee: &Trainee,
        block: &'b Block,
    ) -> Result<&'b Examples, BlockError> {
        let node = &plan.nodes[trainee.node];
        let candidates = node.role.fit().map_or(0, |fit| fit.regressors.len());
        let examples = block.examples(&node.instance(), candidates);
        examples.ok_or(BlockError::Stray { day: block.day })
    }

    /// Counts what a block holds: which candidates have values is known once all have been.
    fn count(&mut self, block: &Block) -> Result<(), BlockError> {
        let Self {
            plan,
            collector,
            report,
            ..
        } = self;
        let is_first = self.last.is_none();
        self.last = Some(block.day);
        for trainee in &mut collector.trainees {
            let examples = Self::examples(plan, trainee, block)?;
            trainee.dropped.without_run += examples.without_run;
            trainee.dropped.outside_limits += examples.outside_limits;
            trainee.dropped.leapt += examples.leapt;
            for group in &examples.groups {
                let values = group.states.iter().map(|state| state.value());
                trainee.validity.count_alike(values, group.count());
            }
            if examples.ran {
                let taps = trainee.taps.clone();
                taps.into_iter()
                    .for_each(|tap| collector.taps[tap].ran = true);
            }
        }
        let is_silent = |slot: &usize| block.silent.contains(&plan.channels[*slot].name);
        collector.silent.retain(is_silent);
        self.means.add(&block.levels);
        self.spacing.add(&block.steps);
        report.ticks += block.ticks;
        report.segments += block.segments;
        report.refused += block.refused;
        let (from, to) = (
            Instant::from_ns(block.period.0),
            Instant::from_ns(block.period.1),
        );
        let (first, _) = report.period.unwrap_or((from, to));
        report.period = Some((first, to));
        for (channel, count) in &block.rejected {
            match report
                .rejected
                .iter_mut()
                .find(|(known, _)| known == channel)
            {
                Some((_, all)) => *all += count,
                None => report.rejected.push((channel.clone(), *count)),
            }
        }
        for range in &block.ranges {
            match report
                .ranges
                .iter_mut()
                .find(|known| known.channel == range.channel)
            {
                Some(known) => {
                    known.lowest = known.lowest.min(range.lowest);
                    known.highest = known.highest.max(range.highest);
                }
                None => report.ranges.push(range.clone()),
            }
        }
        if !is_first {
            // The order of the plan, whichever channel came first.
            let place = |name: &String| plan.sources.iter().position(|source| source.name == *name);
            report.rejected.sort_by_key(|(channel, _)| place(channel));
            report.ranges.sort_by_key(|range| place(&range.channel));
        }
        Ok(())
    }

    /// Gives all blocks to new trainers, each without some of its candidates.
    fn make(
        &self,
        blocks: &(impl Blocks + ?Sized),
        without: impl Iterator<Item = Vec<usize>>,
        progress: &Listener<'_>,
    ) -> Result<Vec<Making>, FitError> {
        let (plan, trainees) = (self.plan, &self.collector.trainees);
        let begun = trainees.iter().zip(without).map(|(trainee, constant)| {
            naming_one(plan, trainee.node, When::Fit, || {
                begin(plan, trainee, 0, constant)
            })
        });
        let mut makings: Vec<Making> = begun.collect();
        let mut stepped = 0;
        each(blocks, |block| {
            for (making, trainee) in makings.iter_mut().zip(trainees) {
                let examples = Self::examples(plan, trainee, block)?;
                naming_one(plan, trainee.node, When::Fit, || {
                    making.take(&examples.groups, block.segments > 0);
                });
            }
            stepped += block.ticks;
            progress.report(FitProgress::Ticks {
                stepped,
                fit: 1,
                of: 1,
            });
            Ok(())
        })?;
        Ok(makings)
    }
}
