//! What a correction acts on, and which drifts and losses are recomputed from that.

use std::collections::BTreeMap;
use std::iter::successors;

use athermal_core::compile::{Plan, PlannedNode, PlannedRole};
use athermal_core::engine::Engine;
use athermal_core::node::{Duty, KindFacts};
use athermal_core::quantity::Quantity;
use athermal_core::time::{Duration, Instant};
use athermal_core::unit::Unit;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

use crate::diagnosis::window::measured_by;

/// The number in the port `why` of a correction without a valid prediction.
const INVALID: f64 = 1.0;

/// What the correction was and what it acts on, for working out its worth.
#[derive(Debug, Default)]
pub(super) struct Track {
    pub(super) axes: Vec<TrackAxis>,
    /// Which drifts are recomputed: first that of each axis.
    pub(super) drifts: Vec<TrackDrift>,
    pub(super) losses: Vec<TrackLoss>,
    /// The names and units of the positions: first those of each axis, then of those that are not corrected and yet cost light.
    pub(super) positions: Vec<(String, String)>,
    pub(super) rows: Vec<TrackRow>,
    pub(super) ticks: u64,
    /// Which axes have had a valid prediction: before, there is no correction to be judged.
    begun: Vec<bool>,
    /// The first node that asks for alignments, and its tolerance.
    pub(super) remeasures: Option<(String, String)>,
    /// Whether it has asked since the last row.
    asks: bool,
}

/// An axis that is corrected.
#[derive(Debug)]
pub(super) struct TrackAxis {
    /// Its channel: `Z1`, or `compensate.Z1` where another correction is called `Z1` too.
    pub(super) name: String,
    /// The slots of the truth and of the prediction of it that is integrated.
    pub(super) predicted: (usize, usize),
    /// How many ticks its correction was held back at, by what.
    pub(super) held_back: BTreeMap<&'static str, u64>,
}

/// A drift, as a slope of a position.
#[derive(Debug, PartialEq)]
pub(super) struct TrackDrift {
    /// Which of the positions.
    pub(super) position: usize,
    pub(super) unit: String,
    /// The kind of the node that takes the slope.
    pub(super) kind: &'static str,
    /// The parameters of the node that takes the slope, for this window alone.
    pub(super) slope: Value,
}

/// An optical loss.
#[derive(Debug)]
pub(super) struct TrackLoss {
    /// The node: `loss`.
    pub(super) node: String,
    /// Which of the drifts, in the order in which the node reads them.
    pub(super) drifts: Vec<usize>,
    /// Its kind and its parameters.
    pub(super) kind: &'static str,
    pub(super) parameters: Value,
    /// The window of the drifts.
    pub(super) over: Option<Duration>,
    /// What measures how long it takes until the loss has settled.
    pub(super) settled: Option<TrackSettled>,
}

/// A settle time.
#[derive(Debug)]
pub(super) struct TrackSettled {
    /// The kind and the parameters of the node.
    pub(super) kind: &'static str,
    pub(super) parameters: Value,
    /// Where the loss has settled, in dB.
    pub(super) below: Option<f64>,
    /// The unit of the set point.
    pub(super) set_point: String,
    /// The smallest change of it that counts, in its unit.
    pub(super) change: f64,
}

/// One instant at which something was measured.
#[derive(Debug)]
pub(super) struct TrackRow {
    pub(super) at: Instant,
    pub(super) position: Vec<f64>,
    pub(super) correction: Vec<f64>,
    /// The set point of each loss.
    pub(super) set_points: Vec<f64>,
    /// Whether another segment begins here.
    pub(super) begins: bool,
    /// Whether an alignment has been asked for since the row before.
    pub(super) asks: bool,
}

/// What a graph has and a report cannot judge.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Unjudged {
    /// The node, or its channel: `compensate.Z1`.
    pub of: String,
    /// Why not.
    pub why: String,
}

/// Where to look for what a correction does.
pub(super) struct Places {
    positions: Vec<usize>,
    corrections: Vec<usize>,
    /// Where each correction gives what holds it back.
    why: Vec<(usize, KindFacts)>,
    /// From the unit of each correction to that of its position.
    factors: Vec<f64>,
    set_points: Vec<Option<usize>>,
    /// Where alignments are asked for.
    asks: Option<usize>,
}

/// A parameter of a node, where it has one that can be read so.
pub(super) fn parameter<T: DeserializeOwned>(node: &PlannedNode, name: &str) -> Option<T> {
    serde_json::from_value(node.spec.parameters()[name].take()).ok()
}

/// The slots that an input port of a feature reads.
fn reads(plan: &Plan, node: &PlannedNode, port: usize) -> Vec<usize> {
    let PlannedRole::Feature { gathers, .. } = &node.role else {
        return Vec::new();
    };
    let gather = gathers.get(port).map(|&gather| &plan.gathers[gather]);
    let entries = gather.into_iter().flat_map(|gather| &gather.entries);
    entries.map(|entry| entry.slot).collect()
}

/// A channel and what it is made of, as long as each node gives a channel for every one that it takes, in their order: a filter, a
/// limit.
fn made_of(plan: &Plan, slot: usize) -> impl Iterator<Item = usize> {
    let way = successors(Some(slot), |&slot| {
        let node = &plan.nodes[plan.channels[slot].node?];
        let (_, outputs) = node.ports.first()?;
        let inputs = reads(plan, node, 0);
        let nth = slot.checked_sub(outputs.start)?;
        (inputs.len() == outputs.len()).then_some(())?;
        inputs.get(nth).copied()
    });
    // A loop through a delay has no beginning.
    way.take(plan.channels.len())
}

/// The slot of the measured drift that a channel is, or predicts, or is made of, and that of the channel which is either.
fn measured_drift(plan: &Plan, slot: usize) -> Option<(usize, usize)> {
    made_of(plan, slot).find_map(|slot| match plan.channels[slot].predicts {
        Some(truth) => Some((truth, slot)),
        None => measured_by(plan, slot).map(|_| (slot, slot)),
    })
}

/// Whether a node reads a truth, or what predicts it, or is made of either.
pub(super) fn reads_drift(plan: &Plan, node: &PlannedNode, truth: usize) -> bool {
    let mut drifts = reads(plan, node, 0).into_iter();
    drifts.any(|slot| measured_drift(plan, slot).is_some_and(|of| of.0 == truth))
}

/// Finds the corrections, the positions that they act on, and how their worth is judged; and what cannot be judged.
pub(super) fn places(plan: &Plan) -> (Places, Track, Vec<Unjudged>) {
    let mut finder = Finder {
        plan,
        places: Places {
            positions: Vec::new(),
            corrections: Vec::new(),
            why: Vec::new(),
            factors: Vec::new(),
            set_points: Vec::new(),
            asks: None,
        },
        track: Track::default(),
        unjudged: Vec::new(),
    };
    finder.axes();
    if !finder.track.axes.is_empty() {
        finder.losses();
    }
    (finder.places, finder.track, finder.unjudged)
}

struct Finder<'a> {
    plan: &'a Plan,
    places: Places,
    track: Track,
    unjudged: Vec<Unjudged>,
}

impl Finder<'_> {
    fn axes(&mut self) {
        let plan = self.plan;
        let each = |node: &PlannedNode| {
            let port = |nth: usize| node.ports.get(nth).map_or(0..0, |(_, slots)| slots.clone());
            let rates = reads(plan, node, 0).into_iter();
            let facts = (node.kind.facts)();
            let all = port(0).zip(port(1).map(|slot| (slot, facts))).zip(rates);
            all.collect::<Vec<_>>()
        };
        let corrects = |node: &&PlannedNode| node.kind.duty() == Duty::Correct;
        let all: Vec<_> = plan.nodes.iter().filter(corrects).flat_map(each).collect();
        let named = |slot: usize| &plan.channels[slot].channel.name;
        for &((correction, why), rate) in &all {
            let namesakes = all
                .iter()
                .filter(|((other, _), _)| named(*other) == named(correction));
            let name = match namesakes.count() {
                1 => named(correction).clone(),
                _ => plan.channels[correction].name.clone(),
            };
            if let Err(why) = self.axis(name, correction, why, rate) {
                let of = plan.channels[correction].name.clone();
                self.unjudged.push(Unjudged { of, why });
            }
        }
        self.track.begun = vec![false; self.track.axes.len()];
        let asks = |node: &&PlannedNode| matches!(node.kind.duty(), Duty::Ask { .. });
        if let Some(node) = plan.nodes.iter().find(asks)
            && let Duty::Ask { tolerance } = node.kind.duty()
        {
            let tolerance = parameter(node, tolerance);
            self.track.remeasures = tolerance.map(|tolerance| (node.instance(), tolerance));
            self.places.asks = node.port("ask").map(|slots| slots.start);
        }
    }

    /// Takes an axis, if drift can be recomputed from its corrected position.
    fn axis(
        &mut self,
        name: String,
        correction: usize,
        why: (usize, KindFacts),
        rate: usize,
    ) -> Result<(), String> {
        let channels = &self.plan.channels;
        let (truth, prediction) = measured_drift(self.plan, rate).ok_or_else(|| {
            format!(
                "it integrates `{}`, which neither predicts a measured drift nor is made of one channel that does",
                channels[rate].name
            )
        })?;
        let position = measured_by(self.plan, truth).ok_or_else(|| {
            format!(
                "`{}` is no slope of a position, so that it cannot be taken again from the corrected one",
                channels[truth].name
            )
        })?;
        let (unit, correcting) = (
            &channels[position].channel.unit,
            &channels[correction].channel.unit,
        );
        let factor = correcting.factor_to(unit).ok_or_else(|| {
            format!(
                "it is in {correcting}, and the position `{}` in {unit}",
                channels[position].name
            )
        })?;
        let drift = self
            .slope(truth, self.track.axes.len())
            .ok_or_else(|| format!("the window of `{}` is not known", channels[truth].name))?;
        self.places.factors.push(factor);
        self.places.positions.push(position);
        self.places.corrections.push(correction);
        self.places.why.push(why);
        let named = (channels[position].channel.name.clone(), unit.to_string());
        self.track.positions.push(named);
        self.track.drifts.push(drift);
        self.track.axes.push(TrackAxis {
            name,
            predicted: (truth, prediction),
            held_back: BTreeMap::new(),
        });
        Ok(())
    }

    /// How a drift is taken again from one of the positions.
    fn slope(&self, drift: usize, position: usize) -> Option<TrackDrift> {
        let channels = &self.plan.channels;
        let channel = &channels[drift].channel;
        let of = &channels[measured_by(self.plan, drift)?].channel;
        // A filtered position has a span of its own, which is no part of the window.
        let window: Duration = channel.span - of.span;
        let node = &self.plan.nodes[channels[drift].node?];
        let mut slope = node.spec.parameters();
        let parameters = slope.as_object_mut()?;
        parameters.insert("windows".to_owned(), vec![window.to_string()].into());
        parameters.insert("unit".to_owned(), channel.unit.to_string().into());
        Some(TrackDrift {
            position,
            unit: channel.unit.to_string(),
            kind: node.kind.name,
            slope,
        })
    }

    fn losses(&mut self) {
        let plan = self.plan;
        let settles = |node: &&PlannedNode| matches!(node.kind.duty(), Duty::Settle { .. });
        let mut settled: Vec<&PlannedNode> = plan.nodes.iter().filter(settles).collect();
        for node in &plan.nodes {
            let Duty::Loss { over } = node.kind.duty() else {
                continue;
            };
            let (of, found) = (node.instance(), self.loss(node, over));
            let of_loss = |settled: &&PlannedNode| {
                let of = reads(plan, settled, 0);
                of.iter().any(|slot| node.slots.contains(slot))
            };
            let place = settled.iter().position(of_loss);
            let own = place.map(|place| settled.remove(place));
            match found {
                Ok(mut loss) => {
                    let set_point = own.and_then(|own| reads(plan, own, 1).first().copied());
                    loss.settled = own
                        .zip(set_point)
                        .and_then(|(own, slot)| self.settled(own, slot));
                    let set_point = set_point.filter(|_| loss.settled.is_some());
                    self.places.set_points.push(set_point);
                    self.track.losses.push(loss);
                }
                Err(why) => self.unjudged.push(Unjudged { of, why }),
            }
        }
        for node in settled {
            let of = node.instance();
            let why = "it reads no optical loss, or one that another node reads already".to_owned();
            self.unjudged.push(Unjudged { of, why });
        }
    }

    fn loss(&mut self, node: &PlannedNode, over: &str) -> Result<TrackLoss, String> {
        let read = reads(self.plan, node, 0);
        let channels = &self.plan.channels;
        let mut drifts = Vec::with_capacity(read.len());
        for slot in read {
            let drift = measured_drift(self.plan, slot).map(|of| of.0);
            let drift = drift.and_then(|drift| self.drift(drift));
            drifts.push(drift.ok_or_else(|| {
                format!(
                    "it reads `{}`, which is no drift of a measured position",
                    channels[slot].name
                )
            })?);
        }
        let corrected = |&drift: &usize| {
            let position = self.track.drifts[drift].position;
            position < self.track.axes.len()
        };
        if !drifts.iter().any(corrected) {
            return Err("none of the axes whose drifts it reads is corrected".to_owned());
        }
        Ok(TrackLoss {
            node: node.instance(),
            drifts,
            kind: node.kind.name,
            parameters: node.spec.parameters(),
            over: parameter(node, over),
            settled: None,
        })
    }

    /// The place of a drift among those that are recomputed, where it is taken up if it is not one yet.
    fn drift(&mut self, drift: usize) -> Option<usize> {
        let source = |slot: usize| made_of(self.plan, slot).last();
        let measured = measured_by(self.plan, drift)?;
        let positions = &self.places.positions;
        let of_axis = positions.iter().position(|slot| *slot == measured);
        // What is corrected may be filtered, or rid of what the machine corrects itself, and this drift not.
        let of_source = || {
            let mut all = positions.iter();
            all.position(|slot| source(*slot) == source(measured))
        };
        let place = of_axis.or_else(of_source).unwrap_or(positions.len());
        let slope = self.slope(drift, place)?;
        if place == self.places.positions.len() {
            self.places.positions.push(measured);
            let channel = &self.plan.channels[measured].channel;
            let named = (channel.name.clone(), channel.unit.to_string());
            self.track.positions.push(named);
        }
        let drifts = &mut self.track.drifts;
        let known = drifts.iter().position(|known| *known == slope);
        Some(known.unwrap_or_else(|| {
            drifts.push(slope);
            drifts.len() - 1
        }))
    }

    fn settled(&self, node: &PlannedNode, set_point: usize) -> Option<TrackSettled> {
        let Duty::Settle { below, change } = node.kind.duty() else {
            return None;
        };
        let (below, change): (Quantity, Quantity) =
            (parameter(node, below)?, parameter(node, change)?);
        let unit = &self.plan.channels[set_point].channel.unit;
        Some(TrackSettled {
            kind: node.kind.name,
            parameters: node.spec.parameters(),
            below: Unit::parse("dB").ok().and_then(|unit| below.in_unit(&unit)),
            change: change.as_difference(&unit.difference())?,
            set_point: unit.to_string(),
        })
    }
}

impl Track {
    pub(super) fn look(&mut self, places: &Places, engine: &Engine, now: Instant, begins: bool) {
        self.ticks += 1;
        self.asks |= places.asks.is_some_and(|slot| engine.value(slot) == 1.0);
        for (axis, (why, facts)) in self.axes.iter_mut().zip(&places.why) {
            if let Some(by) = facts.reason(engine.value(*why)) {
                *axis.held_back.entry(by).or_default() += 1;
            }
        }
        let position: Vec<f64> = places
            .positions
            .iter()
            .map(|&slot| engine.value(slot))
            .collect();
        let set_point = |slot: &Option<usize>| slot.map_or(f64::NAN, |slot| engine.value(slot));
        let set_points: Vec<f64> = places.set_points.iter().map(set_point).collect();
        if begins {
            self.begun.fill(false);
        }
        if begins && let Some(row) = self.rows.last_mut() {
            // Kept on the row before, so that it is seen even where nothing is measured at the break.
            row.begins = true;
        }
        if position
            .iter()
            .chain(&set_points)
            .all(|value| value.is_nan())
        {
            return;
        }
        for (begun, (why, _)) in self.begun.iter_mut().zip(&places.why) {
            *begun |= engine.value(*why) != INVALID;
        }
        let there = places.corrections.iter().zip(&places.factors);
        let correction = there
            .zip(&self.begun)
            .map(|((&slot, factor), begun)| match begun {
                true => engine.value(slot) * factor,
                false => f64::NAN,
            });
        self.rows.push(TrackRow {
            at: now,
            position,
            correction: correction.collect(),
            set_points,
            begins: false,
            asks: std::mem::take(&mut self.asks),
        });
    }
}
