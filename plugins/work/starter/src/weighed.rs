//! Weighs widths of the drift window by what a linear fit makes of them: how much of the drift over one common window, the widest, the
//! rates that it predicts amount to in cross-validation. How the widths are found is decided elsewhere.
//!
//! A wider window has less noise to be fitted and smooths the drift away, a narrower one the other way round. Which of the two costs more
//! depends on the machine, and shows only where all are held against the same truth. A slope is the rate in the middle of its window.

use std::ops::Range;

use athermal_analysis::diagnosis::noise::spread;
use athermal_numerics::{Gram, LeastSquares, generalised_cross_validation, logarithmic_grid};

use super::survey::Series;
use super::window::HARMONICS;

/// Windows of a cause, in drift windows: half of it, and those that a starter's graph reaches up to.
const WINDOWS: [f64; 4] = [0.5, 1.0, HARMONICS[1], HARMONICS[3]];
/// Instants that are compared at most, the newest, and at least.
const MOST_INSTANTS: f64 = 5_000.0;
const FEWEST_INSTANTS: u64 = 120;
/// Samples of a window that its slope is made of at most, evenly over it.
const MOST_SAMPLES: usize = 40;
/// Into how many parts the log is cut; each is predicted by a fit on the others.
const PARTS: usize = 5;
/// A width is better that explains such a share more.
const WORTH: f64 = 1.01;
/// A truth so many times as large as is usual is no drift: a zeroing, say.
const FAR: f64 = 6.0;

/// What widths explain.
#[derive(Debug, Default)]
pub struct Weighed {
    /// Each width in s, with the share of the squares of the drift over the common window that its fit explains in parts that it has
    /// not seen, as a mean over what drifts.
    pub widths: Vec<(f64, f64)>,
    /// The width that is best, where it explains a hundredth more than the one beside which it was weighed, and more by a standard error.
    pub better_s: Option<f64>,
}

/// The slope of a series over the window up to an instant, per s; NaN where its samples span less than half of it.
fn slope(series: &Series, until_s: f64, width_s: f64) -> f64 {
    let up_to = |at_s: f64| series.time_s.partition_point(|time_s| *time_s <= at_s);
    let (from, to) = (up_to(until_s - width_s), up_to(until_s));
    let rows = || (from..to).step_by((to - from).div_ceil(MOST_SAMPLES).max(1));
    let count = rows().count() as f64;
    let mean = |of: &[f64]| rows().map(|row| of[row]).sum::<f64>() / count;
    let (time_s, value) = (mean(&series.time_s), mean(&series.values));
    let (mut squares, mut products) = (0.0, 0.0);
    for row in rows() {
        let apart_s = series.time_s[row] - time_s;
        squares += apart_s * apart_s;
        products += apart_s * (series.values[row] - value);
    }
    match count >= 3.0 && series.time_s[to - 1] - series.time_s[from] >= width_s / 2.0 {
        true => products / squares,
        false => f64::NAN,
    }
}

/// The squares that a fit leaves of a truth in each part, and the squares of the truth.
type Left = [[f64; 2]; PARTS];

/// The slopes of causes up to instants, by width: what drifts beside each other has the same, mostly.
#[derive(Default)]
struct Slopes {
    instants: Vec<f64>,
    of_widths: Vec<Vec<Vec<f64>>>,
}

impl Slopes {
    fn of(&mut self, causes: &[&Series], instants: &[f64], widths: &[f64]) -> &[Vec<Vec<f64>>] {
        if self.instants != instants {
            let of = |at_s: f64, width_s: f64| {
                let windows = WINDOWS.iter().map(|times| times * width_s);
                let slopes = |window_s| causes.iter().map(move |of| slope(of, at_s, window_s));
                windows.flat_map(slopes).collect()
            };
            let of_width =
                |&width_s: &f64| instants.iter().map(|&at_s| of(at_s, width_s)).collect();
            self.of_widths = widths.iter().map(of_width).collect();
            self.instants = instants.to_vec();
        }
        &self.of_widths
    }
}

/// Instants with what a width is fitted on.
struct Rows<'a> {
    time_s: Vec<f64>,
    regressors: Vec<&'a [f64]>,
    truth: Vec<f64>,
}

impl<'a> Rows<'a> {
    fn of(drifting: &Series, causes: &'a [Vec<f64>], width_s: f64, instants: &[f64]) -> Self {
        let rows = (instants.iter().zip(causes))
            .map(|(&at_s, slopes)| (at_s, &**slopes, slope(drifting, at_s, width_s)));
        let whole = rows.filter(|(_, slopes, truth)| {
            truth.is_finite() && slopes.iter().all(|of| of.is_finite())
        });
        let (mut time_s, mut regressors, mut truth) = (Vec::new(), Vec::new(), Vec::new());
        for row in whole {
            time_s.push(row.0);
            regressors.push(row.1);
            truth.push(row.2);
        }
        Self {
            time_s,
            regressors,
            truth,
        }
    }

    /// The rows of a part of the time between two instants, without its last `less_s`.
    fn part(&self, (first_s, last_s): (f64, f64), part: usize, less_s: f64) -> Range<usize> {
        let edge = |nth: usize| first_s + (last_s - first_s) * nth as f64 / PARTS as f64;
        let row = |at_s: f64| self.time_s.partition_point(|time_s| *time_s < at_s);
        let from = row(edge(part));
        from..row(edge(part + 1) - less_s).max(from)
    }

    /// What each row is predicted as by a fit on the other parts, no truth of which shares a sample with it.
    fn predicted(&self, between: (f64, f64), usual: f64, less_s: f64) -> Option<Vec<f64>> {
        let width = self.regressors.first()?.len();
        let columns: Vec<usize> = (0..width).collect();
        let mut of_parts = vec![Gram::new(width); PARTS];
        for (part, gram) in of_parts.iter_mut().enumerate() {
            for row in self.part(between, part, less_s) {
                if self.truth[row].abs() <= FAR * usual {
                    gram.push(self.regressors[row], self.truth[row]);
                }
            }
        }
        let mut predicted = Vec::with_capacity(self.truth.len());
        for part in 0..PARTS {
            let mut gram = Gram::new(width);
            for (_, other) in of_parts.iter().enumerate().filter(|(nth, _)| *nth != part) {
                gram.merge(other).ok()?;
            }
            if gram.count() < FEWEST_INSTANTS {
                return None;
            }
            let scale = |of: &f64| if *of > 0.0 { of.sqrt() } else { 1.0 };
            let scales: Vec<f64> = gram.variances()[..width].iter().map(scale).collect();
            let penalties = logarithmic_grid(1e-3 * gram.weight(), gram.weight(), 1);
            let scores = generalised_cross_validation(&gram, &columns, &scales, &penalties).ok()?;
            let pairs = penalties.iter().zip(scores);
            let (penalty, _) = pairs.min_by(|a, b| a.1.total_cmp(&b.1))?;
            let ridge = LeastSquares::ridge(*penalty);
            let fit = ridge.solve(&gram, &columns, &scales, None).ok()?;
            let rows = self.part(between, part, 0.0);
            predicted.extend(rows.map(|row| fit.predict(self.regressors[row])));
        }
        Some(predicted)
    }
}

/// The slope over a window of what rates amount to, each in the middle of its own window: their mean, weighted as a line through what
/// they amount to weighs them, `u(W − u)` at `u` of a window `W`. NaN where half of them are missing.
fn amounts_to(
    rates: (&[f64], &[f64]),
    own_s: f64,
    (from_s, to_s): (f64, f64),
    every_s: f64,
) -> f64 {
    let (time_s, rates) = rates;
    let row = |at_s: f64| time_s.partition_point(|time_s| *time_s <= at_s + own_s / 2.0);
    let (mut sum, mut weights) = (0.0, 0.0);
    let rows = row(from_s)..row(to_s);
    for row in rows.clone() {
        let at_s = time_s[row] - own_s / 2.0;
        let weight = (at_s - from_s) * (to_s - at_s);
        (sum, weights) = (sum + weight * rates[row], weights + weight);
    }
    match rows.len() as f64 * every_s >= (to_s - from_s) / 2.0 {
        true => sum / weights,
        false => f64::NAN,
    }
}

/// What fits of each width leave of one series.
fn of_series(
    drifting: &Series,
    causes: &[&Series],
    slopes: &mut Slopes,
    widths: &[f64],
) -> Option<Vec<Left>> {
    let narrowest_s = widths.first()?;
    let widest_s = widths.last()?;
    let every_s = (narrowest_s / 4.0).max(drifting.interval_s()?);
    let last_s = *drifting.time_s.last()?;
    let first_s = drifting
        .time_s
        .first()?
        .max(last_s - MOST_INSTANTS * every_s);
    let mut next_s = first_s;
    let mut instants: Vec<f64> = Vec::new();
    for &time_s in &drifting.time_s {
        if time_s >= next_s {
            instants.push(time_s);
            next_s = time_s + 0.99 * every_s;
        }
    }
    let truth = |&at_s: &f64| slope(drifting, at_s, *widest_s);
    let truths: Vec<f64> = instants.iter().map(truth).collect();
    let usual = spread(truths.iter().copied().filter(|of| of.is_finite()));
    let mut of_widths: Vec<Vec<f64>> = Vec::new();
    for (&width_s, slopes) in widths.iter().zip(slopes.of(causes, &instants, widths)) {
        let rows = Rows::of(drifting, slopes, width_s, &instants);
        let own = spread(rows.truth.iter().copied());
        let rates = rows.predicted((first_s, last_s + every_s), own, *widest_s)?;
        let amount = |&at_s: &f64| {
            amounts_to(
                (&rows.time_s, &rates),
                width_s,
                (at_s - widest_s, at_s),
                every_s,
            )
        };
        of_widths.push(instants.iter().map(amount).collect());
    }
    let mut left = vec![Left::default(); widths.len()];
    let mut count = 0;
    for (nth, (&at_s, &truth)) in instants.iter().zip(&truths).enumerate() {
        let is_whole = of_widths.iter().all(|of| of[nth].is_finite());
        // Written so that NaN fails.
        if !(is_whole && truth.abs() <= FAR * usual) {
            continue;
        }
        count += 1;
        let part = PARTS as f64 * (at_s - first_s) / (last_s - first_s);
        for (left, of) in left.iter_mut().zip(&of_widths) {
            let [squares, all] = &mut left[(part as usize).min(PARTS - 1)];
            *squares += (truth - of[nth]).powi(2);
            *all += truth * truth;
        }
    }
    (count >= FEWEST_INSTANTS).then_some(left)
}

impl Weighed {
    /// Weighs widths, the narrowest first, beside one of them; nothing where the log is too short for it.
    #[must_use]
    pub fn of(drifting: &[&Series], causes: &[&Series], widths: &[f64], beside_s: f64) -> Self {
        let here = widths.iter().position(|width_s| *width_s == beside_s);
        let Some(here) = here.filter(|_| widths.len() > 1) else {
            return Self::default();
        };
        let mut slopes = Slopes::default();
        let of_series = |of: &&Series| of_series(of, causes, &mut slopes, widths);
        let of_all: Vec<Vec<Left>> = drifting.iter().filter_map(of_series).collect();
        if of_all.is_empty() {
            return Self::default();
        }
        // Of each part of each series, the share of the squares of all parts that a width explains.
        let explained = |nth: usize| {
            let of_one = move |of: &Vec<Left>| {
                let all: f64 = of[nth].iter().map(|[_, all]| all).sum();
                let of_part =
                    move |[left, of_part]: [f64; 2]| PARTS as f64 * (of_part - left) / all;
                of[nth].map(of_part)
            };
            of_all.iter().flat_map(of_one).collect::<Vec<f64>>()
        };
        let mean = |of: &[f64]| of.iter().sum::<f64>() / of.len() as f64;
        let shares: Vec<Vec<f64>> = (0..widths.len()).map(explained).collect();
        let means = widths.iter().zip(&shares);
        let means: Vec<(f64, f64)> = means.map(|(&of, shares)| (of, mean(shares))).collect();
        let best = (0..widths.len()).max_by(|&a, &b| means[a].1.total_cmp(&means[b].1));
        let better = best.filter(|&best| {
            let pairs = shares[best].iter().zip(&shares[here]);
            let more: Vec<f64> = pairs.map(|(best, here)| best - here).collect();
            let by = mean(&more);
            let squares = more.iter().map(|of| (of - by).powi(2)).sum::<f64>();
            let count = more.len() as f64;
            let is_worth_it = means[best].1 > WORTH * means[here].1.max(0.0);
            is_worth_it && by > (squares / (count - 1.0) / count).sqrt()
        });
        Self {
            better_s: better.map(|nth| widths[nth]),
            widths: means,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use athermal_core::prng::Prng;

    /// A temperature and a position each 10 s for two days: a room that swings within so many minutes, and a body that follows it at once.
    fn logged(swing_s: f64, noise: f64) -> [Series; 2] {
        let mut random = Prng::stream(1, "weighed");
        let mut log = [Series::default(), Series::default()];
        let (keep, mut room) = ((-10.0 / swing_s).exp(), 0.0);
        for row in 0..17_280 {
            room = keep * room + (1.0 - keep * keep).sqrt() * random.normal();
            let values = [
                room + 1e-3 * random.normal(),
                100.0 * room + noise * random.normal(),
            ];
            for (of, value) in log.iter_mut().zip(values) {
                of.time_s.push(10.0 * f64::from(row));
                of.values.push(value);
            }
        }
        log
    }

    fn weighed(swing_s: f64, noise: f64, beside_s: f64) -> Weighed {
        let [cause, drifting] = logged(swing_s, noise);
        Weighed::of(&[&drifting], &[&cause], &[60.0, 120.0, 300.0], beside_s)
    }

    #[test]
    fn a_width_stays_while_no_other_explains_more_of_the_drift() {
        let found = weighed(1800.0, 1.0, 120.0);
        assert_eq!(found.better_s, None, "{found:?}");
        assert!(found.widths[1].1 > 0.95, "{found:?}");
    }

    #[test]
    fn a_fast_drift_is_explained_best_by_a_narrow_window_and_one_that_noise_hides_by_a_wide_one() {
        for (swing_s, noise, from_s, best_s) in
            [(60.0, 0.1, 300.0, 120.0), (7200.0, 200.0, 120.0, 300.0)]
        {
            let found = weighed(swing_s, noise, from_s);
            assert_eq!(found.better_s, Some(best_s), "{found:?}");
        }
    }
}
