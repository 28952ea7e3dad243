//! Decides which rows an estimator is fitted on: the regressors of its runs, paired with the truths that belong to them.

use std::collections::BTreeMap;
use std::ops::Range;

use super::between::Between;
use super::candidates::Validity;
use super::report::Dropped;
use crate::channel::is_leapt;
use crate::compile::{Plan, Rows, TrainingLimits, TruthLink};
use crate::engine::{Engine, Pairing, When, naming_one};
use crate::node::{Role, Runs, TrainingError};
use crate::recording::Event;
use crate::time::{Duration, Instant};

/// A part of the ticks of a recording, by their number.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Share {
    pub(super) within: Range<u64>,
    pub(super) without: Vec<Range<u64>>,
}

impl Share {
    pub(super) fn all() -> Self {
        Self {
            within: 0..u64::MAX,
            without: Vec::new(),
        }
    }

    pub(super) fn none() -> Self {
        Self {
            within: 0..0,
            without: Vec::new(),
        }
    }

    fn contains(&self, tick: u64) -> bool {
        self.within.contains(&tick) && !self.without.iter().any(|range| range.contains(&tick))
    }

    /// The share cut into so many parts that hold about the same number of these ticks, which are in order. A part may reach across
    /// ticks that are not in the share.
    pub(super) fn cut(&self, ticks: &[u64], parts: usize) -> Vec<Range<u64>> {
        let own = ticks.iter().copied().filter(|&tick| self.contains(tick));
        let own: Vec<u64> = own.collect();
        let edge = |nth: usize| match own.get(own.len() * nth / parts) {
            _ if nth == 0 => self.within.start,
            Some(&tick) if nth < parts => tick,
            _ => self.within.end,
        };
        (0..parts).map(|nth| edge(nth)..edge(nth + 1)).collect()
    }
}

/// The runs of a gather, as several estimators may share them.
pub(super) struct Tap {
    gather: usize,
    /// The gathers of which one must be fresh for the node to run; none where it runs at every tick.
    triggers: Vec<usize>,
    pairing: Pairing,
    width: usize,
    kept: Vec<f64>,
    last_kept: Option<u64>,
    /// Whether there was any run, and one in this tick.
    pub(super) ran: bool,
    runs: bool,
}

/// The examples of one estimator.
pub(super) struct Trainee {
    /// Its position in the plan.
    pub(super) node: usize,
    pub(super) link: TruthLink,
    limits: TrainingLimits,
    pub(super) taps: Vec<usize>,
    pub(super) validity: Validity,
    pub(super) dropped: Dropped,
    /// When each truth was measured, and what it was.
    truths: Vec<(Instant, f64)>,
    /// For each example and tap, the number of the kept row.
    rows: Vec<u32>,
    /// The runs between truths, of a trainer that asks for them.
    between: Option<Between>,
    kept_between: KeptBetween,
    /// The first example of each segment after the first.
    breaks: Vec<usize>,
    segment_pending: bool,
}

/// Runs between truths that are kept.
#[derive(Default)]
struct KeptBetween {
    /// The example that each comes before, and what it predicts.
    runs: Vec<(usize, Instant)>,
    rows: Vec<f64>,
}

/// Collects the examples of several estimators while an engine is driven.
pub(super) struct Collector {
    pub(super) taps: Vec<Tap>,
    pub(super) trainees: Vec<Trainee>,
    memory: usize,
    bytes: usize,
    /// Set once runs between truths no longer fit beside the rows: there are none from then on.
    without_runs: bool,
    /// Set once rows no longer fit: from then on they are only counted.
    pub(super) overflowed: bool,
    tick: u64,
    /// The measured channels that have had no value yet: the slots.
    pub(super) silent: Vec<usize>,
}

/// Takes the examples of one estimator, in order.
pub(super) trait Sink {
    fn row<'a>(&mut self, at: Instant, parts: impl Iterator<Item = &'a [f64]> + Clone, truth: f64);
    fn run(&mut self, of: Instant, row: &[f64]);
    fn segment(&mut self);
}

impl Collector {
    /// A collector for the estimators at these positions of the plan.
    pub(super) fn new(plan: &Plan, nodes: &[usize], memory: usize) -> Self {
        let mut taps = Vec::new();
        let mut known = BTreeMap::new();
        let mut trainees = Vec::new();
        for &node in nodes {
            let Rows {
                fit,
                gathers,
                triggers,
            } = plan.nodes[node]
                .rows()
                .expect("only what needs a fit is trained");
            let shared = |&gather: &usize| {
                let key = (gather, triggers, fit.truth.ahead, fit.truth.limit);
                *known.entry(key).or_insert_with(|| {
                    let width = plan.gathers[gather].entries.len();
                    let pairing = Pairing::new(&fit.truth, width);
                    taps.push(Tap {
                        gather,
                        triggers: triggers.to_vec(),
                        pairing,
                        width,
                        kept: Vec::new(),
                        last_kept: None,
                        ran: false,
                        runs: false,
                    });
                    taps.len() - 1
                })
            };
            let wanted = match plan.nodes[node].spec.role() {
                Role::Estimator(estimator) => estimator.regressors().runs,
                Role::Feature(_) | Role::Combiner(_) => Runs::OfTruths,
            };
            let between = match wanted {
                Runs::OfTruths => None,
                Runs::BetweenTruths { every } => Some(Between::new(every, fit.regressors.len())),
            };
            trainees.push(Trainee {
                node,
                link: fit.truth,
                limits: fit.training,
                between,
                kept_between: KeptBetween::default(),
                taps: gathers.iter().map(shared).collect(),
                validity: Validity::new(fit.regressors.len()),
                dropped: Dropped::default(),
                truths: Vec::new(),
                rows: Vec::new(),
                breaks: Vec::new(),
                segment_pending: false,
            });
        }
        Self {
            taps,
            trainees,
            memory,
            bytes: 0,
            without_runs: false,
            overflowed: false,
            tick: 0,
            silent: measured(plan),
        }
    }

    /// Begins another pass over the data, whose examples come after those of the passes before.
    pub(super) fn rewind(&mut self) {
        self.segment();
        self.tick = 0;
    }

    /// Looks at what a tick did. With `live`, examples go there as they come; otherwise they are kept while they fit.
    pub(super) fn look<S: Sink>(
        &mut self,
        engine: &Engine,
        event: Event,
        share: &Share,
        mut live: Option<&mut [S]>,
    ) {
        let Event::Row(now) = event else {
            self.segment();
            return;
        };
        self.silent.retain(|&slot| engine.value(slot).is_nan());
        for tap in &mut self.taps {
            let fresh = |&gather: &usize| engine.gathered(gather).1;
            tap.runs = tap.triggers.is_empty() || tap.triggers.iter().any(fresh);
            if tap.runs {
                tap.pairing.run(now, [engine.gathered(tap.gather).0]);
                tap.ran = true;
            }
        }
        let tick = self.tick;
        self.tick += 1;
        if share.contains(tick) {
            self.run(engine, now);
        }
        for index in 0..self.trainees.len() {
            let slot = self.trainees[index].link.slot;
            let truth = engine.value(slot);
            if truth.is_nan() || !share.contains(tick) {
                let leapt = is_leapt(truth) && share.contains(tick);
                self.trainees[index].dropped.leapt += u64::from(leapt);
                continue;
            }
            let Self { taps, trainees, .. } = self;
            let trainee = &mut trainees[index];
            if trainee
                .taps
                .iter()
                .any(|&tap| taps[tap].pairing.truth(now).is_none())
            {
                trainee.dropped.without_run += 1;
            } else if !trainee.limits.admits(truth) {
                trainee.dropped.outside_limits += 1;
            } else if let Some(live) = &mut live {
                naming_one(engine.plan(), trainee.node, When::Fit, || {
                    if std::mem::take(&mut trainee.segment_pending) {
                        live[index].segment();
                    }
                    if let Some(between) = &mut trainee.between {
                        between.truth(now, |of, row| live[index].run(of, row));
                    }
                    let parts = trainee.taps.iter().map(|&tap| taps[tap].pairing.last());
                    live[index].row(now, parts, truth);
                });
            } else {
                self.keep(index, now, truth);
            }
        }
    }

    /// Takes the runs of this tick for the trainers that ask for those between truths.
    fn run(&mut self, engine: &Engine, now: Instant) {
        let taps = &self.taps;
        for trainee in &mut self.trainees {
            let Some(between) = &mut trainee.between else {
                continue;
            };
            if trainee.taps.iter().all(|&tap| taps[tap].runs) {
                let parts = trainee.taps.iter();
                let parts = parts.map(|&tap| engine.gathered(taps[tap].gather).0);
                between.run(now + trainee.link.ahead, parts);
            }
        }
    }

    /// Whether a measured channel has had no value; unknown of one that is read at a lag.
    pub(super) fn is_silent(&self, slot: usize) -> bool {
        self.silent.contains(&slot)
    }

    /// Whether an estimator ever ran.
    pub(super) fn ran(&self, trainee: &Trainee) -> bool {
        trainee.taps.iter().any(|&tap| self.taps[tap].ran)
    }

    /// The regressors that an estimator waits for, and the measured channels behind them without a value, where it never ran.
    pub(super) fn waited_for(&self, plan: &Plan, trainee: &Trainee) -> Option<TrainingError> {
        if self.ran(trainee) {
            return None;
        }
        let rows = plan.nodes[trainee.node].rows()?;
        let entries = rows
            .triggers
            .iter()
            .flat_map(|&gather| &plan.gathers[gather].entries);
        let waits = &rows.fit.regressors[..entries.clone().count()];
        let spans = entries.map(|entry| plan.channels[entry.slot].channel.span);
        let mut silent: Vec<String> = Vec::new();
        for sensor in waits.iter().flat_map(|regressor| &regressor.sensors) {
            let is_silent = |&slot: &usize| plan.channels[slot].name == *sensor;
            if self.silent.iter().any(is_silent) && !silent.contains(sensor) {
                silent.push(sensor.clone());
            }
        }
        Some(TrainingError::NeverRan {
            regressors: waits.iter().map(|waited| waited.name.clone()).collect(),
            silent,
            span: spans.min().unwrap_or(Duration::ZERO),
        })
    }

    /// The examples kept of one estimator, in order.
    pub(super) fn replay(&self, index: usize, sink: &mut impl Sink) {
        let trainee = &self.trainees[index];
        let mut breaks = trainee.breaks.iter().peekable();
        let width = trainee.taps.len();
        let KeptBetween { runs, rows } = &trainee.kept_between;
        let of_run = rows.len() / runs.len().max(1);
        let mut between = runs.iter().zip(0..).peekable();
        for (example, &(at, truth)) in trainee.truths.iter().enumerate() {
            while breaks.next_if(|&&at| at <= example).is_some() {
                sink.segment();
            }
            while let Some((&(_, of), nth)) = between.next_if(|((before, _), _)| *before <= example)
            {
                sink.run(of, &rows[nth * of_run..(nth + 1) * of_run]);
            }
            let rows = &trainee.rows[example * width..(example + 1) * width];
            let parts = trainee.taps.iter().zip(rows).map(|(&tap, &row)| {
                let tap = &self.taps[tap];
                &tap.kept[row as usize * tap.width..(row as usize + 1) * tap.width]
            });
            sink.row(at, parts, truth);
        }
    }

    fn keep(&mut self, index: usize, at: Instant, truth: f64) {
        let Self { taps, trainees, .. } = self;
        let trainee = &mut trainees[index];
        trainee
            .validity
            .count(trainee.taps.iter().map(|&tap| taps[tap].pairing.last()));
        if self.overflowed {
            return;
        }
        if std::mem::take(&mut trainee.segment_pending) {
            trainee.breaks.push(trainee.truths.len());
        }
        if let Some(between) = &mut trainee.between {
            let (kept, example) = (&mut trainee.kept_between, trainee.truths.len());
            let without = self.without_runs;
            between.truth(at, |of, row| {
                if !without {
                    kept.runs.push((example, of));
                    kept.rows.extend_from_slice(row);
                    self.bytes += size_of::<(usize, Instant)>() + size_of_val(row);
                }
            });
        }
        trainee.truths.push((at, truth));
        self.bytes += size_of::<(Instant, f64)>();
        for &tap in &trainee.taps {
            let tap = &mut taps[tap];
            let number = tap.pairing.last_number();
            if tap.last_kept != Some(number) {
                tap.last_kept = Some(number);
                tap.kept.extend_from_slice(tap.pairing.last());
                self.bytes += tap.width * size_of::<f64>();
            }
            let row = u32::try_from(tap.kept.len() / tap.width.max(1) - usize::from(tap.width > 0))
                .unwrap_or(u32::MAX);
            trainee.rows.push(row);
            self.bytes += size_of::<u32>();
        }
        if self.bytes > self.memory {
            self.forget_runs();
        }
        if self.bytes > self.memory {
            self.overflow();
        }
    }

    /// Lets go of the runs between truths, which are not to take the room of rows.
    fn forget_runs(&mut self) {
        self.without_runs = true;
        for trainee in &mut self.trainees {
            let KeptBetween { runs, rows } = std::mem::take(&mut trainee.kept_between);
            self.bytes -= size_of_val(&runs[..]) + size_of_val(&rows[..]);
        }
    }

    /// Lets go of what was kept: there is more than the stated memory holds.
    fn overflow(&mut self) {
        self.overflowed = true;
        for tap in &mut self.taps {
            tap.kept = Vec::new();
        }
        for trainee in &mut self.trainees {
            trainee.truths = Vec::new();
            trainee.rows = Vec::new();
        }
    }

    fn segment(&mut self) {
        for tap in &mut self.taps {
            tap.pairing.clear();
        }
        for trainee in &mut self.trainees {
            trainee.segment_pending = true;
            if let Some(between) = &mut trainee.between {
                between.segment();
            }
        }
    }
}

/// The slots of the measured channels as they are read now.
fn measured(plan: &Plan) -> Vec<usize> {
    let channels = plan.channels.iter().enumerate();
    channels
        .filter(|(_, channel)| channel.node.is_none() && channel.history.is_none())
        .map(|(slot, _)| slot)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_left_of_a_share_is_cut_into_parts_of_the_same_size() {
        let ticks: Vec<u64> = (0..600).collect();
        let all = Share::all();
        assert_eq!(all.cut(&ticks, 3), [0..200, 200..400, 400..u64::MAX]);
        let mut without = all.clone();
        without.without.push(200..400);
        // The part in the middle reaches across what is not there.
        let parts = without.cut(&ticks, 3);
        assert_eq!(parts, [0..133, 133..466, 466..u64::MAX]);
        without.without.push(parts[1].clone());
        assert_eq!(without.cut(&ticks, 2), [0..466, 466..u64::MAX]);
        let count = |part: &Range<u64>| {
            let own = ticks.iter().filter(|&&tick| without.contains(tick));
            own.filter(|tick| part.contains(tick)).count()
        };
        let cut = without.cut(&ticks, 4);
        assert!(
            cut.iter().all(|part| (66..=67).contains(&count(part))),
            "{cut:?}"
        );
        assert_eq!(all.cut(&ticks[..2], 3).len(), 3, "some of them are empty");
        assert_eq!(all.cut(&[], 2), [0..u64::MAX, u64::MAX..u64::MAX]);
    }

    #[test]
    fn ticks_that_are_counted_decide_where_a_share_is_cut() {
        let ticks = [3, 4, 5, 6, 900, 901];
        let parts = Share::all().cut(&ticks, 3);
        assert_eq!(parts, [0..5, 5..900, 900..u64::MAX]);
    }
}
