//! The facts about a measured channel: gaps, leaps, rejected samples, noise, samples outside those of the fit, and what a `health`
//! node found.

use std::collections::BTreeMap;

use athermal_core::compile::{Plan, PlannedRole, SourceChannel};
use athermal_core::engine::{Engine, SampleRange};
use athermal_core::node::{Duty, KindFacts};
use athermal_numerics::robust_deviation;
use serde::Serialize;

use super::figure;
use crate::diagnosis::leap::{Finder, Leaps, finders};
use crate::figures::{apart_by, counted, time};
use athermal_core::compile::origins::{health_reasons, of_truths};
use athermal_run::live::monitor::standstill;

/// The facts about a measured channel.
#[derive(Debug, Clone, Default, Serialize)]
pub struct SensorFacts {
    /// The channel: `temperature.plate1`.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// Samples taken.
    pub samples: u64,
    /// Samples rejected, as infinite or out of range.
    pub rejected: u64,
    /// Those of them that were infinite.
    pub infinite: u64,
    /// The longest time in s between two samples.
    pub longest_gap_s: f64,
    /// The mean time in s between two samples.
    pub mean_gap_s: f64,
    /// The time in s after which a sample is too old to count.
    pub max_age_s: Option<f64>,
    /// Gaps longer than that, or, where there is none, than five times the mean.
    pub gaps: u64,
    /// The most samples in a row with the very same value.
    pub most_unchanged: u64,
    /// Where it leaps, of a temperature and of what a truth is made of.
    pub leaps: Option<Leaps>,
    /// The standard deviation of the noise of single samples: the robust deviation of second differences over √6, which
    /// a steady change leaves alone, as do steps if they are rare. None where that is below what a sample resolves.
    pub noise: Option<f64>,
    /// Lowest and highest sample.
    pub range: Option<(f64, f64)>,
    /// The same in the data of the fit, where these reach far beyond them; not of what a truth is made of, whose drift is what counts.
    pub exceeds: Option<(f64, f64)>,
    /// Ticks by what a `health` node of the graph found of the channel; empty where none watches it.
    pub health: BTreeMap<&'static str, u64>,
    #[serde(skip)]
    looking: Looking,
}

/// What is needed to go on.
#[derive(Debug, Clone, Default)]
struct Looking {
    last: Option<(f64, f64)>,
    /// The difference between the last two samples.
    difference: Option<f64>,
    stillness: standstill::Finder,
    /// Whether it stands still for much longer than ever else.
    is_stuck: bool,
    finder: Option<Finder>,
    /// Whether a truth is made of it.
    wanders: bool,
    /// Absolute second differences.
    bends: Vec<f64>,
    lengths: Vec<f64>,
    /// The channel's range in the graph.
    limits: (f64, f64),
    /// Whether data may lack it, such as what a machine reports as applied, which may rest.
    optional: bool,
    /// The slot of the reason that the node gives which watches over it, and what it says.
    reason: Option<(usize, KindFacts)>,
}

/// One for each measured channel.
pub(super) fn sensors(plan: &Plan) -> Vec<SensorFacts> {
    let reasons = health_reasons(plan);
    let of_truths = of_truths(plan);
    let facts = |(slot, (source, finder)): (usize, (&SourceChannel, Option<Finder>))| {
        let channel = &plan.channels[slot].channel;
        SensorFacts {
            name: source.name.clone(),
            unit: channel.unit.to_string(),
            max_age_s: channel.max_age.map(|age| age.secs()),
            looking: Looking {
                limits: source.range,
                optional: source.rests(),
                reason: reasons.get(&slot).and_then(|&at| {
                    let node = plan.channels[at].node?;
                    Some((at, (plan.nodes[node].kind.facts)()))
                }),
                finder: finder.filter(|_| source.planned.is_none() && !source.is_instant),
                wanders: of_truths[slot],
                ..Looking::default()
            },
            ..SensorFacts::default()
        }
    };
    let sources = plan.sources.iter().zip(finders(plan)).enumerate();
    sources.map(facts).collect()
}

/// Has every node that watches over sensors or compares them give its reasons, and every correction what holds it back, whether or not
/// the graph reads it.
pub(super) fn ask_for_reasons(plan: &mut Plan) {
    for node in &mut plan.nodes {
        if matches!(
            node.kind.duty(),
            Duty::Watch | Duty::Compare | Duty::Correct
        ) && let PlannedRole::Feature { wanted, .. } = &mut node.role
        {
            wanted.fill(true);
        }
    }
}

impl SensorFacts {
    pub(super) fn look(&mut self, now_s: f64, value: f64, engine: &Engine) {
        let reason = self.looking.reason;
        if let Some(reason) = reason.and_then(|(slot, of)| of.reason(engine.value(slot))) {
            *self.health.entry(reason).or_default() += 1;
        }
        let (low, high) = self.looking.limits;
        if value.is_nan() {
            return;
        }
        if !(low..=high).contains(&value) || value.is_infinite() {
            self.rejected += 1;
            self.infinite += u64::from(value.is_infinite());
            return;
        }
        let looking = &mut self.looking;
        if let Some(finder) = &mut looking.finder {
            finder.push(now_s, value);
        }
        if let Some((last_s, last)) = looking.last {
            let gap = now_s - last_s;
            looking.lengths.push(gap);
            self.longest_gap_s = self.longest_gap_s.max(gap);
            self.mean_gap_s += (gap - self.mean_gap_s) / looking.lengths.len() as f64;
            let difference = value - last;
            if let Some(before) = looking.difference.replace(difference) {
                looking.bends.push((difference - before).abs());
            }
        }
        looking.stillness.push(now_s, value);
        self.samples += 1;
        let (lowest, highest) = self.range.unwrap_or((value, value));
        self.range = Some((lowest.min(value), highest.max(value)));
        looking.last = Some((now_s, value));
    }

    /// Another segment begins.
    pub(super) fn segment(&mut self) {
        (self.looking.last, self.looking.difference) = (None, None);
        self.looking.stillness.interrupt();
        if let Some(finder) = &mut self.looking.finder {
            finder.interrupt();
        }
    }

    /// Counts what can be counted only once all is known; `fit` is where samples lay in the fit.
    pub(super) fn finish(&mut self, fit: &[SampleRange]) {
        let (longest, is_stuck) = std::mem::take(&mut self.looking.stillness).longest();
        (self.most_unchanged, self.looking.is_stuck) = (longest.samples, is_stuck);
        self.leaps = self.looking.finder.take().and_then(|of| of.found());
        let usual = fit.iter().find(|usual| usual.channel == self.name);
        let usual = usual.filter(|_| !self.looking.wanders);
        let exceeded = usual
            .zip(self.range)
            .filter(|(usual, (low, high))| usual.is_far_from(*low, *high));
        self.exceeds = exceeded.map(|(usual, _)| (usual.lowest, usual.highest));
        let lengths = std::mem::take(&mut self.looking.lengths);
        let limit = self.max_age_s.unwrap_or(5.0 * self.mean_gap_s);
        self.gaps = lengths.iter().filter(|gap| **gap > limit).count() as u64;
        let mut bends = std::mem::take(&mut self.looking.bends);
        let bend = robust_deviation(&mut bends).filter(|bend| *bend > 0.0);
        self.noise = bend.map(|bend| bend / 6.0_f64.sqrt());
    }

    /// What somebody should look at.
    #[must_use]
    pub fn remarks(&self) -> Vec<String> {
        let mut remarks = Vec::new();
        if self.samples == 0 && !self.looking.optional {
            remarks.push("no sample".to_owned());
        }
        let beyond = self.rejected - self.infinite;
        for (count, what) in [(beyond, "out of range"), (self.infinite, "infinite")] {
            if count > 0 {
                remarks.push(format!("{count} {what}"));
            }
        }
        if self.gaps > 0 {
            remarks.push(format!(
                "{}, the longest {}",
                counted(self.gaps, "gap"),
                time(self.longest_gap_s)
            ));
        }
        if !self.looking.optional && self.looking.is_stuck {
            remarks.push(format!("the same value {} times", self.most_unchanged));
        }
        remarks.extend(self.leaps.iter().map(Leaps::to_string));
        if let (Some((low, high)), Some((fit_low, fit_high))) = (self.range, self.exceeds) {
            let all = [low, high, fit_low, fit_high];
            let [low, high, fit_low, fit_high] = apart_by(all, |value| figure(Some(value)));
            remarks.push(format!(
                "from {low} to {high}, far outside of what the fit saw, {fit_low} to {fit_high}"
            ));
        }
        let faults = self
            .health
            .iter()
            .filter(|(reason, _)| **reason != "healthy");
        remarks.extend(faults.map(|(reason, ticks)| format!("{reason} at {ticks} ticks")));
        remarks
    }
}
