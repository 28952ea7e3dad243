//! Decides which pictures a diagnosis has, and how correlations and responses are shown wherever they are; how a picture is drawn
//! is decided by [`crate::chart`].

use super::day::{CurvePoint, DayScore, Days};
use super::lag::{Correlogram, FeatureLags, Lags};
use super::residual::Residuals;
use super::response::{Response, Responses};
use super::window::{Width, Windows};
use super::{Diagnosis, Main, is_asked};
use crate::chart::{Chart, LINES, Layer, Mark, Plot};

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
            class: LINES[nth % LINES.len()],
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

/// A picture without its name.
#[derive(Default)]
pub(crate) struct Picture {
    title: String,
    x_label: &'static str,
    y_label: String,
    y_range: Option<(f64, f64)>,
    points: Vec<Points>,
}

impl Picture {
    pub(crate) fn chart(&self) -> Chart<'_> {
        let layers = self.points.iter().map(|of| Layer {
            x: &of.x,
            y: &of.y,
            class: of.class,
            label: of.label.clone(),
            mark: of.mark,
        });
        Chart {
            title: self.title.clone(),
            x_label: self.x_label,
            y_label: self.y_label.clone(),
            y_range: self.y_range,
            height: 340.0,
            layers: layers.collect(),
            ..Chart::default()
        }
    }
}

/// Every picture of a diagnosis, or of the predictions asked for by name; those with nothing to draw are left out.
#[must_use]
pub fn plots(diagnosis: &Diagnosis, asked: &[String]) -> Vec<Plot> {
    let mut plots = Vec::new();
    let mut add = |name: String, picture: Picture| plots.extend(Plot::of(name, &picture.chart()));
    let main = diagnosis.main.iter();
    let main: Vec<&Main> = main
        .filter(|main| is_asked(&main.prediction, asked))
        .collect();
    let is_main = |name: &str| main.iter().any(|main| main.prediction == name);
    let residuals = diagnosis.residuals.iter();
    for of in residuals.filter(|of| is_main(&of.prediction) && !of.bound.is_empty()) {
        add(
            format!("autocorrelation-{}", of.prediction),
            autocorrelation(of),
        );
    }
    for of in diagnosis.lags.iter().filter(|of| is_main(&of.prediction)) {
        add(format!("lags-{}", of.truth), with_truth(of));
        let left = format!("what {} leaves of {}", of.prediction, of.truth);
        let left = lags(of, &left, |feature| &feature.residual);
        add(format!("lags-residual-{}", of.truth), left);
    }
    for of in diagnosis
        .responses
        .iter()
        .filter(|of| is_asked(&of.node, asked))
    {
        add(format!("impulse-{}", of.node), response(of, true));
        add(format!("step-{}", of.node), response(of, false));
    }
    if let Some(days) = &diagnosis.days {
        add("days".to_owned(), learning(&main, days));
    }
    let is_shown = |of: &&Windows| main.iter().any(|main| main.truth == of.truth);
    let of_windows: Vec<&Windows> = diagnosis.windows.iter().filter(is_shown).collect();
    if !of_windows.is_empty() {
        add("windows".to_owned(), windows(&of_windows));
    }
    plots
}

fn learning(main: &[&Main], days: &Days) -> Picture {
    let x: Vec<f64> = days.curve.iter().map(|point| point.days as f64).collect();
    let curve = main.iter().enumerate().map(|(nth, main)| {
        let score = |point: &CurvePoint| {
            let mut scores = point.scores.iter();
            let score = scores.find(|score| score.prediction == main.prediction);
            score.and_then(DayScore::ratio).unwrap_or(f64::NAN)
        };
        let y = days.curve.iter().map(score).collect();
        Points::line(nth, &main.prediction, x.clone(), y)
    });
    Picture {
        title: "Error of fits on some days over that of fits on all others".to_owned(),
        x_label: "days",
        y_label: "times the error of all others".to_owned(),
        points: curve.collect(),
        ..Picture::default()
    }
}

fn windows(windows: &[&Windows]) -> Picture {
    let lines = windows.iter().enumerate().map(|(nth, of)| {
        let shown = |width: &&Width| {
            width.window_s <= WINDOWS_SHOWN * of.window_s && width.ratio.is_finite()
        };
        let shown: Vec<_> = of.widths.iter().filter(shown).collect();
        let x = shown.iter().map(|width| width.window_s / 60.0).collect();
        let y = shown.iter().map(|width| width.ratio).collect();
        Points::line(nth, &of.truth, x, y)
    });
    Picture {
        title: "Signal to noise of the drift against its window".to_owned(),
        x_label: "window in minutes",
        y_label: "signal to noise".to_owned(),
        points: lines.collect(),
        ..Picture::default()
    }
}

fn autocorrelation(of: &Residuals) -> Picture {
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
    let (above, below) = (bound(1.0, "95 % of white series"), bound(-1.0, ""));
    Picture {
        title: format!("Autocorrelation of the residuals of {}", of.prediction),
        x_label: "lag in minutes",
        y_label: of.prediction.clone(),
        points: vec![bars, above, below],
        ..Picture::default()
    }
}

/// How features go with a truth.
pub(crate) fn with_truth(of: &Lags) -> Picture {
    lags(of, &of.truth, |feature| &feature.truth)
}

/// Of each sensor the feature that says most.
fn lags(of: &Lags, title: &str, side: fn(&FeatureLags) -> &Correlogram) -> Picture {
    let x: Vec<f64> = of.lag_s.iter().map(|lag| lag / 60.0).collect();
    let mut shown: Vec<&FeatureLags> = Vec::new();
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
    Picture {
        title: format!("Correlation of features with {title}"),
        x_label: "minutes that it follows the feature",
        y_label: "r".to_owned(),
        points,
        ..Picture::default()
    }
}

/// A channel without its node, for a legend.
fn short(name: &str) -> &str {
    name.split_once('.').map_or(name, |(_, channel)| channel)
}

/// How an estimator answers the sensors that it answers most: a step of one unit, or one unit for one minute.
pub(crate) fn response(of: &Responses, impulse: bool) -> Picture {
    let mut largest: Vec<&Response> = of.sensors.iter().collect();
    largest.sort_by(|a, b| b.peak.abs().total_cmp(&a.peak.abs()));
    largest.truncate(LINES.len());
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
    Picture {
        title: format!("{what} response of {}", of.node),
        x_label: "minutes after the change",
        y_label: unit,
        y_range: impulse.then(|| most_of(&lines)).flatten(),
        points: lines,
    }
}

/// Where nearly all of the lines lies. An impulse makes a spike in every slope that it enters, and beside that nothing would be seen.
fn most_of(lines: &[Points]) -> Option<(f64, f64)> {
    let values = lines.iter().flat_map(|line| &line.y);
    let mut sizes: Vec<f64> = values.map(|v| v.abs()).filter(|v| *v > 0.0).collect();
    sizes.sort_by(f64::total_cmp);
    let size = sizes.get(sizes.len() * 95 / 100)?;
    Some((-1.1 * size, 1.1 * size))
}
