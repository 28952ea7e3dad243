//! Decides over which windows drift and temperatures are looked at: long enough to rise above the noise, short enough to follow.
//!
//! Of the widths of [`athermal::diagnosis::window`] the narrowest is chosen at which the drift stands [`ENOUGH`] times above its
//! noise on half of the channels, or where none does, the one at which it stands highest.

use athermal::diagnosis::window::{Drift, FEWEST_SAMPLES, WINDOWS_IN_RECORDING, nice_widths};

use super::clock::Clock;
use super::column::{Column, Kind};
use super::survey::{Series, Survey};

/// Signal to noise of a drift that is enough, noise being its standard error, in which scatter and curvature both count: a fifth
/// of its variance is then noise, `1 / (1 + 2²)`.
pub(super) const ENOUGH: f64 = 2.0;
/// Samples in the shortest window of a temperature.
const FEWEST_OF_FEATURE: f64 = 3.0;
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
    /// Whether the drift rises above its standard error.
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
        let narrowest = (FEWEST_SAMPLES * intervals.fold(0.0, f64::max))
            .max(FEWEST_OF_FEATURE * slowest(&drifting, 0.9))
            .max(FEWEST_OF_FEATURE * slowest(&causes, 0.9));
        let widest = survey.duration_s / WINDOWS_IN_RECORDING;
        let widths: Vec<f64> = nice_widths()
            .filter(|width| (narrowest..=widest).contains(width))
            .collect();
        if widths.is_empty() {
            return Err(format!(
                "it is too short: a drift over {narrowest:.0} s, the least at the rate of its samples, would fit \
                 only {:.0} times into it, and {WINDOWS_IN_RECORDING} times are needed",
                survey.duration_s / narrowest.max(f64::MIN_POSITIVE)
            ));
        }
        let candidates: Vec<(f64, Vec<f64>)> = widths
            .iter()
            .map(|&width| {
                let ratios = drifting
                    .iter()
                    .map(|series| Drift::of(&series.time_s, &series.values, width).ratio());
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
            .map(|series| Drift::of(&series.time_s, &series.values, drift_s))
            .collect();
        Ok(Self {
            drift_s,
            shortest_s,
            harmonics,
            spread: drifts.iter().map(Drift::spread).collect(),
            extreme: drifts.iter().map(Drift::extreme).collect(),
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
                "the narrowest at which it stands {ENOUGH} times above its standard error on half of them"
            )
        } else {
            format!(
                "where it stands highest above its standard error; {ENOUGH} times would be better"
            )
        };
        let mut remarks = vec![format!(
            "drift window: {width}, {why} ({})",
            told.join(", ")
        )];
        if !self.enough {
            remarks.push(
                "the drift hardly rises above its standard error: expect little of any model"
                    .to_owned(),
            );
        }
        remarks
    }
}
