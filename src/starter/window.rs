//! Decides over which windows drift and temperatures are looked at: long enough to rise above the noise, short enough to follow.
//!
//! A wider window has less noise in its slope (as `T^−3/2` for evenly spaced samples) but smooths the drift away (Mandelli,
//! Dankwart and Napoli, Fig. 2). For each candidate width the spread of the slope is set against its standard error from
//! the residuals of its own lines; the narrowest width is chosen at which the drift stands [`ENOUGH`] times above its noise on
//! half of the channels, or where none does, the one at which it stands highest. The residuals of a line hold the bend of
//! the drift beside the noise of the samples, so that the figure is rather too low than too high.

use super::clock::Clock;
use super::column::{Column, Kind};
use super::survey::{Series, Survey};

/// Signal to noise of a drift that is enough: a fifth of its variance is then noise, `1 / (1 + 2²)`.
const ENOUGH: f64 = 2.0;
/// Samples that a drift window holds on the average, four but for rounding; and in the shortest window of a temperature.
const FEWEST: f64 = 3.9;
const FEWEST_OF_FEATURE: f64 = 3.0;
/// The log must be so many drift windows long.
const WINDOWS_IN_LOG: f64 = 20.0;
/// The longest window of a temperature may take up such a share of the log.
const SHARE_OF_LOG: f64 = 0.15;

/// How wide windows are, and what was measured to choose it.
#[derive(Debug)]
pub struct Choice {
    /// The drift window in s.
    pub drift_s: f64,
    /// The shortest window of temperatures in s.
    pub shortest_s: f64,
    /// How many harmonics the windows of temperatures have.
    pub harmonics: usize,
    /// Candidate widths in s with the signal to noise of each drifting channel.
    pub candidates: Vec<(f64, Vec<f64>)>,
    /// Root mean square of the drift per s, for each drifting channel.
    pub spread: Vec<f64>,
    /// The 99th percentile of the absolute drift per s, for each drifting channel.
    pub extreme: Vec<f64>,
    /// Whether the drift rises above its noise.
    pub enough: bool,
}

/// Roots of tan x = x over π: the windows whose spectrum shares zeros with that of a drift, per drift window.
const HARMONICS: [f64; 4] = [1.43030, 2.45902, 3.47089, 4.47741];

impl Choice {
    /// Measures the candidates and chooses.
    ///
    /// # Errors
    /// A text that says why no window fits.
    pub fn of(survey: &Survey, columns: &[Column]) -> Result<Self, String> {
        let of_kind = |wanted: fn(Kind) -> bool| -> Vec<&Series> {
            let pairs = survey.series.iter().zip(columns);
            pairs
                .filter(|(_, column)| wanted(column.kind))
                .map(|(series, _)| series)
                .collect()
        };
        let drifting = of_kind(|kind| kind == Kind::Drifting);
        let causes = of_kind(|kind| matches!(kind, Kind::Temperature | Kind::Drive));
        let slowest = |series: &[&Series], share| {
            let gaps = series.iter().filter_map(|series| series.gap(share));
            gaps.fold(0.0, f64::max)
        };
        let intervals = drifting.iter().filter_map(|series| series.interval_s());
        let narrowest = (FEWEST * intervals.fold(0.0, f64::max))
            .max(FEWEST_OF_FEATURE * slowest(&drifting, 0.9))
            .max(FEWEST_OF_FEATURE * slowest(&causes, 0.9));
        let widest = survey.duration_s / WINDOWS_IN_LOG;
        let widths: Vec<f64> = nice_widths()
            .filter(|width| (narrowest..=widest).contains(width))
            .collect();
        if widths.is_empty() {
            return Err(format!(
                "it is too short: a drift over {narrowest:.0} s, the least at the rate of its samples, would fit \
                 only {:.0} times into it, and {WINDOWS_IN_LOG} times are needed",
                survey.duration_s / narrowest.max(f64::MIN_POSITIVE)
            ));
        }
        let candidates: Vec<(f64, Vec<f64>)> = widths
            .iter()
            .map(|&width| {
                let ratios = drifting
                    .iter()
                    .map(|series| Drift::of(series, width).ratio());
                (width, ratios.collect())
            })
            .collect();
        let median = |ratios: &[f64]| {
            let mut sorted = ratios.to_vec();
            sorted.sort_by(f64::total_cmp);
            sorted.get(sorted.len() / 2).copied().unwrap_or(0.0)
        };
        let chosen = candidates
            .iter()
            .find(|(_, ratios)| median(ratios) >= ENOUGH);
        let enough = chosen.is_some();
        let best = || {
            let by_ratio =
                |a: &&(f64, Vec<f64>), b: &&(f64, Vec<f64>)| median(&a.1).total_cmp(&median(&b.1));
            candidates.iter().max_by(by_ratio)
        };
        let drift_s = chosen.or_else(best).map_or(narrowest, |(width, _)| *width);
        let shortest_s = (drift_s / 2.0)
            .max(FEWEST_OF_FEATURE * slowest(&causes, 0.9))
            .min(drift_s)
            .ceil();
        let fitting = HARMONICS
            .iter()
            .filter(|harmonic| *harmonic * drift_s <= SHARE_OF_LOG * survey.duration_s);
        let harmonics = fitting.count().max(1);
        let drifts: Vec<Drift> = drifting
            .iter()
            .map(|series| Drift::of(series, drift_s))
            .collect();
        Ok(Self {
            drift_s,
            shortest_s,
            harmonics,
            spread: drifts.iter().map(Drift::spread).collect(),
            extreme: drifts.iter().map(|drift| drift.extreme).collect(),
            candidates,
            enough,
        })
    }

    /// What was chosen and why, for people.
    #[must_use]
    pub fn remarks(&self, clock: &Clock, columns: &[Column]) -> Vec<String> {
        let drifting = columns
            .iter()
            .filter(|column| column.kind == Kind::Drifting);
        let names: Vec<&str> = drifting.map(|column| column.name.as_str()).collect();
        let width = clock.length(self.drift_s);
        let here = self.candidates.iter().find(|(at, _)| *at == self.drift_s);
        let ratios = here.map_or(&[][..], |(_, ratios)| ratios);
        let told: Vec<String> = names
            .iter()
            .zip(ratios)
            .map(|(name, ratio)| format!("{name} {ratio:.1}"))
            .collect();
        let why = if self.enough {
            format!(
                "the narrowest at which it stands {ENOUGH} times above its noise on half of them"
            )
        } else {
            format!("where it stands highest above its noise; {ENOUGH} times would be better")
        };
        let mut remarks = vec![format!(
            "drift window: {width}, {why} ({})",
            told.join(", ")
        )];
        if !self.enough {
            remarks.push(
                "the drift hardly rises above the noise of its measurement: expect little of any model"
                    .to_owned(),
            );
        }
        remarks
    }
}

/// 1, 2, 3, 5, 10, 20, 30, 50 of seconds, minutes, hours and days, as people choose windows.
fn nice_widths() -> impl Iterator<Item = f64> {
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
    let hours = [2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 24.0, 48.0, 72.0, 168.0];
    below_a_second
        .chain(seconds)
        .chain([90.0])
        .chain(minutes)
        .chain(hours.into_iter().map(|step| 3600.0 * step))
}

/// The slopes of a series over windows of one width.
struct Drift {
    squares: f64,
    noise_squares: f64,
    windows: f64,
    extreme: f64,
}

impl Drift {
    /// Windows overlap by three quarters.
    fn of(series: &Series, width_s: f64) -> Self {
        let (times, values) = (&series.time_s, &series.values);
        let (mut squares, mut noise_squares) = (0.0, 0.0);
        let mut sizes = Vec::new();
        let (mut from, mut next_s) = (0, width_s);
        for to in 0..times.len() {
            if times[to] < next_s {
                continue;
            }
            next_s = times[to] + width_s / 4.0;
            while times[from] <= times[to] - width_s {
                from += 1;
            }
            let Some((slope, error)) = line(&times[from..=to], &values[from..=to]) else {
                continue;
            };
            squares += slope * slope;
            noise_squares += error * error;
            sizes.push(slope.abs());
        }
        sizes.sort_by(f64::total_cmp);
        let extreme = sizes
            .get((0.99 * sizes.len() as f64) as usize)
            .copied()
            .unwrap_or(0.0);
        Self {
            squares,
            noise_squares,
            windows: sizes.len() as f64,
            extreme,
        }
    }

    /// Root mean square of the slopes.
    fn spread(&self) -> f64 {
        (self.squares / self.windows.max(1.0)).sqrt()
    }

    /// Spread of the drift without its noise, over its noise.
    fn ratio(&self) -> f64 {
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
    fn series(noise: f64) -> Series {
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
        Series { time_s, values }
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
        let spread = Drift::of(&series(0.0), 10.0).spread();
        assert!((spread - 0.5_f64.sqrt()).abs() < 0.02, "{spread}");
    }

    #[test]
    fn wider_windows_stand_higher_above_the_same_noise_until_they_smooth_the_drift_away() {
        let ratio = |width| Drift::of(&series(5.0), width).ratio();
        assert!(ratio(10.0) < ratio(20.0) && ratio(20.0) < ratio(40.0));
        assert!(ratio(600.0) < ratio(100.0));
    }
}
