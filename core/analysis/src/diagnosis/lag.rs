//! How features are compared with truths and residuals over a range of lags (Mandelli, Dankwart and Napoli, Fig. 3).
//!
//! Features, truths and residuals are set on one regular grid: of a feature the last value, of a truth the next one, as long as
//! each counts. At a positive lag the truth follows the feature, so that the feature can tell of it beforehand.

use athermal_core::compile::{Plan, PlannedRole};
use athermal_core::engine::Engine;
use athermal_core::time::{Duration, Instant};
use athermal_numerics::{
    autocorrelation, bound_of_farthest, cross_correlation, cross_correlation_error,
    cross_correlation_pairs,
};
use athermal_run::fit::FitError;
use athermal_run::model::Model;
use athermal_run::recording::{Event, Recording};
use athermal_run::score::{TruthTrace, trace};
use serde::Serialize;

use super::observation::{Observation, main_prediction};
use super::reach;
use super::residual::UNLIKELY;

/// Lags to either side, at most.
const MOST_LAGS: i64 = 60;
const FEWEST_LAGS: i64 = 20;
/// Instants of the grid, at most.
const MOST_INSTANTS: i64 = 20_000;
/// Lags are shown up to this share of a recording (Box and Jenkins 1976, section 2.1.6): beyond, too little is left to compare.
const SHARE_OF_LENGTH: i64 = 4;
/// A lag at which fewer than this share of the pairs of others are left is not set against them.
const SHARE_OF_PAIRS: usize = 4;
/// Autocorrelations reach so many times further than the lags, since bounds are sums over all of them.
const REACH: usize = 4;

/// A truth's correlations with every feature that its estimators are offered.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Lags {
    /// The truth: `drift.Z1`.
    pub truth: String,
    /// The prediction whose residuals are meant.
    pub prediction: String,
    /// How far ahead of what was known it predicts, in s.
    pub ahead_s: f64,
    /// The lags in s; at a positive one the truth follows the feature.
    pub lag_s: Vec<f64>,
    /// Every feature, in the order of the graph.
    pub features: Vec<FeatureLags>,
}

/// A feature's correlations.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FeatureLags {
    /// The channel: `gradients.chuck@150s`.
    pub feature: String,
    /// With the truth: where the feature explains something of it, and when.
    pub truth: Correlogram,
    /// With what the prediction left of it (measured less predicted): beyond its bound, the feature explains something that the
    /// model does not use.
    pub residual: Correlogram,
}

/// A correlation against the lag.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Correlogram {
    /// The correlation at each lag; NaN (null in JSON) where there is none.
    pub r: Vec<f64>,
    /// The standard error of the largest if the two had nothing to do with each other, their own smoothness considered, from as
    /// many pairs as there are at its lag; where there is no largest, from those at no lag.
    pub error: f64,
    /// How many lags the largest was looked for at.
    pub looked_at: usize,
    /// What the largest of all features of the truth would not exceed in 99 of 100 recordings if they had nothing to do with it:
    /// as many standard errors as normal numbers lie from none, as many of them as lags were looked at (Bonferroni).
    pub bound: f64,
    /// The lag in s at which it is largest in size: of a residual, of those at which the feature was known when the prediction
    /// was made.
    pub best_lag_s: f64,
    /// The correlation there.
    pub best: f64,
}

impl Correlogram {
    /// Whether chance alone would hardly give a correlation as large.
    #[must_use]
    pub fn is_significant(&self) -> bool {
        self.best.abs() > self.bound
    }
}

/// Works out the correlations of every truth of a model. Truths without a feature are left out. Residuals are those of predictions
/// asked for by name, or else of what the graph puts out.
///
/// # Errors
/// When the recording cannot be read, or the fit does not belong to the graph.
pub fn lags(
    model: &Model,
    recording: &dyn Recording,
    observation: &Observation,
    of: &[String],
) -> Result<Vec<Lags>, FitError> {
    let plan = &*model.plan;
    let features: Vec<Vec<usize>> = observation
        .trace
        .truths
        .iter()
        .map(|truth| features(plan, truth.slot))
        .collect();
    let mut slots: Vec<usize> = features.iter().flatten().copied().collect();
    slots.sort_unstable();
    slots.dedup();
    let truths = &observation.trace.truths;
    let intervals = truths.iter().filter_map(Observation::interval);
    let Some(interval) = intervals.min().filter(|_| !slots.is_empty()) else {
        return Ok(Vec::new());
    };
    let pause = Duration::from_ns(interval.as_ns().saturating_mul(FEWEST_LAGS));
    let length = observation.rows.length(pause);
    let longest = Duration::from_ns(length.as_ns() / MOST_INSTANTS);
    let share = Duration::from_ns(length.as_ns() / SHARE_OF_LENGTH);
    let reach = reach::of_estimators(plan).min(share);
    let widest = Duration::from_ns(reach.as_ns() / MOST_LAGS);
    let step = interval.max(longest).max(widest).max(Duration::from_ns(1));
    let main =
        |truth: &TruthTrace| Some(truth.predictions[main_prediction(plan, truth, of)?].ahead);
    let horizons = truths.iter().filter_map(main);
    let step = horizons
        .min()
        .map_or(step, |horizon| fitted_into(horizon, step));
    let count = (reach.as_ns() / step.as_ns()).clamp(FEWEST_LAGS, MOST_LAGS) as usize;
    // Truths that come at a regular pace then lie on it.
    let firsts = truths.iter().filter_map(|truth| truth.times.first());
    let through = firsts.map(|&(_, at)| at).min();
    let mut grid = Grid::new(plan, slots, step, count, through);
    trace(
        &model.plan,
        &model.fitted,
        recording,
        &mut |engine, event| {
            grid.look(engine, event);
        },
    )?;
    let smoothness: Vec<Vec<f64>> = grid
        .series
        .iter()
        .map(|series| autocorrelation(series, REACH * count))
        .collect();
    let lag_s: Vec<f64> = (-(count as i64)..=count as i64)
        .map(|lag| lag as f64 * step.secs())
        .collect();
    let with_features = truths.iter().zip(&features);
    let facts = with_features
        .filter(|(_, features)| !features.is_empty())
        .filter_map(|(truth, features)| {
            let main = &truth.predictions[main_prediction(plan, truth, of)?];
            let left: Vec<f64> = truth
                .values
                .iter()
                .zip(&main.values)
                .map(|(y, p)| y - p)
                .collect();
            let sides = [&truth.values, &left].map(|values| {
                let series = grid.place(plan, truth, values);
                let smooth = autocorrelation(&series, REACH * count);
                (series, smooth)
            });
            let against = |slot: usize, (y, y_smooth): &(Vec<f64>, Vec<f64>), from_s: f64| {
                let place = grid.place_of(slot);
                let (x, x_smooth) = (&grid.series[place], &smoothness[place]);
                correlogram((x, x_smooth), (y, y_smooth), &lag_s, from_s)
            };
            let features = features.iter().map(|&slot| FeatureLags {
                feature: plan.channels[slot].name.clone(),
                truth: against(slot, &sides[0], f64::NEG_INFINITY),
                residual: against(slot, &sides[1], main.ahead.secs()),
            });
            let mut features: Vec<_> = features.collect();
            bound(&mut features, |of| &mut of.truth);
            bound(&mut features, |of| &mut of.residual);
            Some(Lags {
                truth: plan.channels[truth.slot].name.clone(),
                prediction: plan.channels[main.slot].name.clone(),
                ahead_s: main.ahead.secs(),
                lag_s: lag_s.clone(),
                features,
            })
        });
    Ok(facts.collect())
}

/// The step next to one given of which a horizon is a multiple, so that what was known just when a prediction was made is looked at.
fn fitted_into(horizon: Duration, step: Duration) -> Duration {
    let (horizon, nearly) = (horizon.as_ns(), step.as_ns());
    let steps = (horizon + nearly / 2) / nearly;
    if steps > 0 {
        Duration::from_ns(horizon.div_euclid(steps) + i64::from(horizon % steps > 0))
    } else {
        step
    }
}

/// Of two series, each with its autocorrelation; the largest is looked for at lags from `from_s` on.
fn correlogram(
    (x, x_smooth): (&[f64], &[f64]),
    (y, y_smooth): (&[f64], &[f64]),
    lag_s: &[f64],
    from_s: f64,
) -> Correlogram {
    let lags = lag_s.len() / 2;
    let r = cross_correlation(x, y, lags);
    let there = cross_correlation_pairs(x, y, lags);
    let most = there.iter().copied().max().unwrap_or(0);
    let counts = |&lag: &usize| SHARE_OF_PAIRS * there[lag] >= most && !r[lag].is_nan();
    let present = (0..r.len()).filter(|lag| counts(lag) && lag_s[*lag] >= from_s);
    let looked_at = present.clone().count();
    let best = present.max_by(|&a, &b| r[a].abs().total_cmp(&r[b].abs()));
    let error = cross_correlation_error(x_smooth, y_smooth, there[best.unwrap_or(lags)]);
    Correlogram {
        best_lag_s: best.map_or(f64::NAN, |best| lag_s[best]),
        best: best.map_or(f64::NAN, |best| r[best]),
        r,
        error,
        looked_at,
        bound: f64::NAN,
    }
}

/// Bounds what the largest correlations of all features come to by chance.
fn bound(features: &mut [FeatureLags], side: fn(&mut FeatureLags) -> &mut Correlogram) {
    let looked_at = features.iter_mut().map(|of| side(of).looked_at).sum();
    let errors = bound_of_farthest(looked_at, UNLIKELY);
    for of in features {
        let of = side(of);
        of.bound = errors * of.error;
    }
}

/// The channels that estimators of a truth are offered, the truth itself and predictions of it left out: those of good voters go
/// with it best, and do not show what it depends on.
fn features(plan: &Plan, truth: usize) -> Vec<usize> {
    let mut slots = Vec::new();
    for node in &plan.nodes {
        let PlannedRole::Estimator { gathers, fit, .. } = &node.role else {
            continue;
        };
        let entries = gathers
            .iter()
            .flat_map(|&gather| &plan.gathers[gather].entries);
        let of_it = |slot: usize| slot == truth || plan.channels[slot].predicts == Some(truth);
        for entry in entries.filter(|entry| fit.truth.slot == truth && !of_it(entry.slot)) {
            if !slots.contains(&entry.slot) {
                slots.push(entry.slot);
            }
        }
    }
    slots
}

/// Slots sampled at regular instants.
struct Grid {
    step: Duration,
    /// An instant that is on the grid, as far as it is continued.
    through: Option<Instant>,
    /// Instants without values between segments, and for longer pauses, so that no pair reaches across.
    apart: usize,
    slots: Vec<usize>,
    max_age: Vec<Duration>,
    held: Vec<(f64, Instant)>,
    next: Option<Instant>,
    /// Where each segment, and each part of it after a pause, begins: its segment, its first instant and its place on the grid.
    begins: Vec<(u32, Instant, usize)>,
    series: Vec<Vec<f64>>,
    segment: u32,
}

impl Grid {
    fn new(
        plan: &Plan,
        slots: Vec<usize>,
        step: Duration,
        apart: usize,
        through: Option<Instant>,
    ) -> Self {
        let max_age = |&slot: &usize| {
            let own = plan.channels[slot].channel.default_max_age();
            own.unwrap_or(step).max(step)
        };
        Self {
            step,
            apart,
            through,
            max_age: slots.iter().map(max_age).collect(),
            held: vec![(f64::NAN, Instant::MIN); slots.len()],
            next: None,
            begins: Vec::new(),
            series: vec![Vec::new(); slots.len()],
            slots,
            segment: 0,
        }
    }

    fn place_of(&self, slot: usize) -> usize {
        self.slots.binary_search(&slot).unwrap_or(0)
    }

    fn len(&self) -> usize {
        self.series.first().map_or(0, Vec::len)
    }

    fn look(&mut self, engine: &Engine, event: Event) {
        let Event::Row(now) = event else {
            self.held.fill((f64::NAN, Instant::MIN));
            self.stand_apart();
            self.segment += 1;
            return;
        };
        let longest = Duration::from_ns(self.step.as_ns().saturating_mul(self.apart as i64));
        if let Some(next) = self.next.filter(|&next| now - next > longest) {
            self.sample(next + longest);
            self.stand_apart();
        }
        if self.next.is_none() {
            let begin = self.through.map_or(now, |through| {
                let ahead = (through - now).as_ns().rem_euclid(self.step.as_ns());
                now + Duration::from_ns(ahead)
            });
            self.next = Some(begin);
            self.begins.push((self.segment, begin, self.len()));
        }
        self.sample(now - Duration::from_ns(1));
        for (held, &slot) in self.held.iter_mut().zip(&self.slots) {
            if engine.ran(slot) {
                *held = (engine.value(slot), now);
            }
        }
        self.sample(now);
    }

    /// Leaves room before what comes next.
    fn stand_apart(&mut self) {
        let empty = self.len() + self.apart;
        self.series
            .iter_mut()
            .for_each(|series| series.resize(empty, f64::NAN));
        self.next = None;
    }

    /// Writes down what is held at every instant of the grid up to one.
    fn sample(&mut self, until: Instant) {
        while let Some(at) = self.next.filter(|&at| at <= until) {
            let columns = self.series.iter_mut().zip(&self.held).zip(&self.max_age);
            for ((series, &(value, since)), &max_age) in columns {
                let counts = !value.is_nan() && at - since <= max_age;
                series.push(if counts { value } else { f64::NAN });
            }
            self.next = Some(at + self.step);
        }
    }

    /// Values of a truth's instants, each from the one before on, as far back as it counts: beside an instant of the grid stands
    /// the truth that follows it, so that no feature is set against a truth of before its time.
    fn place(&self, plan: &Plan, truth: &TruthTrace, values: &[f64]) -> Vec<f64> {
        let mut placed = vec![f64::NAN; self.len()];
        let own = plan.channels[truth.slot].channel.default_max_age();
        let held = own.unwrap_or(self.step).max(self.step);
        let step = self.step.as_ns();
        for (nth, (&(segment, at), &value)) in truth.times.iter().zip(values).enumerate() {
            let after = self
                .begins
                .partition_point(|of| (of.0, of.1) <= (segment, at));
            let Some(&(_, begin, place)) = self.begins.get(after.wrapping_sub(1)) else {
                continue;
            };
            let before = nth.checked_sub(1).map(|before| truth.times[before]);
            let since = match before {
                Some((of, before)) if of == segment => before.max(at - held),
                _ => at - held,
            };
            // The first instant of the grid after the truth before, and the last one that is not after this one.
            let first = (since - begin).as_ns().div_euclid(step) + 1;
            let end = (at - begin).as_ns().div_euclid(step) + 1;
            let room = self.end_before(after).min(placed.len());
            let from = (place + first.max(0) as usize).min(room);
            let to = (place + end.max(0) as usize).min(room);
            if from < to {
                placed[from..to].fill(value);
            }
        }
        placed
    }

    /// Where what begins before another ends.
    fn end_before(&self, next: usize) -> usize {
        let next = self.begins.get(next);
        next.map_or(self.len(), |&(_, _, place)| {
            place.saturating_sub(self.apart)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_horizon_lies_on_the_grid_of_lags() {
        let ns = Duration::from_ns;
        assert_eq!(fitted_into(ns(300_000), ns(74_800)), ns(75_000));
        assert_eq!(fitted_into(ns(100), ns(30)), ns(34));
        assert_eq!(fitted_into(ns(20), ns(75)), ns(75), "shorter than a step");
        assert_eq!(fitted_into(Duration::ZERO, ns(75)), ns(75));
    }

    #[test]
    fn the_largest_correlation_is_told_with_its_lag_and_its_bound() {
        // A square wave of irregular periods, and the same three instants later.
        let x: Vec<f64> = (0..500_u64)
            .map(|i| if (i * i / 40) % 3 == 0 { 1.0 } else { -1.0 })
            .collect();
        let y: Vec<f64> = (0..500).map(|i| -2.0 * x[(i + 497) % 500]).collect();
        let lag_s: Vec<f64> = (-20..=20).map(|lag| 10.0 * f64::from(lag)).collect();
        let smooth = autocorrelation(&x, 80);
        let all = f64::NEG_INFINITY;
        let found = correlogram((&x, &smooth), (&y, &smooth), &lag_s, all);
        assert_eq!(found.best_lag_s, 30.0);
        assert!((found.best + 1.0).abs() < 0.02, "{}", found.best);
        let later = correlogram((&x, &smooth), (&y, &smooth), &lag_s, 50.0);
        assert!(later.best_lag_s >= 50.0 && later.r == found.r);
        assert!(found.error >= 1.0 / 500.0_f64.sqrt() && found.best.abs() > 3.0 * found.error);
    }

    #[test]
    fn a_correlation_is_as_unsure_as_the_pairs_at_its_lag_are_few() {
        let noise = |i: u64| (i.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 40) as f64;
        // At no lag there are 125 pairs; one instant later the truth is there in the first half alone.
        let there = |is: bool, value: f64| if is { value } else { f64::NAN };
        let x: Vec<f64> = (1..=500_u64)
            .map(|i| there(i.is_multiple_of(4), noise(i)))
            .collect();
        let later = |i: u64| i.is_multiple_of(4) || (i % 4 == 1 && i < 250);
        let y: Vec<f64> = (1..=500).map(|i| there(later(i), noise(i - 1))).collect();
        let lag_s: Vec<f64> = (-20..=20).map(f64::from).collect();
        let white = [1.0, 0.0, 0.0];
        let found = correlogram((&x, &white), (&y, &white), &lag_s, f64::NEG_INFINITY);
        assert_eq!((found.best_lag_s, found.best), (1.0, 1.0));
        let pairs = (4..250).step_by(4).filter(|i| i + 1 < 250).count();
        assert_eq!(found.error, 1.0 / (pairs as f64).sqrt());
    }
}
