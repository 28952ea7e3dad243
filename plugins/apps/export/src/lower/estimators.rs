//! Estimators: whatever was fitted to a linear form, with how far it heeds that a row is outside of its fit.

use athermal_core::compile::{Outside, PlannedFit, PlannedLearning, PlannedNode, PlannedRole};
use athermal_core::engine::Engine;
use athermal_core::node::{Predictor, between_lessons, number, numbers};
use athermal_core::time::Duration;
use athermal_numerics::Rls;
use serde::Deserialize;
use serde::de::IgnoredAny;

use super::{Lowering, Options, Refused, SPARE, first, refuse, samples, unfitted, unknown, ways};
use crate::form::{Entry, Field, Record};

/// How many integers a learner has before its waiting truths, and over how many windows it is compared with its fit.
pub(crate) const KNOWN: usize = 13;
pub(crate) const WINDOWS: usize = 20;

/// How far a row is outside, as models hold it.
#[derive(Deserialize)]
struct Novelty {
    edge: f64,
    means: Vec<f64>,
    scales: Vec<f64>,
    directions: Vec<f64>,
}

/// The variance about predictions, as models hold it.
#[derive(Deserialize)]
struct Variance {
    noise: f64,
    rows: u64,
    centre: Vec<f64>,
    root: Vec<f64>,
}

/// What can go on learning, as models hold it.
#[derive(Deserialize)]
struct Online {
    frame: Frame,
    recursion: Recursion,
    range: Range,
}

#[derive(Deserialize)]
struct Frame {
    #[serde(with = "numbers")]
    means: Vec<f64>,
    #[serde(with = "numbers")]
    scales: Vec<f64>,
    #[serde(with = "number")]
    level: f64,
}

#[derive(Deserialize)]
#[serde(rename_all = "snake_case")]
enum Recursion {
    Sgd(IgnoredAny),
    Rls {
        rls: Box<Rls>,
        #[serde(with = "number")]
        little: f64,
    },
}

#[derive(Default, Deserialize)]
struct Range {
    #[serde(with = "numbers")]
    lowest: Vec<f64>,
    #[serde(with = "numbers")]
    highest: Vec<f64>,
}

/// How a recursion goes on.
struct Start {
    frame: Frame,
    rls: Rls,
    little: f64,
    range: Range,
}

/// What past rows of learners have in common that share them: the gather that lets them run and the one that stops them, what they read, and
/// how long rows wait.
#[derive(PartialEq)]
pub(super) struct Rows {
    trigger: Option<usize>,
    freeze: Option<usize>,
    entries: Vec<Entry>,
    waits: [i64; 2],
}

/// A prediction as a linear form, or as its only regressor.
#[derive(Default)]
struct Fit {
    constant: f64,
    coefficients: Vec<f64>,
    same: bool,
    centre: f64,
    novelty: Option<Record>,
    variance: Option<Record>,
    spread: Option<Record>,
    start: Option<Start>,
}

impl Lowering<'_> {
    pub(super) fn estimator(
        &mut self,
        engine: &Engine,
        node: &PlannedNode,
        options: &Options,
    ) -> Result<Record, Refused> {
        let PlannedRole::Estimator {
            fit,
            gathers,
            every_tick,
            learning,
            std_dev,
            novelty,
            outside,
        } = &node.role
        else {
            return refuse("it is no estimator", "report this");
        };
        if let Some(way) = ways::around_estimator(node) {
            let why = format!("what `{}` is fitted to is no linear form", node.kind.name);
            return refuse(why, way);
        }
        let names = || fit.regressors.iter().map(|of| &of.name);
        let heeded = novelty.is_some() || *outside != Outside::Pass;
        let predictor = engine.fitted().get(&node.instance());
        let found = match predictor {
            Some(predictor) => {
                fitted(node, &**predictor, heeded).map(|fit| (fit, predictor.uses().to_vec()))
            }
            None => fixed(node, names().cloned().collect()),
        };
        let learning = learning.filter(|_| !options.frozen);
        let learns = |fit: &(Fit, Vec<String>)| fit.0.start.is_some();
        // Where its fit has no place either, something else has to take its own.
        if learning.is_some() && predictor.is_some() && found.as_ref().is_ok_and(|fit| !learns(fit))
        {
            let why = format!("how `{}` goes on learning has no place", node.kind.name);
            let way = "put `rls` in its place, or `--frozen` exports it as it was fitted";
            self.also.push((why, way.to_owned()));
        }
        let (mut found, used) = found?;
        if std_dev.is_some()
            && found.variance.is_none()
            && found.spread.is_none()
            && predictor.is_some_and(|of| !of.std_dev(&vec![0.0; used.len()]).is_nan())
        {
            self.unread(node, "std_dev");
        }
        let mut all = Vec::new();
        for &gather in gathers {
            all.extend_from_slice(&self.gathers[gather].entries);
        }
        let mut entries: Vec<Entry> = Vec::new();
        for name in &used {
            match names().position(|known| known == name) {
                Some(place) => entries.push(all[place]),
                None => return unknown(name),
            }
        }
        let directions = found
            .novelty
            .as_ref()
            .map_or(0, |of| of.place_of("directions"));
        self.scratch(3 * used.len() + 2 + directions);
        let trigger = gathers.first().copied().filter(|_| !every_tick);
        let learner = learning.zip(found.start.take()).map(|(learning, start)| {
            let record = Record::new("learner", node.instance());
            self.learner(record, trigger, fit, learning, &entries, &start)
        });
        let is_asked = std_dev.is_some();
        found.variance = found.variance.filter(|_| is_asked);
        found.spread = found.spread.filter(|_| is_asked || learner.is_some());
        let outside = match outside {
            Outside::Pass => 0,
            Outside::Shrink => 1,
            Outside::Absent => 2,
        };
        Ok(Record::new("linear", node.instance())
            .maybe("trigger", trigger)
            .int("slot", first(&node.slots))
            .maybe("novelty_slot", *novelty)
            .maybe("std_dev_slot", *std_dev)
            .int("width", used.len())
            .int("same", usize::from(found.same))
            .with("entries", Field::Entries(entries))
            .real("constant", found.constant)
            .with("coefficients", Field::Reals(found.coefficients, used))
            .with("novelty", Field::Struct(found.novelty.map(Box::new)))
            .with("variance", Field::Struct(found.variance.map(Box::new)))
            .with("spread", Field::Struct(found.spread.map(Box::new)))
            .with("learner", Field::Struct(learner.map(Box::new)))
            .int("outside", outside)
            .real("centre", found.centre))
    }

    fn learner(
        &mut self,
        record: Record,
        trigger: Option<usize>,
        fit: &PlannedFit,
        PlannedLearning { limits, freeze }: PlannedLearning,
        entries: &[Entry],
        start: &Start,
    ) -> Record {
        let Start {
            frame,
            rls,
            little,
            range,
        } = start;
        let knows = rls.fit();
        let (truth, width) = (&fit.truth, entries.len());
        let period = trigger.map_or(self.periods.tick, |of| {
            self.periods.of_gather(self.plan, of)
        });
        let runs = samples(truth.ahead + truth.embargo(), period, SPARE);
        let waiting = samples(truth.embargo(), self.periods.slots[truth.slot], SPARE);
        let rows = Rows {
            trigger,
            freeze,
            entries: entries.to_vec(),
            waits: [truth.ahead.as_ns(), truth.embargo().as_ns()],
        };
        let known = self.rows.iter().find(|(of, _)| *of == rows);
        let known = known.map(|(_, places)| *places);
        let [run_ints, run_reals] = known.unwrap_or_else(|| {
            let ints = self.ints(runs.saturating_mul(2).saturating_add(3));
            let places = [ints, self.reals(runs.saturating_mul(width))];
            self.rows.push((rows, places));
            places
        });
        let ends = |nth: usize| {
            let end = |of: &[f64], none: f64| of.get(nth).copied().unwrap_or(none);
            let lowest = end(&range.lowest, f64::NEG_INFINITY);
            let highest = end(&range.highest, f64::INFINITY);
            let beyond = limits.margin * (highest - lowest);
            let unless_none = |of: f64, none: f64| if of.is_nan() { none } else { of };
            match range.lowest.is_empty() {
                true => (lowest, highest),
                // A range without width that is widened without end has none in it.
                false => (
                    unless_none(lowest - beyond, f64::INFINITY),
                    unless_none(highest + beyond, f64::NEG_INFINITY),
                ),
            }
        };
        let (lowest, highest) = (0..width).map(ends).unzip();
        let longest = Duration::from_ns(i64::MAX);
        let memory = Duration::from_secs_f64(knows.memory_s).unwrap_or(longest);
        let order = width + 1;
        let cells = order * (order + 1) / 2;
        let reals = 1 + 2 * cells + 4 * order + 2 + 2 * WINDOWS + waiting;
        let time = |of: Duration| Field::Int(of.as_ns());
        record
            .maybe("freeze", freeze)
            .int("truth", truth.slot)
            .with("ahead", time(truth.ahead))
            .with("limit", time(truth.limit))
            .with("embargo", time(truth.embargo()))
            .int("runs", runs)
            .int("waiting", waiting)
            .int("run_ints", run_ints)
            .int("run_reals", run_reals)
            .real("below", fit.training.below)
            .real("above", fit.training.above)
            .reals("lowest", lowest)
            .reals("highest", highest)
            .real("outliers", limits.outliers)
            .with("window", time(truth.span))
            .with("between", time(between_lessons(truth.span)))
            .with("silence", time(memory))
            .real("memory", knows.memory_s)
            .real("share", knows.share)
            .real("little", *little)
            .real("rows", knows.rows)
            .real("squares", rls.learned().squares)
            .real("level", frame.level)
            .reals("start", knows.coefficients.clone())
            .reals("information", knows.information.clone())
            .int("ints", self.ints(KNOWN + 3 * waiting))
            .int("reals", self.reals(reals))
    }
}

/// What needs no fit.
fn fixed(node: &PlannedNode, regressors: Vec<String>) -> Result<(Fit, Vec<String>), Refused> {
    let nothing = Fit::default();
    match (node.kind.package, node.kind.name) {
        ("athermal-estimators", "zero") => Ok((nothing, Vec::new())),
        ("athermal-estimators", "persistence") => {
            let same = Fit {
                same: true,
                coefficients: vec![1.0],
                ..nothing
            };
            Ok((same, regressors))
        }
        _ => unfitted(),
    }
}

fn fitted(node: &PlannedNode, predictor: &dyn Predictor, heeded: bool) -> Result<Fit, Refused> {
    let form = predictor
        .linear()
        .filter(|form| form.coefficients.len() == predictor.uses().len());
    let Some(form) = form.filter(|_| !predictor.takes_absent()) else {
        return refuse(
            format!("what `{}` was fitted to is no linear form", node.kind.name),
            "use `linear`, `ar` or `arx`, or run the graph with `athermal serve`",
        );
    };
    let written = serde_json::to_value(predictor).unwrap_or_default();
    let novelty = match &written["novelty"] {
        _ if !heeded => None,
        serde_json::Value::Null => {
            if !predictor
                .novelty(&vec![0.0; form.coefficients.len()])
                .is_nan()
            {
                return refuse(
                    "how far it heeds that it is outside of its fit is not known",
                    "set `outside = \"pass\"`",
                );
            }
            None
        }
        novelty => match serde_json::from_value(novelty.clone()) {
            Ok(novelty) => Some(lowered(&novelty, node)),
            Err(error) => {
                return refuse(
                    format!("its novelty cannot be read: {error}"),
                    "set `outside = \"pass\"`",
                );
            }
        },
    };
    let variance = serde_json::from_value(written["variance"].clone()).ok();
    let start = serde_json::from_value(written).ok().and_then(started);
    let spread = start.as_ref().map(|start| {
        Record::new("spread", node.instance())
            .real("variance", start.rls.variance())
            .reals("mean", start.frame.means.clone())
            .reals("scale", start.frame.scales.clone())
            .reals("root", start.rls.root().to_vec())
    });
    Ok(Fit {
        constant: form.constant,
        coefficients: form.coefficients.to_vec(),
        centre: predictor.centre(),
        novelty,
        variance: variance.map(|of| of_variance(of, form.coefficients.len(), node)),
        spread,
        start,
        ..Fit::default()
    })
}

/// What goes on by least squares.
fn started(online: Online) -> Option<Start> {
    let Recursion::Rls { rls, little } = online.recursion else {
        return None;
    };
    Some(Start {
        frame: online.frame,
        rls: *rls,
        little,
        range: online.range,
    })
}

fn of_variance(of: Variance, width: usize, node: &PlannedNode) -> Record {
    let (least, centre) = match of.centre.is_empty() {
        true => (0.0, vec![0.0; width]),
        false => (1.0 / of.rows as f64, of.centre),
    };
    Record::new("variance", node.instance())
        .real("noise", of.noise)
        .real("least", least)
        .reals("centre", centre)
        .reals("root", of.root)
}

/// By regressor what it contributes, so that one pass over a row is enough.
fn lowered(novelty: &Novelty, node: &PlannedNode) -> Record {
    let width = novelty.means.len().max(1);
    let directions = novelty.directions.len() / width;
    let along = (0..width)
        .flat_map(|column| (0..directions).map(move |nth| (column, nth)))
        .map(|(column, nth)| novelty.directions[nth * width + column]);
    Record::new("novelty", node.instance())
        .int("directions", directions)
        .real("edge", novelty.edge)
        .reals("mean", novelty.means.clone())
        .reals(
            "inverse",
            novelty.scales.iter().map(|scale| 1.0 / scale).collect(),
        )
        .reals("along", along.collect())
}
