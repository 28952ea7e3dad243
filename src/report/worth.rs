//! Decides what a correction is worth: drift, light and minutes without and with it, recomputed from corrected positions.

use std::fmt::Write as _;
use std::path::Path;
use std::sync::Arc;

use athermal_core::compile::{Plan, Wanted, compile};
use athermal_core::diagnostic::{Diagnostics, Sources};
use athermal_core::document::{Memory, declare, load_text};
use athermal_core::engine::{Engine, Fitted};
use athermal_core::time::Instant;
use athermal_core::unit::Unit;
use serde::Serialize;
use serde_json::Value;

use super::change::{Changes, Settling, StepLoss};
use super::departure::{Departure, departures};
use super::track::{Track, TrackAxis};
use super::{Axis, ReportError, Series};

/// What a correction is worth.
#[derive(Debug, Clone, Serialize)]
pub struct Worth {
    /// Names of the axes.
    pub axes: Vec<String>,
    /// Of each axis the slots of the truth and of the prediction of it that is integrated.
    #[serde(skip)]
    predicted: Vec<(usize, usize)>,
    /// Unit of each axis' drift.
    pub units: Vec<String>,
    /// Drift of each axis without the correction.
    pub drift_without: Vec<Series>,
    /// Drift of each axis with the correction added to its positions.
    pub drift_with: Vec<Series>,
    /// Correction of each axis at its positions.
    pub correction: Vec<Series>,
    /// Unit of each correction.
    pub correction_units: Vec<String>,
    /// How far each axis departs from where it was, and what held its correction back.
    pub departures: Vec<Departure>,
    /// Optical loss in dB without and with; empty without an `optical_loss` node.
    pub loss_without: Series,
    /// See `loss_without`.
    pub loss_with: Series,
    /// The limit of the loss in dB.
    pub loss_limit: f64,
    /// The set point at each loss.
    pub set_point: Vec<f64>,
    /// The set point's unit.
    pub set_point_unit: Option<String>,
    /// Share of the losses below the limit, without and with; none without losses.
    pub below_limit: Option<(f64, f64)>,
    /// The changes of the set point, in order.
    pub settling: Vec<Settling>,
    /// The largest loss after changes of one kind, first the time before any change.
    pub steps: Vec<StepLoss>,
}

impl Worth {
    /// What is known before the first row.
    fn before(track: &Track) -> Self {
        let of_axes = |of: fn(&TrackAxis) -> &String| track.axes.iter().map(of).cloned().collect();
        let empty = || vec![Series::default(); track.axes.len()];
        let decibel = Unit::parse("dB").ok();
        let limit = track.settled.as_ref().zip(decibel.as_ref());
        Self {
            axes: of_axes(|axis| &axis.name),
            predicted: track.axes.iter().map(|axis| axis.predicted).collect(),
            units: of_axes(|axis| &axis.drift),
            drift_without: empty(),
            drift_with: empty(),
            correction: empty(),
            correction_units: of_axes(|axis| &axis.position),
            departures: departures(track),
            loss_without: Series::default(),
            loss_with: Series::default(),
            loss_limit: limit
                .and_then(|(settled, unit)| settled.below.in_unit(unit))
                .unwrap_or(LIMIT_DB),
            set_point: Vec::new(),
            set_point_unit: track.set_point.clone(),
            below_limit: None,
            settling: Vec::new(),
            steps: Vec::new(),
        }
    }

    /// The place of the axis that is corrected for a truth: of several corrections, that of what the graph puts out.
    pub(super) fn place_of(&self, axis: &Axis) -> Option<usize> {
        let put_out = (axis.slot, axis.put_out().slot);
        let of_put_out = self.predicted.iter().position(|of| *of == put_out);
        of_put_out.or_else(|| self.predicted.iter().position(|of| of.0 == axis.slot))
    }

    /// What the correction does for light and waiting, in a sentence; none without losses.
    #[must_use]
    pub fn headline(&self) -> Option<String> {
        let (without, with) = self.below_limit?;
        let mut text = format!(
            "Five-minute losses below {} dB: {:.1} % without, {:.1} % with correction",
            self.loss_limit,
            100.0 * without,
            100.0 * with
        );
        if !self.settling.is_empty() {
            let waits = |pick: fn(&Settling) -> Option<f64>| self.settling.iter().map(pick);
            let longest = |pick| match waits(pick).try_fold(0.0_f64, |most, m| Some(most.max(m?))) {
                Some(most) => format!("{most:.0} min"),
                None => "never settling".to_owned(),
            };
            let _ = write!(
                text,
                "; longest wait after a change of the set point: {} without, {} with",
                longest(|s| s.without_min),
                longest(|s| s.with_min)
            );
        }
        Some(text + ".")
    }
}

/// The limit where no `settled` node gives one: that of the article.
const LIMIT_DB: f64 = 0.2;

/// A graph of the framework's own nodes, so that drift, loss and settle time mean the same here as anywhere.
fn graph(track: &Track) -> String {
    let mut text = String::from("schema = 1\n");
    let mut outputs = String::new();
    for way in ["without", "with"] {
        for (nth, axis) in track.axes.iter().enumerate() {
            let name = toml::Value::from(axis.name.as_str());
            let _ = write!(
                text,
                "[signals.position_{way}_{nth}]\nunit = \"{}\"\nchannels = [{name}]\nmax_age = \"10min\"\n\
                 [nodes.drift_{way}_{nth}]\ntype = \"slope\"\ninputs.signal = \"position_{way}_{nth}\"\nwindows = [\"{}\"]\nunit = \"{}\"\n",
                axis.position, axis.span, axis.drift
            );
        }
        let _ = writeln!(outputs, "{way} = {}", drifts(track, way));
    }
    if let Some(unit) = &track.set_point {
        let _ = write!(
            text,
            "[signals.set_point]\nunit = \"{unit}\"\nchannels = [\"set\"]\n"
        );
    }
    if let Some(loss) = &track.loss {
        for way in ["without", "with"] {
            let _ = write!(
                text,
                "[nodes.loss_{way}]\ntype = \"optical_loss\"\ninputs.drift = {}\n",
                drifts(track, way)
            );
            parameters(&mut text, loss);
            let _ = writeln!(outputs, "loss_{way} = \"loss_{way}\"");
            if let (Some(settled), Some(_)) = (&track.settled, &track.set_point) {
                let _ = write!(
                    text,
                    "[nodes.settled_{way}]\ntype = \"settled\"\ninputs = {{ loss = \"loss_{way}\", set_point = \"set_point\" }}\n"
                );
                parameters(&mut text, settled);
                let _ = writeln!(
                    outputs,
                    "settled_{way} = \"settled_{way}\"\nsince_{way} = \"settled_{way}:since\""
                );
            }
        }
    }
    text + "[outputs]\n" + &outputs
}

/// The drifts of all axes as an input or output names them.
fn drifts(track: &Track, way: &str) -> String {
    let each: Vec<_> = (0..track.axes.len())
        .map(|nth| format!("\"drift_{way}_{nth}\""))
        .collect();
    format!("[{}]", each.join(", "))
}

/// The parameters of a node as lines of TOML: texts, numbers and lists of them look the same in JSON.
fn parameters(text: &mut String, spec: &impl Serialize) {
    if let Ok(Value::Object(keys)) = serde_json::to_value(spec) {
        for (key, value) in keys.iter().filter(|(_, value)| !value.is_null()) {
            let _ = writeln!(text, "{key} = {value}");
        }
    }
}

fn engine(track: &Track) -> Result<Engine, ReportError> {
    let (mut sources, mut diagnostics) = (Sources::new(), Diagnostics::new());
    let document = load_text(
        Path::new("worth.toml"),
        graph(track),
        &Memory::new(),
        &mut sources,
        &mut diagnostics,
    );
    let graph = document.and_then(|document| declare(document, &mut diagnostics));
    let plan = graph.and_then(|graph| compile(&graph, Wanted::default(), &mut diagnostics));
    let plan = plan.ok_or_else(|| diagnostics.render(&sources, false, 100))?;
    Ok(Engine::new(Arc::new(plan), &Fitted::new())?)
}

/// Where the graph puts out what; an output that it lacks is nowhere. Of two ways, the first is without the correction.
struct Places {
    /// Of each axis.
    drifts: Vec<[Option<usize>; 2]>,
    losses: [Option<usize>; 2],
    settled: [Option<usize>; 2],
    since: Option<usize>,
}

impl Places {
    fn of(plan: &Plan, track: &Track) -> Self {
        let place = |name: &str| plan.outputs.iter().position(|output| output.name == name);
        let drifts = |axis: &TrackAxis| {
            ["without", "with"].map(|way| place(&format!("{way}.{}", axis.name)))
        };
        Self {
            drifts: track.axes.iter().map(drifts).collect(),
            losses: ["loss_without.loss", "loss_with.loss"].map(place),
            settled: ["settled_without.settle_time", "settled_with.settle_time"].map(place),
            since: place("since_without.since"),
        }
    }
}

pub(super) fn worth(track: &mut Track) -> Result<Worth, ReportError> {
    let mut engine = match engine(track) {
        // The graph's loss may be of other axes than are corrected; the drifts are told all the same.
        Err(_) if track.loss.is_some() => {
            track.loss = None;
            engine(track)?
        }
        engine => engine?,
    };
    let places = Places::of(engine.plan(), track);
    let mut worth = Worth::before(track);
    let count = track.axes.len();
    let mut changes = Changes::default();
    let mut samples = vec![f64::NAN; 2 * count + usize::from(track.set_point.is_some())];
    for row in &track.rows {
        for i in 0..count {
            samples[i] = row.position[i];
            samples[count + i] = row.position[i] + row.correction[i];
        }
        if track.set_point.is_some() {
            samples[2 * count] = row.set_point;
        }
        changes.set(row.set_point);
        let outputs = engine.step(row.at, &samples)?;
        let at_s = (row.at - Instant::from_ns(0)).secs();
        let get = |place: Option<usize>| place.map_or(f64::NAN, |place| outputs[place]);
        for (i, &drifts) in places.drifts.iter().enumerate() {
            let [without, with] = drifts.map(get);
            if !without.is_nan() {
                worth.drift_without[i].push(at_s, without);
                worth.drift_with[i].push(at_s, with);
            }
            if !row.position[i].is_nan() {
                worth.correction[i].push(at_s, row.correction[i]);
            }
        }
        let losses @ [without, with] = places.losses.map(get);
        // Both over the same windows: those in which there is a correction at all.
        if !without.is_nan() && !with.is_nan() {
            worth.loss_without.push(at_s, without);
            worth.loss_with.push(at_s, with);
            worth.set_point.push(changes.set_point());
            changes.lose(losses);
        }
        changes.go_on(at_s, get(places.since), places.settled.map(get));
        if row.begins {
            engine.segment();
            changes.segment();
        }
    }
    let below = |losses: &[f64]| {
        let low = losses.iter().filter(|loss| **loss < worth.loss_limit);
        low.count() as f64 / losses.len() as f64
    };
    worth.below_limit = (!worth.loss_with.value.is_empty()).then(|| {
        (
            below(&worth.loss_without.value),
            below(&worth.loss_with.value),
        )
    });
    let change = track
        .settled
        .as_ref()
        .map_or(0.0, |settled| settled.change.value);
    (worth.settling, worth.steps) = changes.told(change);
    Ok(worth)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wait_that_never_ends_is_the_longest() {
        let settling = |without_min, with_min| Settling {
            at_s: 0.0,
            from: 20.0,
            to: 30.0,
            without_min,
            with_min,
            largest_without: 1.0,
            largest_with: 0.1,
        };
        let worth = Worth {
            axes: Vec::new(),
            predicted: Vec::new(),
            units: Vec::new(),
            drift_without: Vec::new(),
            drift_with: Vec::new(),
            correction: Vec::new(),
            correction_units: Vec::new(),
            departures: Vec::new(),
            loss_without: Series::default(),
            loss_with: Series::default(),
            loss_limit: 0.2,
            set_point: Vec::new(),
            set_point_unit: None,
            below_limit: Some((0.5, 0.975)),
            settling: vec![settling(Some(82.0), Some(32.4)), settling(None, Some(0.0))],
            steps: Vec::new(),
        };
        assert_eq!(
            worth.headline().unwrap(),
            "Five-minute losses below 0.2 dB: 50.0 % without, 97.5 % with correction; \
             longest wait after a change of the set point: never settling without, 32 min with."
        );
    }
}
