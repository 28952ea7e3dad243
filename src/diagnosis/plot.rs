//! Decides which pictures a diagnosis has; how one is drawn is decided by [`crate::report::chart`].

use super::Diagnosis;
use super::lag::{Correlogram, Lags};
use super::residual::Residuals;
use super::response::Responses;
use crate::report::chart::{Chart, Layer, Mark};

const COLOURS: [&str; 6] = ["c2", "c3", "c4", "c5", "c6", "c1"];
/// Lines whose labels have room beside each other.
const MOST_FEATURES: usize = 4;
/// The colour of bounds.
const BOUND: &str = "c1";
/// Windows are shown up to so many times that of the graph.
const WINDOWS_SHOWN: f64 = 12.0;

/// Points to be drawn, with their own numbers.
struct Points {
    x: Vec<f64>,
    y: Vec<f64>,
    class: &'static str,
    label: String,
    mark: Mark,
}

impl Points {
    fn line(nth: usize, label: &str, x: Vec<f64>, y: Vec<f64>) -> Self {
        Self {
            x,
            y,
            class: COLOURS[nth % COLOURS.len()],
            label: label.to_owned(),
            mark: Mark::Line,
        }
    }

    /// A level from the first to the last of `x`, above and below zero.
    fn bounds(x: &[f64], level: f64, label: &str) -> [Self; 2] {
        let [first, last] = [x.first(), x.last()].map(|x| x.copied().unwrap_or(0.0));
        let side = |sign: f64, label: &str| Self {
            x: vec![first, last],
            y: vec![sign * level; 2],
            class: BOUND,
            label: label.to_owned(),
            mark: Mark::Line,
        };
        [side(1.0, label), side(-1.0, "")]
    }
}

fn picture(title: &str, x_label: &str, y_label: &str, points: &[Points]) -> String {
    let layers = points.iter().map(|of| Layer {
        x: &of.x,
        y: &of.y,
        class: of.class,
        label: of.label.clone(),
        mark: of.mark,
    });
    let chart = Chart {
        title: title.to_owned(),
        x_label,
        y_label: y_label.to_owned(),
        height: 340.0,
        layers: layers.collect(),
        bands: Vec::new(),
        limit: None,
        y_range: None,
        time: false,
    };
    chart.file()
}

/// Every picture of a diagnosis: name without ending, and SVG.
#[must_use]
pub fn plots(diagnosis: &Diagnosis) -> Vec<(String, String)> {
    let mut plots = Vec::new();
    let is_main = |name: &str| diagnosis.main.iter().any(|main| main.prediction == name);
    let residuals = diagnosis.residuals.iter();
    for of in residuals.filter(|of| is_main(&of.prediction) && !of.bound.is_empty()) {
        let name = format!("autocorrelation-{}", of.prediction);
        plots.push((name, autocorrelation(of)));
    }
    for of in &diagnosis.lags {
        let truth = lags(of, &of.truth, |feature| &feature.truth);
        plots.push((format!("lags-{}", of.truth), truth));
        let left = format!("what {} leaves of {}", of.prediction, of.truth);
        let left = lags(of, &left, |feature| &feature.residual);
        plots.push((format!("lags-residual-{}", of.truth), left));
    }
    for of in &diagnosis.responses {
        plots.push((format!("impulse-{}", of.node), response(of, true)));
        plots.push((format!("step-{}", of.node), response(of, false)));
    }
    if let Some(days) = &diagnosis.days {
        let x: Vec<f64> = days.curve.iter().map(|point| point.days as f64).collect();
        let curve = diagnosis.main.iter().enumerate().map(|(nth, main)| {
            let score = |point: &super::day::CurvePoint| {
                let mut scores = point.scores.iter();
                let score = scores.find(|score| score.prediction == main.prediction);
                score.and_then(|score| score.rmse).unwrap_or(f64::NAN)
            };
            let y = days.curve.iter().map(score).collect();
            Points::line(nth, &main.prediction, x.clone(), y)
        });
        let curve: Vec<Points> = curve.collect();
        let unit = diagnosis.main.first().map_or("", |main| main.unit.as_str());
        let title = "Error on other days against days of the fit";
        plots.push(("days".to_owned(), picture(title, "days", unit, &curve)));
    }
    if !diagnosis.windows.is_empty() {
        let lines = diagnosis.windows.iter().enumerate().map(|(nth, of)| {
            let shown = |width: &&super::window::Width| {
                width.window_s <= WINDOWS_SHOWN * of.window_s && width.ratio.is_finite()
            };
            let shown: Vec<_> = of.widths.iter().filter(shown).collect();
            let x = shown.iter().map(|width| width.window_s / 60.0).collect();
            let y = shown.iter().map(|width| width.ratio).collect();
            Points::line(nth, &of.truth, x, y)
        });
        let lines: Vec<Points> = lines.collect();
        let title = "Signal to noise of the drift against its window";
        let svg = picture(title, "window in minutes", "signal to noise", &lines);
        plots.push(("windows".to_owned(), svg));
    }
    plots
}

fn autocorrelation(of: &Residuals) -> String {
    let lags = 1..=of.autocorrelation.len();
    let x: Vec<f64> = lags.map(|lag| lag as f64 * of.spacing_s / 60.0).collect();
    // The bounds reach past the bars to either side, or half of the outer ones would be cut off.
    let ends = [0.4, of.bound.len() as f64 + 0.6].map(|lag| lag * of.spacing_s / 60.0);
    let around = |inner: &[f64], first: f64, last: f64| -> Vec<f64> {
        let inner = inner.iter().copied();
        std::iter::once(first).chain(inner).chain([last]).collect()
    };
    let bound = |sign: f64, label: &str| Points {
        x: around(&x, ends[0], ends[1]),
        y: around(&of.bound, of.bound[0], of.bound[of.bound.len() - 1])
            .iter()
            .map(|bound| sign * bound)
            .collect(),
        class: BOUND,
        label: label.to_owned(),
        mark: Mark::Line,
    };
    let bars = Points {
        x: x.clone(),
        y: of.autocorrelation.clone(),
        class: "c2",
        label: String::new(),
        mark: Mark::Bars,
    };
    let points = [bars, bound(1.0, "95 % of white series"), bound(-1.0, "")];
    let title = format!("Autocorrelation of the residuals of {}", of.prediction);
    picture(&title, "lag in minutes", &of.prediction, &points)
}

/// Of each sensor the feature that says most.
fn lags(of: &Lags, title: &str, side: fn(&super::lag::FeatureLags) -> &Correlogram) -> String {
    let x: Vec<f64> = of.lag_s.iter().map(|lag| lag / 60.0).collect();
    let mut shown: Vec<&super::lag::FeatureLags> = Vec::new();
    let sensor = |name: &str| name.split('@').next().unwrap_or_default().to_owned();
    for feature in of.features.iter().filter(|of| !side(of).best.is_nan()) {
        let rival = shown
            .iter_mut()
            .find(|rival| sensor(&rival.feature) == sensor(&feature.feature));
        match rival {
            Some(rival) if side(rival).best.abs() >= side(feature).best.abs() => {}
            Some(rival) => *rival = feature,
            None => shown.push(feature),
        }
    }
    shown.sort_by(|a, b| side(b).best.abs().total_cmp(&side(a).best.abs()));
    shown.truncate(MOST_FEATURES);
    let lines = shown.iter().enumerate();
    let lines =
        lines.map(|(nth, of)| Points::line(nth, short(&of.feature), x.clone(), side(of).r.clone()));
    let mut points: Vec<Points> = lines.collect();
    let widest = shown.iter().map(|of| side(of).error).fold(0.0, f64::max);
    points.extend(Points::bounds(&x, 3.0 * widest, "3 σ"));
    let title = format!("Correlation of features with {title}");
    picture(&title, "minutes that it follows the feature", "r", &points)
}

/// A channel without its node, for a legend.
fn short(name: &str) -> &str {
    name.split_once('.').map_or(name, |(_, channel)| channel)
}

fn response(of: &Responses, impulse: bool) -> String {
    let mut largest: Vec<&super::response::Response> = of.sensors.iter().collect();
    largest.sort_by(|a, b| b.peak.abs().total_cmp(&a.peak.abs()));
    largest.truncate(COLOURS.len());
    let lines = largest.iter().enumerate().map(|(nth, sensor)| {
        let x = sensor.time_s.iter().map(|time| time / 60.0).collect();
        let y = if impulse {
            &sensor.impulse
        } else {
            &sensor.step
        };
        Points::line(nth, short(&sensor.sensor), x, y.clone())
    });
    let lines: Vec<Points> = lines.collect();
    let of_unit = of.sensors.first().map_or("", |of| of.sensor_unit.as_str());
    let (what, unit) = if impulse {
        ("Impulse", format!("{} per {of_unit}·min", of.unit))
    } else {
        ("Step", format!("{} per {of_unit}", of.unit))
    };
    let title = format!("{what} response of {}", of.node);
    picture(&title, "minutes after the change", &unit, &lines)
}
