//! Whether what predictions leave of a truth is white, so that nothing in its own past could still improve them.
//!
//! Truths over windows that overlap share noise, and forecasts made before the last error was known repeat it. So residuals are
//! taken one per window or horizon, whichever is longer: those of a perfect model are white, and others are not. Where truths are
//! missing, their places stay empty, and only pairs that are there count for a lag.

use athermal_core::compile::Plan;
use athermal_core::time::{Duration, Instant};
use athermal_numerics::{
    NORMAL_95, autocorrelation, autocorrelation_errors, autocorrelation_pairs, ljung_box,
};
use athermal_run::score::{PredictionTrace, TruthTrace};
use serde::Serialize;

use super::observation::Observation;

/// Lags of the autocorrelation, at most; and at most a fifth of the residuals (Box and Jenkins 1976).
const MOST_LAGS: usize = 20;
const SHARE: usize = 5;
/// A series is called white unless it would be as unlikely as this.
pub const UNLIKELY: f64 = 0.01;

/// The residuals of a prediction: measured less predicted.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Residuals {
    /// The prediction: `vote.Z1`.
    pub prediction: String,
    /// What it predicts.
    pub truth: String,
    /// The unit of the truth.
    pub unit: String,
    /// Residuals over all truths for which this prediction was valid; a score takes those for which all of the truth were.
    pub n: usize,
    /// Their root mean square.
    pub rms: f64,
    /// Their mean.
    pub mean: f64,
    /// The time in s between those of which the autocorrelation is taken.
    pub spacing_s: f64,
    /// How many these are.
    pub spaced: usize,
    /// Their autocorrelation from lag 1 on; empty where there are too few, and NaN (null in JSON) at a lag with too few pairs.
    pub autocorrelation: Vec<f64>,
    /// Half the width of the band about zero that holds 95 % of the autocorrelations at each lag of a series that has none from
    /// that lag on (Bartlett 1946): of a white one at lag 1, and wider beyond where there is some before.
    pub bound: Vec<f64>,
    /// The statistic of Ljung and Box over all these lags, and how likely a white series has one as large.
    pub ljung_box: Option<f64>,
    /// See `ljung_box`.
    pub p_value: Option<f64>,
    /// Whether they may be white, `p_value` not being below `level`; none where there are too few.
    pub white: Option<bool>,
    /// The p-value below which they are called not white.
    pub level: f64,
}

/// The residuals of every prediction of a model.
#[must_use]
pub fn residuals(plan: &Plan, observation: &Observation) -> Vec<Residuals> {
    let truths = observation.trace.truths.iter();
    let pairs = truths.flat_map(|truth| truth.predictions.iter().map(move |of| (truth, of)));
    pairs
        .map(|(truth, of)| of_prediction(plan, observation, truth, of))
        .collect()
}

fn of_prediction(
    plan: &Plan,
    observation: &Observation,
    truth: &TruthTrace,
    of: &PredictionTrace,
) -> Residuals {
    let left: Vec<f64> = truth
        .values
        .iter()
        .zip(&of.values)
        .map(|(y, p)| y - p)
        .collect();
    let present: Vec<f64> = left.iter().copied().filter(|e| !e.is_nan()).collect();
    let count = present.len();
    let span = plan.channels[truth.slot].channel.span;
    let apart = span.max(of.ahead);
    let spacing = apart.max(Observation::interval(truth).unwrap_or(Duration::ZERO));
    let spaced = spaced(observation, truth, &left, (spacing, apart));
    let number = spaced.iter().filter(|e| !e.is_nan()).count();
    let lags = MOST_LAGS.min(number / SHARE);
    let correlation = autocorrelation(&spaced, lags);
    let pairs = autocorrelation_pairs(&spaced, lags);
    let errors = autocorrelation_errors(&correlation, &pairs);
    let whiteness = ljung_box(&correlation, &pairs);
    let last = whiteness.last().filter(|of| !of.p_value.is_nan());
    let truth = &plan.channels[truth.slot];
    Residuals {
        prediction: plan.channels[of.slot].name.clone(),
        truth: truth.name.clone(),
        unit: truth.channel.unit.difference().to_string(),
        n: count,
        rms: (present.iter().map(|e| e * e).sum::<f64>() / count as f64).sqrt(),
        mean: present.iter().sum::<f64>() / count as f64,
        spacing_s: spacing.secs(),
        spaced: number,
        autocorrelation: correlation.into_iter().skip(1).collect(),
        bound: errors.iter().map(|error| NORMAL_95 * error).collect(),
        ljung_box: last.map(|of| of.statistic),
        p_value: last.map(|of| of.p_value),
        white: last.map(|of| of.p_value >= UNLIKELY),
        level: UNLIKELY,
    }
}

/// The first value of every stretch of `spacing`, none nearer than `apart` to the one before; NaN where there is none. Segments
/// stand far apart, and no pause is longer than the longest lag.
fn spaced(
    observation: &Observation,
    truth: &TruthTrace,
    values: &[f64],
    (spacing, apart): (Duration, Duration),
) -> Vec<f64> {
    let mut spaced: Vec<f64> = Vec::new();
    // Of the last value that was taken: its segment, instant and place since the segment began.
    let mut last: Option<(u32, Instant, i64)> = None;
    for (&(of, at), &value) in truth.times.iter().zip(values) {
        let first = observation.segments.get(of as usize).copied().flatten();
        let Some((first, _)) = first.filter(|_| !value.is_nan()) else {
            continue;
        };
        // Instants lie in the middle of places, so that small shifts of a regular one change nothing. Nothing is spaced where
        // each segment has one truth at most, at an instant and of no horizon.
        let since = (at - first).as_ns() + spacing.as_ns() / 2;
        let place = since.checked_div(spacing.as_ns()).unwrap_or(0);
        let empty = match last {
            Some((before, then, taken)) if before == of => {
                if place <= taken || at - then < apart {
                    continue;
                }
                (place - taken - 1).min(MOST_LAGS as i64)
            }
            Some(_) => MOST_LAGS as i64,
            None => 0,
        };
        last = Some((of, at, place));
        spaced.resize(spaced.len() + empty as usize, f64::NAN);
        spaced.push(value);
    }
    spaced
}
