//! What a correction is worth: drift, light and minutes without and with it, recomputed from corrected positions.

use athermal_core::time::Instant;
use serde::Serialize;

use super::change::Changes;
use super::departure::{Departure, departures};
use super::light::Light;
use super::realignment::{Realignment, realignment};
use super::recomputed::Recomputed;
use super::track::{Track, TrackAxis, Unjudged};
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
    /// How often it must be aligned anew, where a `remeasure` node asks for it.
    pub realignment: Option<Realignment>,
    /// What it does for the light of the first `optical_loss` node.
    #[serde(flatten)]
    pub light: Light,
    /// The same of all others.
    pub others: Vec<Light>,
}

impl Worth {
    /// What is known before the first row.
    fn before(track: &Track) -> Self {
        let of_axes = |of: fn(&TrackAxis) -> &String| track.axes.iter().map(of).cloned().collect();
        let empty = || vec![Series::default(); track.axes.len()];
        let units = track.drifts.iter().map(|drift| drift.unit.clone());
        let mut losses = track.losses.iter();
        Self {
            axes: of_axes(|axis| &axis.name),
            predicted: track.axes.iter().map(|axis| axis.predicted).collect(),
            units: units.take(track.axes.len()).collect(),
            drift_without: empty(),
            drift_with: empty(),
            correction: empty(),
            correction_units: track.positions[..track.axes.len()]
                .iter()
                .map(|(_, unit)| unit.clone())
                .collect(),
            departures: departures(track),
            realignment: realignment(track),
            light: Light::before(losses.next()),
            others: losses.map(|loss| Light::before(Some(loss))).collect(),
        }
    }

    /// The place of the axis that is corrected for a truth: of several corrections, that of what the graph puts out.
    pub(super) fn place_of(&self, axis: &Axis) -> Option<usize> {
        let put_out = (axis.slot, axis.put_out().slot);
        let of_put_out = self.predicted.iter().position(|of| *of == put_out);
        of_put_out.or_else(|| self.predicted.iter().position(|of| of.0 == axis.slot))
    }

    /// What it does for light, of each optical loss; one that is empty where there is none.
    pub fn lights(&self) -> impl Iterator<Item = &Light> {
        std::iter::once(&self.light).chain(&self.others)
    }

    /// What the correction does for light and waiting, a sentence for each optical loss.
    #[must_use]
    pub fn headlines(&self) -> Vec<String> {
        let several = !self.others.is_empty();
        let lights = self.lights().filter_map(|light| light.headline(several));
        let realignment = self.realignment.as_ref().map(Realignment::sentence);
        lights.chain(realignment).collect()
    }
}

/// What can be worked out again of a track; what cannot goes into `unjudged`.
fn recomputed(track: &mut Track, unjudged: &mut Vec<Unjudged>) -> Option<Recomputed> {
    let leave_out = |of: &str, error: &ReportError, unjudged: &mut Vec<Unjudged>| {
        unjudged.push(Unjudged {
            of: of.to_owned(),
            why: format!("it cannot be worked out from corrected positions: {error}"),
        });
    };
    let error = match Recomputed::of(track) {
        Ok(recomputed) => return Some(recomputed),
        Err(error) => error,
    };
    // Drifts are shown where losses cannot be.
    for loss in std::mem::take(&mut track.losses) {
        leave_out(&loss.node, &error, unjudged);
    }
    track.drifts.truncate(track.axes.len());
    match Recomputed::of(track) {
        Ok(recomputed) => Some(recomputed),
        Err(error) => {
            for axis in &track.axes {
                leave_out(&axis.name, &error, unjudged);
            }
            None
        }
    }
}

/// What a correction is worth; none where no axis is corrected, or none of it can be worked out.
pub(super) fn worth(
    mut track: Track,
    unjudged: &mut Vec<Unjudged>,
) -> Result<Option<Worth>, ReportError> {
    if track.axes.is_empty() {
        return Ok(None);
    }
    let Some(mut recomputed) = recomputed(&mut track, unjudged) else {
        return Ok(None);
    };
    let mut worth = Worth::before(&track);
    let mut changes: Vec<Changes> = track.losses.iter().map(|_| Changes::default()).collect();
    for row in &track.rows {
        let now = recomputed.step(row)?;
        let at_s = (row.at - Instant::from_ns(0)).secs();
        for (i, [without, with]) in now.drifts.into_iter().enumerate() {
            if !without.is_nan() {
                worth.drift_without[i].push(at_s, without);
                worth.drift_with[i].push(at_s, with);
            }
            if !row.position[i].is_nan() {
                worth.correction[i].push(at_s, row.correction[i]);
            }
        }
        let lights = std::iter::once(&mut worth.light).chain(&mut worth.others);
        let known = now.losses.iter().zip(&row.set_points);
        for ((light, changes), (loss, set_point)) in lights.zip(&mut changes).zip(known) {
            changes.set(*set_point);
            light.look(at_s, loss, changes);
            if row.begins {
                changes.segment();
            }
        }
        if row.begins {
            recomputed.segment();
        }
    }
    let lights = std::iter::once(&mut worth.light).chain(&mut worth.others);
    for ((light, changes), loss) in lights.zip(changes).zip(&track.losses) {
        light.finish(changes, loss);
    }
    Ok(Some(worth))
}
