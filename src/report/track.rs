//! Decides where a graph's correction comes from and what it acts on, and writes both down.

use std::collections::BTreeMap;

use athermal_control::{OpticalLoss, Settled, held_back_by};
use athermal_core::compile::{Plan, PlannedNode, PlannedRole};
use athermal_core::engine::Engine;
use athermal_core::time::{Duration, Instant};

use crate::diagnosis::window::measured_by;

/// The number in the port `why` of a correction without a valid prediction.
const INVALID: f64 = 1.0;

/// What the correction was and what it acts on, for working out its worth.
#[derive(Debug)]
pub(super) struct Track {
    pub(super) axes: Vec<TrackAxis>,
    pub(super) loss: Option<OpticalLoss>,
    pub(super) settled: Option<Settled>,
    /// The unit of the set point.
    pub(super) set_point: Option<String>,
    pub(super) rows: Vec<TrackRow>,
    pub(super) ticks: u64,
    /// Which axes have had a valid prediction: before, there is no correction to be judged.
    begun: Vec<bool>,
}

/// An axis that is corrected.
#[derive(Debug)]
pub(super) struct TrackAxis {
    pub(super) name: String,
    /// The slots of the truth and of the prediction of it that is integrated.
    pub(super) predicted: (usize, usize),
    /// The unit of its positions.
    pub(super) position: String,
    /// The unit of its drift, and over which time that is measured.
    pub(super) drift: String,
    pub(super) span: Duration,
    /// How many ticks its correction was held back at, by what.
    pub(super) held_back: BTreeMap<&'static str, u64>,
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
pub(super) struct Places {
    positions: Vec<usize>,
    corrections: Vec<usize>,
    /// Where each correction says what holds it back.
    why: Vec<usize>,
    /// From the unit of each correction to that of its position.
    factors: Vec<f64>,
    set_point: Option<usize>,
}

pub(super) fn parameters<T: serde::de::DeserializeOwned>(plan: &Plan, kind: &str) -> Option<T> {
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
pub(super) fn places(plan: &Plan) -> Option<(Places, Track)> {
    let mut places = Places {
        positions: Vec::new(),
        corrections: Vec::new(),
        why: Vec::new(),
        factors: Vec::new(),
        set_point: None,
    };
    let mut axes = Vec::new();
    for node in plan
        .nodes
        .iter()
        .filter(|node| node.kind.name == "compensate")
    {
        for (nth, correction) in node.ports.first()?.1.clone().enumerate() {
            let rate = first_input(plan, node, 0, nth)?;
            let truth = plan.channels[rate].predicts?;
            let position = measured_by(plan, truth)?;
            let unit = &plan.channels[position].channel.unit;
            let correcting = &plan.channels[correction].channel;
            places.factors.push(correcting.unit.factor_to(unit)?);
            places.positions.push(position);
            places.corrections.push(correction);
            places.why.push(node.ports.get(1)?.1.start + nth);
            let drift = &plan.channels[truth].channel;
            axes.push(TrackAxis {
                name: correcting.name.clone(),
                predicted: (truth, rate),
                position: unit.to_string(),
                drift: drift.unit.to_string(),
                span: drift.span,
                held_back: BTreeMap::new(),
            });
        }
    }
    if axes.is_empty() {
        return None;
    }
    let settled = plan.nodes.iter().find(|node| node.kind.name == "settled");
    places.set_point = settled.and_then(|node| first_input(plan, node, 1, 0));
    let track = Track {
        begun: vec![false; axes.len()],
        axes,
        loss: parameters(plan, "optical_loss"),
        settled: parameters(plan, "settled"),
        set_point: places
            .set_point
            .map(|slot| plan.channels[slot].channel.unit.to_string()),
        rows: Vec::new(),
        ticks: 0,
    };
    Some((places, track))
}

impl Track {
    pub(super) fn look(&mut self, places: &Places, engine: &Engine, now: Instant, begins: bool) {
        self.ticks += 1;
        for (axis, &why) in self.axes.iter_mut().zip(&places.why) {
            if let Some(by) = held_back_by(engine.value(why)) {
                *axis.held_back.entry(by).or_default() += 1;
            }
        }
        let position: Vec<f64> = places
            .positions
            .iter()
            .map(|&slot| engine.value(slot))
            .collect();
        let set_point = places.set_point.map_or(f64::NAN, |slot| engine.value(slot));
        if begins {
            self.begun.fill(false);
        }
        if begins && let Some(row) = self.rows.last_mut() {
            // Kept on the row before, so that it is seen even where nothing is measured at the break.
            row.begins = true;
        }
        if position.iter().all(|value| value.is_nan()) && set_point.is_nan() {
            return;
        }
        for (begun, &why) in self.begun.iter_mut().zip(&places.why) {
            *begun |= engine.value(why) != INVALID;
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
            set_point,
            begins: false,
        });
    }
}
