//! Decides what is written down while a model is stepped over a recording; not what it is worth, nor how truths are paired with
//! predictions.

use std::ops::Range;
use std::sync::Arc;

use athermal_core::compile::{Entry, Plan, PlannedRole};
use athermal_core::engine::Engine;
use athermal_core::node::Duty;
use athermal_core::quantity::Quantity;
use athermal_core::time::{Duration, Instant};
use athermal_core::unit::Unit;
use athermal_run::model::{Model, Period};
use athermal_run::recording::{Event, Recording, pass};
use athermal_run::score::{NoModel, PredictionTrace, Trace, TruthTrace};
use serde::{Serialize, Serializer};

use super::excursions::{NoveltyWatch, ask_for_novelty};
use super::sensors::{SensorFacts, ask_for_reasons, sensors};
use super::track::{Track, Unjudged, parameter, places, reads_drift};
use super::{ReportError, Series};

/// What happened over time.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Course {
    /// Ticks stepped.
    pub ticks: u64,
    /// Rows refused because their time was not after the one before.
    pub refused: u64,
    /// Samples rejected as infinite or out of range, by measured channel.
    pub rejected: Vec<(String, u64)>,
    /// First and last instant in s; segments follow each other an hour apart.
    #[serde(rename = "period", serialize_with = "as_period")]
    pub period_s: Option<(f64, f64)>,
    /// Every predicted truth.
    pub axes: Vec<Axis>,
    /// Every measured channel.
    pub sensors: Vec<SensorFacts>,
}

/// A truth and its predictions.
#[derive(Debug, Clone, Serialize)]
pub struct Axis {
    /// Its channel: `Z1`, or `drift.Z1` where another truth is called `Z1` too.
    pub name: String,
    /// The whole name of its channel: `drift.Z1`.
    #[serde(skip)]
    pub(super) truth_name: String,
    /// Its slot.
    #[serde(skip)]
    pub(super) slot: usize,
    /// Its unit.
    pub unit: String,
    /// The unit of a difference of two of its values, such as an error.
    pub error_unit: String,
    /// What no model predicts of it.
    #[serde(skip)]
    pub(super) no_model: NoModel,
    /// The measured truth.
    pub truth: Series,
    /// Every prediction of it, paired as in scoring: one value per truth.
    pub voters: Vec<Voter>,
    /// Which of them is what the graph puts out.
    pub main: usize,
    /// How far ahead that looks, in s.
    pub ahead_s: f64,
    /// The same of each prediction.
    #[serde(skip)]
    pub(super) aheads_s: Vec<f64>,
    /// The weights of a vote's voters at each truth; empty where nothing is weighed.
    pub weights: Vec<Weight>,
    /// Below this absolute truth the axis is stable, and from the second on transient, by a `stability` node; none without one,
    /// since what is stable depends on the machine.
    pub states: Option<(f64, f64)>,
}

/// How much a voter counts.
#[derive(Debug, Clone, Serialize)]
pub struct Weight {
    /// The node that votes.
    pub node: String,
    /// The voter's node, or its channel where several voters are of one node.
    pub voter: String,
    /// The slot of the voter.
    #[serde(skip)]
    pub(super) slot: usize,
    /// Its weight at each truth.
    pub value: Vec<f64>,
}

/// A prediction of a truth.
#[derive(Debug, Clone, Serialize)]
pub struct Voter {
    /// The node's name.
    pub node: String,
    /// The same with the member of its set that it is of.
    #[serde(skip)]
    pub(super) instance: String,
    /// Its channel: `vote.Z1`.
    pub prediction: String,
    /// The slot of its channel.
    #[serde(skip)]
    pub(super) slot: usize,
    /// What it is called beside others of the same truth: its node, or its channel where that node predicts the truth twice.
    #[serde(skip)]
    pub(super) called: String,
    /// Its type.
    #[serde(rename = "type")]
    pub kind: &'static str,
    /// The output that it goes out as.
    #[serde(skip)]
    pub(super) output: Option<String>,
    /// Its value for each truth.
    pub value: Vec<f64>,
    /// Both ends of the interval about each, where it has any.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub interval: Option<Vec<[f64; 2]>>,
}

/// As model cards have it.
#[allow(clippy::ref_option)] // serde's signature
fn as_period<S: Serializer>(period_s: &Option<(f64, f64)>, to: S) -> Result<S::Ok, S::Error> {
    let period = period_s.map(|(from_s, to_s)| Period { from_s, to_s });
    period.serialize(to)
}

/// The plan, with the weights of votes, what is novel and the reasons of watches computed, whether or not the graph reads them.
fn with_weights(plan: &Plan) -> Plan {
    let mut plan = plan.clone();
    ask_for_reasons(&mut plan);
    ask_for_novelty(&mut plan);
    let weights = plan.nodes.iter().filter_map(|node| node.port("weights"));
    let weights: Vec<_> = weights.flatten().collect();
    plan.observe(weights);
    plan
}

/// Where the truth of an axis is, and the weights by which it is voted.
struct Places {
    truth: usize,
    weights: Range<usize>,
}

/// Steps the model over the recording, whose truths and predictions have been paired in a pass of their own.
pub(super) fn follow(
    model: &Model,
    recording: &dyn Recording,
    trace: &Trace,
    novelty: &mut NoveltyWatch,
) -> Result<(Course, Track, Vec<Unjudged>), ReportError> {
    let plan = Arc::new(with_weights(&model.plan));
    let mut engine = Engine::new(Arc::clone(&plan), &model.fitted)?;
    let (corrected, mut track, unjudged) = places(&plan);
    let (axes, of_axes) = axes(&plan, trace, &track);
    let mut course = Course {
        sensors: sensors(&plan),
        axes,
        ..Course::default()
    };
    // Segments may start their clocks again; here they follow each other.
    let (mut shift, mut last, mut begins) = (Duration::ZERO, None::<Instant>, false);
    pass(&mut engine, recording, |engine, event, samples| {
        let Event::Row(time) = event else {
            course.sensors.iter_mut().for_each(SensorFacts::segment);
            novelty.segment();
            begins = true;
            return;
        };
        if begins && let Some(last) = last {
            shift = (last + Duration::from_ns(3_600_000_000_000)) - time;
        }
        let now = time + shift;
        let now_s = (now - Instant::from_ns(0)).secs();
        last = Some(now);
        course.ticks += 1;
        let (from, _) = course.period_s.unwrap_or((now_s, now_s));
        course.period_s = Some((from, now_s));
        for (sensor, &value) in course.sensors.iter_mut().zip(&samples.values) {
            sensor.look(now_s, value, engine);
        }
        for (axis, places) in course.axes.iter_mut().zip(&of_axes) {
            axis.look(places, engine, now_s);
        }
        novelty.look(engine, now_s);
        if !track.axes.is_empty() {
            track.look(&corrected, engine, now, begins);
        }
        begins = false;
    })?;
    for sensor in &mut course.sensors {
        sensor.finish(model.sample_ranges());
    }
    course.refused = engine.refused();
    course.rejected = engine.rejected_channels();
    Ok((course, track, unjudged))
}

/// Every truth with its predictions, in the order of the first of these.
fn axes(plan: &Plan, trace: &Trace, track: &Track) -> (Vec<Axis>, Vec<Places>) {
    let put_out: Vec<usize> = plan.outputs.iter().map(|output| output.slot).collect();
    let output_of = |slot: usize| {
        let output = plan.outputs.iter().find(|output| output.slot == slot);
        output.map(|output| output.name.clone())
    };
    let rates: Vec<usize> = track.axes.iter().map(|axis| axis.predicted.1).collect();
    // What is integrated counts most, then what is put out, of several the first.
    let stands =
        |slot: usize| 2 * u8::from(rates.contains(&slot)) + u8::from(put_out.contains(&slot));
    let mut truths: Vec<&TruthTrace> = trace.truths.iter().collect();
    truths.sort_by_key(|truth| truth.predictions.first().map(|of| of.slot));
    let axis = |truth: &TruthTrace| {
        let of = &plan.channels[truth.slot].channel;
        let named = |other: &&TruthTrace| plan.channels[other.slot].channel.name == of.name;
        let namesakes = trace.truths.iter().filter(named).count();
        let all = || truth.predictions.iter();
        let main = all()
            .enumerate()
            .rev()
            .max_by_key(|(_, of)| stands(of.slot));
        let main = main.map_or(0, |(nth, _)| nth);
        // One vote is shown, the first: the picture of two would not be read.
        let vote = all().map(|of| &plan.nodes[of.node]).find_map(|node| {
            let PlannedRole::Combiner { voters, .. } = node.role else {
                return None;
            };
            Some((node, voters, node.port("weights")?))
        });
        let slots = vote.as_ref().map_or(0..0, |(.., slots)| slots.clone());
        let weights = vote.iter().flat_map(|(node, voters, slots)| {
            let entries = plan.gathers[*voters].entries.iter();
            let weight = |(slot, voter): (usize, &Entry)| {
                let name = &plan.channels[slot].channel.name;
                Weight {
                    node: node.name.clone(),
                    // A node may be called `weight-…` itself.
                    voter: name.strip_prefix("weight-").unwrap_or(name).to_owned(),
                    slot: voter.slot,
                    value: Vec::new(),
                }
            };
            slots.clone().zip(entries).map(weight)
        });
        let voter = |of: &PredictionTrace| {
            let (node, prediction) = (&plan.nodes[of.node], &plan.channels[of.slot].name);
            let of_node = all().filter(|other| plan.nodes[other.node].name == node.name);
            let called = match of_node.count() {
                1 => &node.name,
                _ => prediction,
            };
            Voter {
                node: node.name.clone(),
                instance: node.instance(),
                prediction: prediction.clone(),
                slot: of.slot,
                called: called.clone(),
                kind: node.kind.name,
                output: output_of(of.slot),
                value: of.values.clone(),
                interval: of.ends.clone(),
            }
        };
        let axis = Axis {
            name: match namesakes {
                1 => of.name.clone(),
                _ => plan.channels[truth.slot].name.clone(),
            },
            truth_name: plan.channels[truth.slot].name.clone(),
            slot: truth.slot,
            unit: of.unit.to_string(),
            error_unit: of.unit.difference().to_string(),
            no_model: truth.no_model,
            truth: Series::default(),
            voters: all().map(voter).collect(),
            main,
            ahead_s: truth
                .predictions
                .get(main)
                .map_or(0.0, |of| of.ahead.secs()),
            aheads_s: all().map(|of| of.ahead.secs()).collect(),
            weights: weights.collect(),
            states: states(plan, truth.slot, &of.unit),
        };
        let places = Places {
            truth: truth.slot,
            weights: slots,
        };
        (axis, places)
    };
    truths.into_iter().map(axis).unzip()
}

impl Axis {
    /// The prediction that the graph puts out.
    pub(super) fn put_out(&self) -> &Voter {
        &self.voters[self.main]
    }

    /// The places of what the graph puts out beside what is shown of the axis.
    pub(super) fn other_outputs(&self) -> impl Iterator<Item = usize> {
        let is_other = |nth: &usize| *nth != self.main && self.voters[*nth].output.is_some();
        (0..self.voters.len()).filter(is_other)
    }

    fn look(&mut self, places: &Places, engine: &Engine, now_s: f64) {
        let truth = engine.value(places.truth);
        if truth.is_nan() {
            return;
        }
        self.truth.push(now_s, truth);
        for (weight, slot) in self.weights.iter_mut().zip(places.weights.clone()) {
            weight.value.push(engine.value(slot));
        }
    }
}

/// The limits of the states of stability in the unit of a drift, from the first node that has them; none where it is no drift, or
/// nobody gives them.
fn states(plan: &Plan, drift: usize, unit: &Unit) -> Option<(f64, f64)> {
    let limits = plan.nodes.iter().filter_map(|node| match node.kind.duty() {
        Duty::Grade { stable, transient } => Some((node, [stable, transient])),
        _ => None,
    });
    let (node, limits) = limits
        .into_iter()
        .find(|(node, _)| reads_drift(plan, node, drift))?;
    let [stable, transient] = limits.map(|name| parameter::<Quantity>(node, name)?.in_unit(unit));
    stable.zip(transient)
}
