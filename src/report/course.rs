//! Decides what is written down while a model is stepped over a recording; not what it is worth.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

use athermal_control::Stability;
use athermal_core::compile::{Plan, PlannedRole, TruthLink};
use athermal_core::engine::{Engine, EngineError, Pairing};
use athermal_core::model::Model;
use athermal_core::quantity::Quantity;
use athermal_core::recording::{Event, Recording};
use athermal_core::time::{Duration, Instant};
use athermal_core::unit::Unit;
use serde::Serialize;

use super::sensors::{SensorFacts, ask_for_reasons, sensors};
use super::track::{Track, parameters, places};
use super::{ReportError, Series};

/// Limits of the states of stability where no `stability` node gives them, in nm/min (Mandelli, Dankwart and Napoli, section 3.4).
const STABLE: f64 = 30.0;
const TRANSIENT: f64 = 80.0;

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
    pub period_s: Option<(f64, f64)>,
    /// Every predicted truth.
    pub axes: Vec<Axis>,
    /// Every measured channel.
    pub sensors: Vec<SensorFacts>,
}

/// A truth and its predictions.
#[derive(Debug, Clone, Serialize)]
pub struct Axis {
    /// The channel: `Z1`.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// The measured truth.
    pub truth: Series,
    /// Every prediction of it, paired as in scoring: one value per truth.
    pub voters: Vec<Voter>,
    /// Which of them is what the graph puts out.
    pub main: usize,
    /// How far ahead that looks, in s.
    pub ahead_s: f64,
    /// The weights of a vote's voters at each truth; empty where nothing is weighed.
    pub weights: Vec<Weight>,
    /// Below this absolute truth the axis is stable, and from the second on transient; none where the truth is no drift.
    pub states: Option<(f64, f64)>,
}

/// How much a voter counts.
#[derive(Debug, Clone, Serialize)]
pub struct Weight {
    /// The node that votes.
    pub node: String,
    /// The voter.
    pub voter: String,
    /// Its weight at each truth.
    pub value: Vec<f64>,
}

/// A prediction of a truth.
#[derive(Debug, Clone, Serialize)]
pub struct Voter {
    /// The node's name.
    pub node: String,
    /// Its type.
    #[serde(rename = "type")]
    pub kind: &'static str,
    /// Its value for each truth.
    pub value: Vec<f64>,
}

/// The plan, with the weights of votes and the reasons of watches computed, whether or not the graph reads them.
fn telling(plan: &Plan) -> Plan {
    let mut plan = plan.clone();
    ask_for_reasons(&mut plan);
    for node in &mut plan.nodes {
        if let PlannedRole::Combiner { beside, .. } = &mut node.role {
            beside.weights = weights_of(&node.ports).map(|slots| slots.start);
        }
    }
    plan
}

/// The slots of the port of weights; other ports stand beside a prediction too, such as the ends of its interval.
fn weights_of(ports: &[(&'static str, Range<usize>)]) -> Option<Range<usize>> {
    let weights = ports.iter().find(|(name, _)| *name == "weights");
    weights.map(|(_, slots)| slots.clone())
}

/// A prediction being paired with its truth.
struct Pairs {
    axis: usize,
    voter: usize,
    slot: usize,
    truth: usize,
    pairing: Pairing,
    /// The slots of the weights by which it combines others.
    weights: Range<usize>,
}

/// Steps the model over the recording.
pub(super) fn follow(
    model: &Model,
    recording: &dyn Recording,
) -> Result<(Course, Option<Track>), ReportError> {
    let plan = Arc::new(telling(&model.plan));
    let mut engine = Engine::new(Arc::clone(&plan), &model.fitted)?;
    let mut course = Course {
        sensors: sensors(&plan),
        ..Course::default()
    };
    let mut pairs = pairs(&plan, &mut course);
    let mut found = places(&plan);
    let mut rows = recording.open(&plan)?;
    let mut values = vec![f64::NAN; plan.sources.len()];
    // Segments may start their clocks again; here they follow each other.
    let (mut shift, mut last, mut begins) = (Duration::ZERO, None::<Instant>, false);
    while let Some(event) = rows.next(&mut values)? {
        let time = match event {
            Event::Segment => {
                engine.segment();
                pairs.iter_mut().for_each(|pair| pair.pairing.clear());
                course.sensors.iter_mut().for_each(SensorFacts::segment);
                begins = true;
                continue;
            }
            Event::Row(time) => time,
        };
        match engine.step(time, &values) {
            Ok(_) => {}
            Err(EngineError::NotAfter { .. }) => continue,
            Err(error) => return Err(Box::new(error)),
        }
        if begins && let Some(last) = last {
            shift = (last + Duration::from_ns(3_600_000_000_000)) - time;
        }
        let now = time + shift;
        let now_s = (now - Instant::from_ns(0)).secs();
        last = Some(now);
        course.ticks += 1;
        let (from, _) = course.period_s.unwrap_or((now_s, now_s));
        course.period_s = Some((from, now_s));
        for (sensor, &value) in course.sensors.iter_mut().zip(&values) {
            sensor.look(now_s, value, &engine);
        }
        look(&mut pairs, &mut course, &engine, time, now_s);
        if let Some((places, track)) = &mut found {
            track.look(places, &engine, now, begins);
        }
        begins = false;
    }
    course.sensors.iter_mut().for_each(SensorFacts::finish);
    course.refused = engine.refused();
    course.rejected = engine.rejected_channels();
    Ok((course, found.map(|(_, track)| track)))
}

fn pairs(plan: &Plan, course: &mut Course) -> Vec<Pairs> {
    let mut of_truth: BTreeMap<usize, usize> = BTreeMap::new();
    let mut pairs = Vec::new();
    let put_out: Vec<usize> = plan.outputs.iter().map(|output| output.slot).collect();
    let rates: Vec<usize> = plan
        .nodes
        .iter()
        .filter(|node| node.kind.name == "compensate")
        .filter_map(|node| match &node.role {
            PlannedRole::Feature { gathers, .. } => gathers.first(),
            _ => None,
        })
        .flat_map(|&gather| plan.gathers[gather].entries.iter().map(|entry| entry.slot))
        .collect();
    let mut standing: Vec<u8> = Vec::new();
    for (slot, channel) in plan.channels.iter().enumerate() {
        let (Some(truth), Some(node)) = (channel.predicts, channel.node) else {
            continue;
        };
        let of = &plan.channels[truth].channel;
        let Some(limit) = of.default_max_age() else {
            continue;
        };
        let axis = *of_truth.entry(truth).or_insert_with(|| {
            course.axes.push(Axis {
                name: of.name.clone(),
                unit: of.unit.to_string(),
                truth: Series::default(),
                voters: Vec::new(),
                main: 0,
                ahead_s: channel.channel.ahead.secs(),
                weights: Vec::new(),
                states: states(plan, &of.unit),
            });
            standing.push(0);
            course.axes.len() - 1
        });
        let link = TruthLink {
            slot: truth,
            ahead: channel.channel.ahead,
            span: of.span,
            limit,
        };
        let voter = course.axes[axis].voters.len();
        course.axes[axis].voters.push(Voter {
            node: plan.nodes[node].name.clone(),
            kind: plan.nodes[node].kind.name,
            value: Vec::new(),
        });
        // What is integrated counts most, then what is put out first.
        let stands = 2 * u8::from(rates.contains(&slot)) + u8::from(put_out.contains(&slot));
        if stands > standing[axis] {
            standing[axis] = stands;
            course.axes[axis].main = voter;
            course.axes[axis].ahead_s = channel.channel.ahead.secs();
        }
        let combines = matches!(plan.nodes[node].role, PlannedRole::Combiner { .. });
        // One vote is shown, the first: the picture of two would not be read.
        let shown = combines && course.axes[axis].weights.is_empty();
        let weights = weights_of(&plan.nodes[node].ports).filter(|_| shown);
        let weights = weights.unwrap_or_default();
        course.axes[axis]
            .weights
            .extend(weights.clone().map(|slot| {
                Weight {
                    node: plan.nodes[node].name.clone(),
                    voter: plan.channels[slot]
                        .channel
                        .name
                        .trim_start_matches("weight-")
                        .to_owned(),
                    value: Vec::new(),
                }
            }));
        pairs.push(Pairs {
            axis,
            voter,
            slot,
            truth,
            pairing: Pairing::new(&link, 1),
            weights,
        });
    }
    pairs
}

fn look(pairs: &mut [Pairs], course: &mut Course, engine: &Engine, time: Instant, now_s: f64) {
    for pair in pairs {
        if engine.ran(pair.slot) {
            pair.pairing.run(time, [&[engine.value(pair.slot)][..]]);
        }
        let truth = engine.value(pair.truth);
        if truth.is_nan() {
            continue;
        }
        let axis = &mut course.axes[pair.axis];
        if pair.voter == 0 {
            axis.truth.push(now_s, truth);
        }
        let paired = pair
            .pairing
            .truth(time)
            .map_or(f64::NAN, |paired| paired.row[0]);
        axis.voters[pair.voter].value.push(paired);
        for (weight, slot) in axis.weights.iter_mut().zip(pair.weights.clone()) {
            weight.value.push(engine.value(slot));
        }
    }
}

/// The limits of the states of stability in the unit of a drift.
fn states(plan: &Plan, unit: &Unit) -> Option<(f64, f64)> {
    let in_unit = |quantity: &Quantity| quantity.in_unit(unit);
    if let Some(node) = parameters::<Stability>(plan, "stability") {
        return in_unit(&node.stable_below).zip(in_unit(&node.transient_above));
    }
    let factor = Unit::parse("nm/min").ok()?.factor_to(unit)?;
    Some((STABLE * factor, TRANSIENT * factor))
}
