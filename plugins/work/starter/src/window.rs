//! Decides over which windows drift and temperatures are looked at: long enough to rise above the noise, short enough to follow.
//!
//! Of the widths of [`athermal_analysis::diagnosis::window`] the narrowest is chosen at which the drift stands [`ENOUGH`] times above its
//! noise on half of the channels, or where none does, the one at which it stands highest. The rates of what drifts and of the
//! temperatures bound the search; an input that is logged too rarely for slopes over that window is not one that bounds it. The next
//! narrower and the next wider one are weighed beside it by what their fits explain.

use std::collections::BTreeSet;

use athermal_analysis::diagnosis::window::{
    Drift, FEWEST_SAMPLES, WINDOWS_IN_RECORDING, nice_widths,
};

use serde_json::{Value, json};

use athermal_analysis::figures::time;

use super::clock::Clock;
use super::column::{Column, Kind};
use super::survey::{Series, Survey};
use super::weighed::Weighed;

/// Signal to noise of a drift that is enough, noise being its standard error, in which scatter and curvature both count: a fifth
/// of its variance is then noise, `1 / (1 + 2²)`.
pub(super) const ENOUGH: f64 = 2.0;
/// Samples in the shortest window of a temperature.
const FEWEST_OF_FEATURE: f64 = 3.0;
/// The longest window of a temperature may take up such a share of the log.
const SHARE_OF_LOG: f64 = 0.15;
/// What drifts is measured seldom where its values are so many times as far apart as those of temperatures; its levels can be learned
/// from so many of them.
const SELDOM: f64 = 5.0;
const FEWEST_LEVELS: usize = 20;
/// Windows fit into a log with gaps where rows of such a share of its stretches have them.
const SHARE_OF_STRETCHES: f64 = 0.1;

/// A width that is weighed beside the chosen one is at least so many times as narrow or as wide.
const APART: f64 = 1.6;

/// The share of what is measured between gaps that has so many windows of a width before it.
fn share(series: &[&Series], width_s: f64, windows: f64) -> f64 {
    let share = |series: &&Series| {
        let stretches = series.stretches(width_s);
        let within = stretches
            .iter()
            .map(|length| (length - windows * width_s).max(0.0));
        within.sum::<f64>() / stretches.iter().sum::<f64>().max(f64::MIN_POSITIVE)
    };
    series.iter().map(share).fold(1.0, f64::min)
}

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
    /// Whether the drift rises above its standard error.
    pub enough: bool,
    /// The drift window by the standard error alone, and widths near it with what their fits explain.
    pub by_noise_s: f64,
    /// See [`Weighed`].
    pub weighed: Weighed,
    /// Why what drifts is predicted as it stands, and not its slope: no window fits between the gaps.
    pub levels: Option<String>,
    /// Inputs with values too far apart for slopes over the drift window, by number: their last value stands for them.
    pub rare: BTreeSet<usize>,
    /// The temperature whose rate kept narrower windows than the chosen one from being tried.
    pub bound: Option<Bound>,
}

/// A temperature that bounds how narrow a drift window may be.
#[derive(Debug)]
pub struct Bound {
    /// Its column.
    pub column: String,
    /// The time between two of its values in s, which nine of ten do not exceed.
    pub gap_s: f64,
}

impl Bound {
    /// Why narrower windows were not tried, for people.
    #[must_use]
    pub fn text(&self, clock: &Clock) -> String {
        format!(
            "narrower ones were not tried: {} has a value every {}, and its slope takes {FEWEST_OF_FEATURE}",
            self.column,
            clock.about(self.gap_s)
        )
    }
}

/// Roots of tan x = x over π: the windows whose spectrum shares zeros with that of a drift, per drift window.
pub(super) const HARMONICS: [f64; 4] = [1.43030, 2.45902, 3.47089, 4.47741];

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
        let temperatures = of_kind(|kind| kind == Kind::Temperature);
        let slowest = |series: &[&Series], share| {
            let gaps = series.iter().filter_map(|series| series.gap(share));
            gaps.fold(0.0, f64::max)
        };
        let intervals = drifting.iter().filter_map(|series| series.interval_s());
        let of_drifting = (FEWEST_SAMPLES * intervals.fold(0.0, f64::max))
            .max(FEWEST_OF_FEATURE * slowest(&drifting, 0.9));
        let narrowest = of_drifting.max(FEWEST_OF_FEATURE * slowest(&temperatures, 0.9));
        let widest = survey.duration_s / WINDOWS_IN_RECORDING;
        let mut widths: Vec<f64> = nice_widths()
            .filter(|width| (narrowest..=widest).contains(width))
            .collect();
        if widths.is_empty() && narrowest <= widest {
            widths.push(rounded(narrowest));
        }
        let mut seldom = None;
        if widths.is_empty() {
            let times = survey.duration_s / narrowest.max(f64::MIN_POSITIVE);
            let every = slowest(&drifting, 0.5);
            let of_causes = slowest(&temperatures, 0.5);
            let fewest = drifting.iter().map(|series| series.values.len()).min();
            if of_causes == 0.0 || every < SELDOM * of_causes || fewest < Some(FEWEST_LEVELS) {
                let pairs = survey.series.iter().zip(columns);
                let measured =
                    pairs.filter(|(_, of)| matches!(of.kind, Kind::Temperature | Kind::Drifting));
                let gap = |series: &Series| series.gap(0.9).unwrap_or(0.0);
                let rarest = measured.max_by(|(a, _), (b, _)| gap(a).total_cmp(&gap(b)));
                let rarest = rarest.map_or_else(String::new, |(series, of)| {
                    format!(" ({} has a value every {})", of.name, time(gap(series)))
                });
                return Err(format!(
                    "it is too short: a drift over {}, the least at the rate of its samples{rarest}, would fit only {times:.0} times into \
                     it, and {WINDOWS_IN_RECORDING} times are needed",
                    time(narrowest),
                ));
            }
            seldom = Some(format!(
                "slopes of what is measured every {} would be over {}, which fits only {times:.0} times into the log",
                time(every),
                time(narrowest)
            ));
            widths.push(rounded(narrowest));
        }
        let measured = [&*drifting, &*temperatures].concat();
        let fits = |width: &f64| share(&measured, *width, 2.0) >= SHARE_OF_STRETCHES;
        let between: Vec<f64> = widths.iter().copied().filter(fits).collect();
        let narrowest_try = widths[0];
        let levels = seldom.or_else(|| (between.is_empty() && !temperatures.is_empty()).then(|| {
            let mut stretches = drifting
                .iter()
                .flat_map(|series| series.stretches(narrowest_try))
                .collect::<Vec<_>>();
            stretches.sort_by(f64::total_cmp);
            format!(
                "no window fits: the narrowest at the rate of the samples is {}, and half of the {} stretches between gaps are shorter \
                 than {}",
                time(narrowest_try),
                stretches.len(),
                time(stretches.get(stretches.len() / 2).copied().unwrap_or(0.0))
            )
        }));
        if !between.is_empty() {
            widths = between;
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
        let by_noise_s = chosen.or_else(best).map_or(narrowest, |(width, _)| *width);
        let pairs = || survey.series.iter().zip(columns).enumerate();
        let needs = |series: &Series| FEWEST_OF_FEATURE * series.gap(0.9).unwrap_or(0.0);
        let weighed = match levels {
            Some(_) => Weighed::default(),
            None => {
                let is_cause = |of: Kind| matches!(of, Kind::Temperature | Kind::Drive);
                let causes = pairs().filter(|(_, (series, column))| {
                    is_cause(column.kind) && needs(series) <= by_noise_s / 2.0
                });
                let causes: Vec<&Series> = causes.map(|(_, (series, _))| series).collect();
                Weighed::of(&drifting, &causes, &beside(&widths, by_noise_s), by_noise_s)
            }
        };
        let drift_s = weighed.better_s.unwrap_or(by_noise_s);
        let rare: BTreeSet<usize> = pairs()
            .filter(|(_, (series, column))| column.kind == Kind::Drive && needs(series) > drift_s)
            .map(|(index, _)| index)
            .collect();
        let causes: Vec<&Series> = pairs()
            .filter(|(_, (_, column))| matches!(column.kind, Kind::Temperature | Kind::Drive))
            .filter(|(index, _)| !rare.contains(index))
            .map(|(_, (series, _))| series)
            .collect();
        let shortest_s = shortest(drift_s, FEWEST_OF_FEATURE * slowest(&causes, 0.9));
        let untried = nice_widths().any(|width| (of_drifting..drift_s).contains(&width));
        let slowest_temperature = pairs()
            .filter(|(_, (_, column))| column.kind == Kind::Temperature)
            .max_by(|(_, (a, _)), (_, (b, _))| needs(a).total_cmp(&needs(b)));
        let bound = slowest_temperature
            .filter(|_| enough && untried && widths.first() == Some(&drift_s))
            .map(|(_, (series, column))| Bound {
                column: column.name.clone(),
                gap_s: series.gap(0.9).unwrap_or(0.0),
            });
        let has_room = |harmonic: f64| {
            let windows = 1.0 + harmonic;
            survey.has_no_gap(&measured, drift_s)
                || share(&measured, drift_s, windows) >= 3.0 * SHARE_OF_STRETCHES
        };
        let fitting = HARMONICS
            .iter()
            .filter(|harmonic| *harmonic * drift_s <= SHARE_OF_LOG * survey.duration_s)
            .filter(|harmonic| has_room(**harmonic));
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
            candidates,
            enough,
            by_noise_s,
            weighed,
            levels,
            rare,
            bound,
        })
    }

    /// What was measured and chosen, for programs: every width that was tried, for each column that drifts.
    #[must_use]
    pub fn facts(&self, columns: &[Column]) -> Value {
        let drifting = columns
            .iter()
            .filter(|column| column.kind == Kind::Drifting);
        let of = |(nth, column): (usize, &Column)| {
            let widths = self.candidates.iter();
            let widths = widths.map(|(window_s, ratios)| {
                let mut weighed = self.weighed.widths.iter();
                let explained = weighed.find(|(width_s, _)| width_s == window_s);
                json!({
                    "window_s": window_s,
                    "ratio": ratios.get(nth),
                    "explained": explained.map(|(_, share)| share),
                })
            });
            json!({
                "column": column.name,
                "window_s": self.drift_s,
                "widths": widths.collect::<Vec<_>>(),
            })
        };
        drifting.enumerate().map(of).collect()
    }

    /// What the graph puts out, for people.
    #[must_use]
    pub fn outputs(&self, clock: &Clock) -> String {
        if self.levels.is_some() {
            return "output: `now`, the value that the sensors give (a virtual sensor)".to_owned();
        }
        let width = clock.length(self.drift_s);
        format!(
            "outputs: `now`, the drift of the last {width} (a virtual sensor), and `next`, the drift of the next {width} (a forecast). Of \
             each, `result` is what goes out; the others are its voters"
        )
    }

    /// What fits of the widths that were weighed explain, for people.
    #[must_use]
    pub fn explains(&self, clock: &Clock) -> Option<String> {
        let (widest_s, _) = self.weighed.widths.last()?;
        let shares = self.weighed.widths.iter().map(|(width_s, share)| {
            let percent = 100.0 * share.max(0.0);
            format!("over {} {percent:.1} %", clock.length(*width_s))
        });
        Some(format!(
            "weighed in cross-validation: of the drift over {} linear fits explain, {}",
            clock.length(*widest_s),
            shares.collect::<Vec<_>>().join(", ")
        ))
    }

    /// What was chosen and why, for people.
    #[must_use]
    pub fn remarks(&self, clock: &Clock, columns: &[Column]) -> Vec<String> {
        let drifting = columns
            .iter()
            .filter(|column| column.kind == Kind::Drifting);
        let names: Vec<&str> = drifting.map(|column| column.name.as_str()).collect();
        let width = clock.length(self.drift_s);
        if let Some(why) = &self.levels {
            let names = names.join(", ");
            return vec![format!(
                "{why}; so the graph predicts {names} itself from the values of what may explain it, and not how fast it drifts"
            )];
        }
        let here = self.candidates.iter().find(|(at, _)| *at == self.drift_s);
        let ratios = here.map_or(&[][..], |(_, ratios)| ratios);
        let names: Vec<String> = names
            .iter()
            .zip(ratios)
            .map(|(name, ratio)| format!("{name} {ratio:.1}"))
            .collect();
        let why = if self.weighed.better_s.is_some() {
            let by_noise = clock.length(self.by_noise_s);
            format!("whose fit explains more than that of {by_noise}")
        } else if self.enough {
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
            names.join(", ")
        )];
        remarks.extend(self.explains(clock));
        remarks.extend(self.bound.iter().map(|bound| bound.text(clock)));
        for &index in &self.rare {
            remarks.push(format!(
                "{}: its values are too far apart for slopes over {width}, so its last value is taken as it stands",
                columns[index].name
            ));
        }
        if !self.enough {
            remarks.push(
                "the drift hardly rises above its standard error: expect little of any model"
                    .to_owned(),
            );
        }
        remarks
    }
}

/// The width with the next narrower and the next wider ones of those that fit.
fn beside(widths: &[f64], chosen_s: f64) -> Vec<f64> {
    let narrower = widths.iter().rfind(|of| APART * **of <= chosen_s);
    let wider = widths.iter().find(|of| **of >= APART * chosen_s);
    let all = [narrower, Some(&chosen_s), wider].into_iter();
    all.flatten().copied().collect()
}

/// A width that people would choose, not below this one.
fn rounded(width_s: f64) -> f64 {
    let unit = [86_400.0, 3600.0, 60.0, 1.0, 1e-3]
        .into_iter()
        .find(|unit| width_s >= *unit);
    let unit = unit.unwrap_or(1e-3);
    unit * (width_s / unit - 1e-6).ceil()
}

/// The shortest window of what explains a drift over `drift_s`, at least what its rate needs: to whole seconds, or where
/// the drift window is shorter than one, to whole milliseconds.
fn shortest(drift_s: f64, needed_s: f64) -> f64 {
    let step = if drift_s < 1.0 { 1e-3 } else { 1.0 };
    let at_least = (drift_s / 2.0).max(needed_s);
    (step * (at_least / step).ceil()).min(drift_s)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shortest_window_of_a_feature_is_never_above_that_of_the_drift() {
        for width in nice_widths() {
            for needed_s in [0.0, 0.0015, 0.3 * width, width] {
                let shortest_s = shortest(width, needed_s);
                assert!(shortest_s <= width, "{shortest_s} of {width}");
                assert!(shortest_s >= 0.499 * width, "{shortest_s} of {width}");
            }
        }
    }
}
