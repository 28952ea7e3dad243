//! By how much the clock of one logger differs from that of others: the shift of its times at which fits explain most.

use std::collections::BTreeMap;

use athermal_core::compile::Plan;
use athermal_core::time::Duration;
use athermal_run::fit::{FitError, FitOptions, Outcome, fit};
use athermal_run::model::Model;
use athermal_run::recording::Recording;
use serde::Serialize;

/// Shifts to either side that are tried at first.
const SHIFTS: i64 = 30;
/// How often the shift is then halved.
const HALVINGS: u32 = 7;
/// By how much the deviance rises two standard errors away from the best shift.
const RISE: f64 = 4.0;
/// A shift at which the errors of a fit are larger by less than this share explains as well: what slopes and lags can express, a fit
/// takes for a delay of the machine.
const AS_WELL: f64 = 0.02;

/// What is to be added to the times of a logger.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Offset {
    /// In s.
    pub offset_s: f64,
    /// Its standard error in s; none where fits hardly change with it.
    pub error_s: Option<f64>,
    /// All shifts between these, in s, explain as well.
    pub from_s: f64,
    /// The last of them.
    pub to_s: f64,
    /// Whether it differs from none: by more than two standard errors, and none does not explain as well.
    pub is_significant: bool,
}

/// For each estimator its truth, and how unlikely its rows are: n ln of the mean square.
type Deviances = BTreeMap<String, (String, f64)>;

/// Fits the graph of a model with a logger shifted by one time after the other. `shifted` gives the recording for a shift. None
/// where no fit changes, or no estimator predicts the present: the fit of a forecast gains by a shift of its horizon. A lag of the
/// machine that the graph cannot express counts as one of the clocks.
///
/// The standard error is that of maximum likelihood, by the curvature of the deviance. Wider than that is what lies between the shifts
/// that explain as well, which slopes and lags of the graph take for a delay. Of truths whose windows overlap only as many
/// count as lie side by side.
///
/// # Errors
/// When a recording cannot be read, but for shifts by which loggers have no time in common.
pub fn offset<R: Recording>(
    model: &Model,
    shifted: &dyn Fn(Duration) -> R,
    progress: &mut dyn FnMut(u64, u64),
) -> Result<Option<Offset>, FitError> {
    let plan = &model.plan;
    let options = FitOptions::default();
    let (fits, mut done) = (2 * SHIFTS as u64 + 2 * u64::from(HALVINGS) + 1, 0);
    let (_, report) = fit(plan, &shifted(Duration::ZERO), &options, &mut |_| {})?;
    let Some((from, to)) = report.period else {
        return Ok(None);
    };
    let length = to - from;
    let rows = report.estimators.iter().map(|fit| fit.rows).max();
    let between = length.as_ns() / rows.unwrap_or(0).max(1) as i64;
    // By whole steps from row to row, so that rows which stand side by side do so again.
    let row = length.as_ns() / (report.ticks as i64 - 1).max(1);
    let between = row.max(1) * ((between + row / 2) / row.max(1)).max(1);
    let spans = report.estimators.iter().map(|fit| span(plan, &fit.truth));
    let widest = spans.max().map_or(0, |span| span.as_ns());
    let step = (widest / 8).max(between).min(length.as_ns() / 100).max(1);
    let is_now = |node: &str| {
        let mut nodes = plan.nodes.iter();
        let node = nodes.find(|of| of.instance() == node);
        let link = node.and_then(|of| of.role.truth());
        link.is_some_and(|link| link.ahead == Duration::ZERO)
    };
    let now = report.estimators.iter().filter(|fit| is_now(&fit.node));
    let counts = now.map(|fit| {
        let side_by_side = length.as_ns() / span(plan, &fit.truth).as_ns().max(1);
        (fit.node.clone(), (fit.rows as f64).min(side_by_side as f64))
    });
    let counts: BTreeMap<String, f64> = counts.collect();
    if counts.is_empty() {
        return Ok(None);
    }
    // What is not looked at need not be fitted over and over.
    let options = FitOptions {
        only: Some(counts.keys().cloned().collect()),
        ..options
    };
    let mut deviances = |shift: i64| -> Option<Deviances> {
        progress(done, fits);
        done += 1;
        let recording = shifted(Duration::from_ns(shift));
        let (_, report) = fit(plan, &recording, &options, &mut |_| {}).ok()?;
        let of = report.estimators.into_iter().filter_map(|fit| {
            let Outcome::Fitted(trained) = &fit.outcome else {
                return None;
            };
            let mean_square = trained.in_sample_rmse?.powi(2);
            let deviance = counts.get(&fit.node)? * mean_square.max(f64::MIN_POSITIVE).ln();
            Some((fit.node, (fit.truth, deviance)))
        });
        Some(of.collect())
    };
    let tried: Vec<(i64, Deviances)> = (-SHIFTS..=SHIFTS)
        .filter_map(|nth| Some((nth * step, deviances(nth * step)?)))
        .collect();
    let told = telling(&tried);
    let total = |of: &Deviances| -> f64 {
        let each = told.iter().map(|node| of.get(node));
        each.map(|of| of.map_or(f64::INFINITY, |(_, deviance)| *deviance))
            .sum()
    };
    let Some(best) = tried
        .iter()
        .map(|(shift, of)| (total(of), *shift))
        .min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.abs().cmp(&b.1.abs())))
        .filter(|(least, _)| !told.is_empty() && least.is_finite())
    else {
        return Ok(None);
    };
    // All that lies side by side around the best and explains as well.
    let worth: f64 = told.iter().filter_map(|node| counts.get(node)).sum();
    let explains = |of: &Deviances| total(of) - best.0 <= RISE.max(2.0 * worth * AS_WELL.ln_1p());
    let around = tried.iter().position(|(shift, _)| *shift == best.1);
    let around = around.unwrap_or(0);
    let before = tried[..=around].iter().rev();
    let before = before.take_while(|(_, of)| explains(of)).last();
    let behind = tried[around..].iter();
    let behind = behind.take_while(|(_, of)| explains(of)).last();
    let [from, to] = [before, behind].map(|of| of.map_or(best.1, |(shift, _)| *shift));
    let mut at = |shift: i64| deviances(shift).map_or(f64::INFINITY, |of| total(&of));
    let ((mut least, mut shift), mut by, mut error) = (best, step, None);
    for _ in 0..HALVINGS {
        let sides = [at(shift - by), at(shift + by)];
        let curvature = (sides[0] - 2.0 * least + sides[1]) / (by as f64).powi(2);
        let rises = sides.iter().any(|side| side - least > RISE);
        if curvature > 0.0 && curvature.is_finite() && (rises || error.is_none()) {
            error = Some((2.0 / curvature).sqrt());
        }
        for (side, moved) in sides.into_iter().zip([shift - by, shift + by]) {
            if side < least {
                (least, shift) = (side, moved);
            }
        }
        by /= 2;
    }
    // A truth goes with the last row before it: what lies between two rows cannot be told apart. Each log has about half of all rows.
    let apart = 2.0 * length.as_ns() as f64 / report.ticks.max(1) as f64;
    let error = error.map(|error| error.hypot(apart / 12.0_f64.sqrt()));
    let seconds = |ns: f64| ns / 1e9;
    let (from, to) = (from.min(shift), to.max(shift));
    let is_apart = error.is_some_and(|error| (shift as f64).abs() > 2.0 * error);
    Ok(Some(Offset {
        offset_s: seconds(shift as f64),
        error_s: error.map(seconds),
        from_s: seconds(from as f64),
        to_s: seconds(to as f64),
        is_significant: is_apart && !(from..=to).contains(&0),
    }))
}

/// Of each truth the estimator whose fit changes most with the shift.
fn telling(tried: &[(i64, Deviances)]) -> Vec<String> {
    let mut ranges: BTreeMap<&String, (&String, f64, f64)> = BTreeMap::new();
    for (node, (truth, deviance)) in tried.iter().flat_map(|(_, of)| of) {
        let (_, low, high) = ranges.entry(node).or_insert((truth, *deviance, *deviance));
        (*low, *high) = (low.min(*deviance), high.max(*deviance));
    }
    let mut most: BTreeMap<&String, (f64, &String)> = BTreeMap::new();
    for (node, (truth, low, high)) in ranges {
        let of = most.entry(truth).or_insert((0.0, node));
        if high - low > of.0 {
            *of = (high - low, node);
        }
    }
    let told = most.into_values().filter(|(range, _)| *range > 0.0);
    told.map(|(_, node)| node.clone()).collect()
}

/// Over which time a truth is taken.
fn span(plan: &Plan, truth: &str) -> Duration {
    let mut channels = plan.channels.iter();
    let channel = channels.find(|of| of.name == truth);
    channel.map_or(Duration::ZERO, |of| of.channel.span)
}
