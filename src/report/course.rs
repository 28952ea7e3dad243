//! Decides what is written down while a model is stepped over a recording; not what it is worth.

use std::collections::BTreeMap;
use std::sync::Arc;

use athermal_control::{OpticalLoss, Settled};
use athermal_core::compile::{Plan, PlannedNode, PlannedRole, TruthLink};
use athermal_core::engine::{Engine, EngineError, Pairing};
use athermal_core::model::Model;
use athermal_core::recording::{Event, Recording};
use athermal_core::time::{Duration, Instant};
use serde::Serialize;

use super::{ReportError, Series};

/// What happened over time.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Course {
    /// Ticks stepped.
    pub ticks: u64,
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

/// What can be said of a measured channel.
#[derive(Debug, Clone, Serialize)]
pub struct SensorFacts {
    /// The channel: `temperature.plate1`.
    pub name: String,
    /// Samples taken.
    pub samples: u64,
    /// Samples rejected as infinite or out of range.
    pub rejected: u64,
    /// The longest time in s between two samples.
    pub longest_gap_s: f64,
    /// The mean time in s between two samples.
    pub mean_gap_s: f64,
    /// Lowest and highest sample.
    pub range: Option<(f64, f64)>,
    #[serde(skip)]
    last_s: Option<f64>,
}

/// What the correction was and what it acts on, for working out its worth.
#[derive(Debug)]
pub(super) struct Track {
    /// Names of the axes.
    pub(super) axes: Vec<String>,
    /// Unit of position and of drift.
    pub(super) units: (String, String),
    pub(super) span: Duration,
    pub(super) loss: Option<OpticalLoss>,
    pub(super) settled: Option<Settled>,
    /// The unit of the set point.
    pub(super) set_point: Option<String>,
    pub(super) rows: Vec<TrackRow>,
}

/// One instant at which something was measured.
#[derive(Debug)]
pub(super) struct TrackRow {
    pub(super) at: Instant,
    pub(super) position: Vec<f64>,
    pub(super) correction: Vec<f64>,
    pub(super) set_point: f64,
    /// Whether another segment begins here.
    pub(super) begins: bool,
}

/// Where to look for what a correction does.
struct Places {
    positions: Vec<usize>,
    corrections: Vec<usize>,
    factor: f64,
    set_point: Option<usize>,
}

fn parameters<T: serde::de::DeserializeOwned>(plan: &Plan, kind: &str) -> Option<T> {
    let node = plan.nodes.iter().find(|node| node.kind.name == kind)?;
    serde_json::from_value(node.spec.parameters()).ok()
}

fn first_input(plan: &Plan, node: &PlannedNode, port: usize, nth: usize) -> Option<usize> {
    let PlannedRole::Feature { gathers, .. } = &node.role else {
        return None;
    };
    let gather = plan.gathers.get(*gathers.get(port)?)?;
    gather.entries.get(nth).map(|entry| entry.slot)
}

/// Finds the correction, the positions that it acts on, and how its worth is judged.
fn places(plan: &Plan) -> Option<(Places, Track)> {
    let node = plan
        .nodes
        .iter()
        .find(|node| node.kind.name == "compensate")?;
    let corrections: Vec<usize> = node.ports.first()?.1.clone().collect();
    let mut places = Places {
        positions: Vec::new(),
        corrections: corrections.clone(),
        factor: f64::NAN,
        set_point: None,
    };
    let mut of_drift = None;
    for (nth, &correction) in corrections.iter().enumerate() {
        let rate = first_input(plan, node, 0, nth)?;
        let truth = plan.channels[rate].predicts?;
        let slope = &plan.nodes[plan.channels[truth].node?];
        let position = first_input(plan, slope, 0, truth - slope.slots.start)?;
        let unit = &plan.channels[position].channel.unit;
        places.factor = plan.channels[correction].channel.unit.factor_to(unit)?;
        places.positions.push(position);
        of_drift = Some((truth, position));
    }
    let (truth, position) = of_drift?;
    let settled = plan.nodes.iter().find(|node| node.kind.name == "settled");
    places.set_point = settled.and_then(|node| first_input(plan, node, 1, 0));
    let drift = &plan.channels[truth].channel;
    let track = Track {
        axes: corrections
            .iter()
            .map(|&slot| plan.channels[slot].channel.name.clone())
            .collect(),
        units: (
            plan.channels[position].channel.unit.to_string(),
            drift.unit.to_string(),
        ),
        span: drift.span,
        loss: parameters(plan, "optical_loss"),
        settled: parameters(plan, "settled"),
        set_point: places
            .set_point
            .map(|slot| plan.channels[slot].channel.unit.to_string()),
        rows: Vec::new(),
    };
    Some((places, track))
}

/// A prediction being paired with its truth.
struct Pairs {
    axis: usize,
    voter: usize,
    slot: usize,
    truth: usize,
    pairing: Pairing,
}

/// Steps the model over the recording.
pub(super) fn follow(
    model: &Model,
    recording: &dyn Recording,
) -> Result<(Course, Option<Track>), ReportError> {
    let plan = Arc::clone(&model.plan);
    let mut engine = Engine::new(Arc::clone(&plan), &model.fitted)?;
    let mut course = Course {
        sensors: plan
            .sources
            .iter()
            .map(|source| sensor(&source.name))
            .collect(),
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
                course
                    .sensors
                    .iter_mut()
                    .for_each(|sensor| sensor.last_s = None);
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
            sensor.look(now_s, value);
        }
        look(&mut pairs, &mut course, &engine, time, now_s);
        if let Some((places, track)) = &mut found {
            track.look(places, &engine, now, begins);
        }
        begins = false;
    }
    for (sensor, &rejected) in course.sensors.iter_mut().zip(engine.rejected()) {
        sensor.rejected = rejected;
    }
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
            (standing[axis], course.axes[axis].main) = (stands, voter);
        }
        pairs.push(Pairs {
            axis,
            voter,
            slot,
            truth,
            pairing: Pairing::new(&link, 1),
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
    }
}

fn sensor(name: &str) -> SensorFacts {
    SensorFacts {
        name: name.to_owned(),
        samples: 0,
        rejected: 0,
        longest_gap_s: 0.0,
        mean_gap_s: 0.0,
        range: None,
        last_s: None,
    }
}

impl SensorFacts {
    fn look(&mut self, now_s: f64, value: f64) {
        if !value.is_finite() {
            return;
        }
        if let Some(last_s) = self.last_s {
            let gap = now_s - last_s;
            self.longest_gap_s = self.longest_gap_s.max(gap);
            self.mean_gap_s += (gap - self.mean_gap_s) / self.samples as f64;
        }
        self.samples += 1;
        let (low, high) = self.range.unwrap_or((value, value));
        self.range = Some((low.min(value), high.max(value)));
        self.last_s = Some(now_s);
    }
}

impl Track {
    fn look(&mut self, places: &Places, engine: &Engine, now: Instant, begins: bool) {
        let position: Vec<f64> = places
            .positions
            .iter()
            .map(|&slot| engine.value(slot))
            .collect();
        let set_point = places.set_point.map_or(f64::NAN, |slot| engine.value(slot));
        if begins && let Some(row) = self.rows.last_mut() {
            // Kept on the row before, so that it is seen even where nothing is measured at the break.
            row.begins = true;
        }
        if position.iter().all(|value| value.is_nan()) && set_point.is_nan() {
            return;
        }
        let correction = places
            .corrections
            .iter()
            .map(|&slot| engine.value(slot) * places.factor);
        self.rows.push(TrackRow {
            at: now,
            position,
            correction: correction.collect(),
            set_point,
            begins: false,
        });
    }
}
