//! How high a drift stands above its standard error, against the window that it is taken over (Mandelli, Dankwart and Napoli,
//! Fig. 2).
//!
//! A wider window has less noise in its slope (as `T^−3/2` for evenly spaced samples) but smooths the drift away. The spread of the
//! slope is set against its standard error from the residuals of its own lines. These hold the bend of the drift beside the noise
//! of the samples, so that the figure is rather too low than too high.

use athermal_core::compile::{Plan, PlannedRole};
use athermal_core::engine::Engine;
use athermal_core::node::Duty;
use athermal_core::time::Instant;
use athermal_core::unit::Unit;
use athermal_run::fit::FitError;
use athermal_run::model::Model;
use athermal_run::recording::{Event, Recording};
use athermal_run::score::trace;
use serde::Serialize;

/// Samples that the narrowest window holds on the average, four but for rounding.
pub const FEWEST_SAMPLES: f64 = 3.9;
/// The widest window fits so many times into the recording.
pub const WINDOWS_IN_RECORDING: f64 = 20.0;

/// The share of a window that its samples span, as a slope asks for without another word.
const LEAST_COVERED: f64 = 0.5;

/// A truth's drift against its window.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Windows {
    /// The truth: `drift.Z1`.
    pub truth: String,
    /// Its unit.
    pub unit: String,
    /// The window that the graph has, in s.
    pub window_s: f64,
    /// Every window that was tried.
    pub widths: Vec<Width>,
}

/// A drift over windows of one width.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Width {
    /// The width in s.
    pub window_s: f64,
    /// Root mean square of the slopes, in the unit of the truth.
    pub drift: f64,
    /// Root mean square of their standard errors, in the unit of the truth.
    pub noise: f64,
    /// The spread of the drift without its noise, over its noise.
    pub ratio: f64,
}

/// A measured series: instants in s, from its first one, and values.
#[derive(Debug, Clone, Default)]
struct Measured {
    began: Option<Instant>,
    time_s: Vec<f64>,
    values: Vec<f64>,
}

/// The drift of every truth that is a slope, over windows of every width that fits.
///
/// # Errors
/// When the recording cannot be read, or the fit does not belong to the graph.
pub fn windows(model: &Model, recording: &dyn Recording) -> Result<Vec<Windows>, FitError> {
    let plan = &*model.plan;
    let mut truths: Vec<usize> = plan.channels.iter().filter_map(|of| of.predicts).collect();
    truths.sort_unstable();
    truths.dedup();
    let pairs = truths
        .into_iter()
        .filter_map(|of| Some((of, measured_by(plan, of)?)));
    let pairs: Vec<(usize, usize)> = pairs.collect();
    let mut series = vec![vec![Measured::default()]; pairs.len()];
    let mut look = |engine: &Engine, event: Event| {
        for (segments, &(_, slot)) in series.iter_mut().zip(&pairs) {
            match (event, segments.last_mut()) {
                (Event::Row(now), Some(segment)) if !engine.value(slot).is_nan() => {
                    let began = *segment.began.get_or_insert(now);
                    segment.time_s.push((now - began).secs());
                    segment.values.push(engine.value(slot));
                }
                (Event::Segment, _) => segments.push(Measured::default()),
                _ => {}
            }
        }
    };
    trace(&model.plan, &model.fitted, recording, &mut look)?;
    let facts = pairs.iter().zip(&series).map(|(&(truth, slot), segments)| {
        let truth = &plan.channels[truth];
        let per_second = plan.channels[slot].channel.unit.difference();
        let per_second = per_second.per(&Unit::second());
        let factor = per_second.factor_to(&truth.channel.unit);
        // What is measured may have a span of its own, of which no wider or narrower window is made.
        let own = truth.channel.span - plan.channels[slot].channel.span;
        Windows {
            truth: truth.name.clone(),
            unit: truth.channel.unit.to_string(),
            window_s: own.secs(),
            widths: widths(segments, own.secs(), factor.unwrap_or(f64::NAN)),
        }
    });
    Ok(facts.collect())
}

/// Whether any truth that is predicted is a slope, and so has a window.
#[must_use]
pub fn any(plan: &Plan) -> bool {
    let mut truths = plan.channels.iter().filter_map(|of| of.predicts);
    truths.any(|truth| measured_by(plan, truth).is_some())
}

fn widths(segments: &[Measured], own_s: f64, factor: f64) -> Vec<Width> {
    let long = segments.iter().filter(|of| of.time_s.len() > 1);
    let (mut length, mut count) = (0.0, 0.0);
    for segment in long {
        length += segment.time_s[segment.time_s.len() - 1] - segment.time_s[0];
        count += segment.time_s.len() as f64 - 1.0;
    }
    let fits = FEWEST_SAMPLES * length / count..=length / WINDOWS_IN_RECORDING;
    let mut tried: Vec<f64> = nice_widths().filter(|width| fits.contains(width)).collect();
    if !tried.contains(&own_s) {
        tried.push(own_s);
        tried.sort_by(f64::total_cmp);
    }
    let width = |&window_s: &f64| {
        let mut drift = Drift::default();
        for segment in segments {
            drift.add(&segment.time_s, &segment.values, window_s);
        }
        Width {
            window_s,
            drift: factor * drift.spread(),
            noise: factor * drift.noise(),
            ratio: drift.ratio(),
        }
    };
    tried.iter().map(width).collect()
}

/// The slot that a truth is the slope of.
pub(crate) fn measured_by(plan: &Plan, truth: usize) -> Option<usize> {
    let node = &plan.nodes[plan.channels[truth].node?];
    let PlannedRole::Feature { gathers, .. } = &node.role else {
        return None;
    };
    let entries = &plan.gathers[*gathers.first()?].entries;
    // Each channel has a slope for every window.
    let (_, slopes) = node
        .ports
        .first()
        .filter(|_| node.kind.duty() == Duty::Slope)?;
    let place = truth.checked_sub(slopes.start)? * entries.len();
    entries
        .get(place.checked_div(slopes.len())?)
        .map(|of| of.slot)
}

/// Round lengths from a hundredth of a second to a quarter of a year, as people choose windows; in s.
pub fn nice_widths() -> impl Iterator<Item = f64> {
    const STEPS: [f64; 12] = [
        1.0, 2.0, 3.0, 5.0, 8.0, 10.0, 15.0, 20.0, 30.0, 40.0, 50.0, 60.0,
    ];
    let below_a_second = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5].into_iter();
    let seconds = STEPS.into_iter();
    let minutes = STEPS
        .into_iter()
        .skip(1)
        .map(|step| 60.0 * step)
        .chain([5400.0]);
    let hours = [2.0, 3.0, 4.0, 6.0, 8.0, 12.0];
    let days = [1.0, 2.0, 3.0, 4.0, 5.0, 7.0, 14.0, 30.0, 60.0, 90.0];
    below_a_second
        .chain(seconds)
        .chain([90.0])
        .chain(minutes)
        .chain(hours.into_iter().map(|step| 3600.0 * step))
        .chain(days.into_iter().map(|step| 86_400.0 * step))
}

/// The slopes of a series over windows of one width.
#[derive(Debug, Clone, Default)]
pub struct Drift {
    squares: f64,
    noise_squares: f64,
    sizes: Vec<f64>,
}

impl Drift {
    /// Of one series: instants in s, counted from near its first one, and values.
    #[must_use]
    pub fn of(times: &[f64], values: &[f64], width_s: f64) -> Self {
        let mut drift = Self::default();
        drift.add(times, values, width_s);
        drift
    }

    /// Adds a series. Windows overlap by three quarters on the average: they are taken every so many samples, as truths come, and not
    /// after so much time, or those after a gap, which are sparse, would be taken too often.
    fn add(&mut self, times: &[f64], values: &[f64], width_s: f64) {
        let [first, .., last] = times else {
            return;
        };
        // Whole nanoseconds: which samples a window holds is not for the rounding of seconds to decide.
        let ns = |seconds: f64| (seconds * 1e9).round() as i64;
        let at: Vec<i64> = times.iter().map(|time| ns(time - first)).collect();
        let width = ns(width_s);
        let apart_s = (last - first) / (times.len() - 1) as f64;
        let every = (width_s / 4.0 / apart_s - 1e-6).ceil().max(1.0) as usize;
        let begin = at.partition_point(|&at| at < width);
        let mut from = 0;
        for to in (begin..times.len()).step_by(every) {
            while at[from] <= at[to] - width {
                from += 1;
            }
            if ((at[to] - at[from]) as f64) < LEAST_COVERED * width as f64 {
                continue;
            }
            let Some((slope, error)) = line(&times[from..=to], &values[from..=to]) else {
                continue;
            };
            self.squares += slope * slope;
            self.noise_squares += error * error;
            self.sizes.push(slope.abs());
        }
    }

    fn windows(&self) -> f64 {
        self.sizes.len().max(1) as f64
    }

    /// Root mean square of the slopes, per s.
    #[must_use]
    pub fn spread(&self) -> f64 {
        (self.squares / self.windows()).sqrt()
    }

    /// Root mean square of their standard errors, per s.
    #[must_use]
    pub fn noise(&self) -> f64 {
        (self.noise_squares / self.windows()).sqrt()
    }

    /// Spread of the drift without its noise, over its noise.
    #[must_use]
    pub fn ratio(&self) -> f64 {
        if self.noise_squares <= 0.0 {
            return if self.squares > 0.0 {
                f64::INFINITY
            } else {
                0.0
            };
        }
        (self.squares / self.noise_squares - 1.0).max(0.0).sqrt()
    }
}

/// Least-squares slope and its standard error from the residuals; none for less than three samples.
fn line(times: &[f64], values: &[f64]) -> Option<(f64, f64)> {
    let n = times.len() as f64;
    if times.len() < 3 {
        return None;
    }
    let (time, value) = (
        times.iter().sum::<f64>() / n,
        values.iter().sum::<f64>() / n,
    );
    let (mut tt, mut tv, mut vv) = (0.0, 0.0, 0.0);
    for (t, v) in times.iter().zip(values) {
        tt += (t - time) * (t - time);
        tv += (t - time) * (v - value);
        vv += (v - value) * (v - value);
    }
    let slope = tv / tt;
    let residual = (vv - slope * tv).max(0.0);
    Some((slope, (residual / (n - 2.0) / tt).sqrt()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A sine of 1 per s at most, with a deterministic disturbance of ±`noise`, once in a second.
    fn series(noise: f64) -> Measured {
        let time_s: Vec<f64> = (0..5000).map(f64::from).collect();
        let values = time_s
            .iter()
            .enumerate()
            .map(|(i, t)| {
                // The bits of a multiplicative hash stand in for noise.
                let bit = (i as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 63;
                (t / 100.0).sin() * 100.0 + if bit == 1 { noise } else { -noise }
            })
            .collect();
        Measured {
            time_s,
            values,
            ..Measured::default()
        }
    }

    fn drift(noise: f64, width_s: f64) -> Drift {
        let Measured { time_s, values, .. } = series(noise);
        Drift::of(&time_s, &values, width_s)
    }

    #[test]
    fn a_line_has_its_slope_and_no_error() {
        let (slope, error) = line(&[0.0, 1.0, 2.0, 4.0], &[1.0, 3.0, 5.0, 9.0]).unwrap();
        assert_eq!((slope, error), (2.0, 0.0));
        assert!(line(&[0.0, 1.0], &[0.0, 1.0]).is_none());
    }

    #[test]
    fn the_error_of_a_slope_is_that_of_the_textbook() {
        // Residuals of 1, −1, −1, 1 about a level line: SSE 4, n − 2 = 2, Sxx 5.
        let (slope, error) = line(&[0.0, 1.0, 2.0, 3.0], &[1.0, -1.0, -1.0, 1.0]).unwrap();
        assert!(slope.abs() < 1e-15);
        assert!((error - (2.0_f64 / 5.0).sqrt()).abs() < 1e-15);
    }

    #[test]
    fn the_spread_of_a_sine_is_its_amplitude_over_the_root_of_two() {
        let spread = drift(0.0, 10.0).spread();
        assert!((spread - 0.5_f64.sqrt()).abs() < 0.02, "{spread}");
    }

    #[test]
    fn wider_windows_stand_higher_above_the_same_noise_until_they_smooth_the_drift_away() {
        let ratio = |width| drift(5.0, width).ratio();
        assert!(ratio(10.0) < ratio(20.0) && ratio(20.0) < ratio(40.0));
        assert!(ratio(600.0) < ratio(100.0));
    }

    #[test]
    fn a_window_holds_the_same_samples_wherever_times_are_counted_from() {
        let values: Vec<f64> = (0..4000).map(|nth| f64::from(nth % 7)).collect();
        let noise = |from_s: f64| {
            let times = (0..4000).map(|nth| from_s + f64::from(nth) * 0.02);
            Drift::of(&times.collect::<Vec<_>>(), &values, 0.1).noise()
        };
        let (here, later) = (noise(0.0), noise(1000.0));
        assert!((here / later - 1.0).abs() < 1e-9, "{here} {later}");
        let five: Vec<f64> = (0..5).map(|nth| 0.02 * f64::from(nth)).collect();
        let all: Vec<f64> = (5..4000)
            .map(|last| line(&five, &values[last - 4..=last]).unwrap().1)
            .collect();
        let mean = (all.iter().map(|error| error * error).sum::<f64>() / all.len() as f64).sqrt();
        assert!((here / mean - 1.0).abs() < 1e-3, "{here} {mean}");
    }

    #[test]
    fn samples_that_come_anyhow_have_the_noise_of_all_windows_that_a_slope_would_have() {
        let bits = |nth: u64| {
            (nth + 1)
                .wrapping_mul(0x9e37_79b9_7f4a_7c15)
                .rotate_left(17)
                ^ nth
        };
        let hash = |nth: u64| bits(bits(nth)).wrapping_mul(0xff51_afd7_ed55_8ccd);
        let there = (0..20_000_u64).filter(|&nth| hash(nth) >> 61 == 0);
        let (times, values): (Vec<f64>, Vec<f64>) = there
            .map(|nth| {
                let sign = if hash(nth) & (1 << 40) == 0 {
                    5.0
                } else {
                    -5.0
                };
                (10.0 * nth as f64, sign)
            })
            .unzip();
        let mut squares = Vec::new();
        for (to, &end) in times.iter().enumerate() {
            let from = times.partition_point(|&time| time <= end - 300.0);
            let covers = end - times[from] >= 150.0 && end >= times[0] + 300.0;
            if let Some((_, error)) = line(&times[from..=to], &values[from..=to])
                && covers
            {
                squares.push(error * error);
            }
        }
        let all = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
        let found = Drift::of(&times, &values, 300.0).noise();
        assert!((found / all - 1.0).abs() < 0.05, "{found} {all}");
    }
}
