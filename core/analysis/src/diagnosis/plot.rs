//! The pictures of a diagnosis; [`crate::chart`] draws them.

use super::day::{CurvePoint, DayScore, Days, ENOUGH};
use super::lag::{Correlogram, FeatureLags, Lags};
use super::residual::Residuals;
use super::response::{Response, Responses};
use super::window::{Width, Windows};
use super::{Diagnosis, Main, is_asked};
use crate::chart::{Chart, LINES, Layer, Mark, Plot};
use crate::figures::{TimeUnit, time};

/// Lines whose labels have room beside each other.
const MOST_FEATURES: usize = 4;
/// The colour of bounds.
const BOUND: &str = "c1";
/// The colour of the lag from which on features were known.
const KNOWN: &str = "c6";
/// Windows are shown up to so many times that of the graph.
const WINDOWS_SHOWN: f64 = 12.0;
/// Errors of fits on fewer days are shown up to so many times that of fits on all others: whether they come near is asked.
const RATIOS_SHOWN: f64 = 2.0;
/// Impulses are shown whole unless the largest is so many times beyond all but so many points of each line that has twice as many.
const SPIKE: f64 = 10.0;
const IN_SPIKES: usize = 4;

fn longest(times_s: &[f64]) -> f64 {
    times_s.iter().map(|time| time.abs()).fold(0.0, f64::max)
}

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
    x_label: String,
    y_label: String,
    y_range: Option<(f64, f64)>,
    limits: Vec<f64>,
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
            x_label: self.x_label.clone(),
            y_label: self.y_label.clone(),
            y_range: self.y_range,
            limits: self.limits.clone(),
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
    // All that are asked for by name, as in the tables.
    let shown = |name: &str| match asked {
        [] => is_main(name),
        asked => is_asked(name, asked),
    };
    let residuals = diagnosis.residuals.iter();
    let residuals: Vec<&Residuals> = residuals.filter(|of| shown(&of.prediction)).collect();
    for of in residuals.iter().filter(|of| !of.bound.is_empty()) {
        add(
            format!("autocorrelation-{}", of.prediction),
            autocorrelation(of),
        );
    }
    for of in diagnosis.lags.iter().filter(|of| is_main(&of.prediction)) {
        add(format!("lags-{}", of.truth), with_truth(of));
        add(format!("lags-residual-{}", of.truth), with_residual(of));
    }
    for of in diagnosis
        .responses
        .iter()
        .filter(|of| is_asked(&of.node, asked))
    {
        for (kind, impulse) in [("impulse", true), ("step", false)] {
            for (ending, picture) in responses(of, impulse) {
                add(format!("{kind}-{}{ending}", of.node), picture);
            }
        }
    }
    if let Some(days) = diagnosis.days.as_ref().filter(|of| of.curve.len() > 1) {
        let names: Vec<&str> = residuals.iter().map(|of| &*of.prediction).collect();
        add("days".to_owned(), learning(&names, days));
    }
    let is_shown = |of: &&Windows| main.iter().any(|main| main.truth == of.truth);
    let of_windows: Vec<&Windows> = diagnosis.windows.iter().filter(is_shown).collect();
    if !of_windows.is_empty() {
        add("windows".to_owned(), windows(&of_windows));
    }
    plots
}

fn learning(predictions: &[&str], days: &Days) -> Picture {
    let x: Vec<f64> = days.curve.iter().map(|point| point.days as f64).collect();
    let curve = predictions.iter().enumerate().map(|(nth, prediction)| {
        let score = |point: &CurvePoint| {
            let mut scores = point.scores.iter();
            let score = scores.find(|score| score.prediction == *prediction);
            score.and_then(DayScore::ratio).unwrap_or(f64::NAN)
        };
        let y = days.curve.iter().map(score).collect();
        Points::line(nth, prediction, x.clone(), y)
    });
    let points: Vec<Points> = curve.collect();
    let ratios = points.iter().flat_map(|of| &of.y).filter(|y| !y.is_nan());
    let (low, high) = ratios.fold((1.0, ENOUGH), |(low, high), &y| {
        (f64::min(low, y), f64::max(high, y))
    });
    let cut = if high > RATIOS_SHOWN {
        ", cut at 2"
    } else {
        ""
    };
    let most = days.count - 1;
    let length = days.day_s;
    let days = if length == 86_400.0 {
        "days".to_owned()
    } else {
        format!("stretches of {}", time(length))
    };
    Picture {
        title: format!("Error of fits on some {days} over that of fits on {most}"),
        x_label: format!("{days} that a fit has seen; dashed: 5 % worse than all"),
        y_label: format!("RMSE, 1 being that of a fit on {most} of them{cut}"),
        y_range: Some((low - 0.05, high.min(RATIOS_SHOWN) + 0.02)),
        limits: vec![ENOUGH],
        points,
    }
}

fn windows(windows: &[&Windows]) -> Picture {
    let shown = |of: &Windows| -> Vec<Width> {
        let shown = |width: &&Width| {
            width.window_s <= WINDOWS_SHOWN * of.window_s && width.ratio.is_finite()
        };
        of.widths.iter().filter(shown).cloned().collect()
    };
    let all = windows.iter().flat_map(|of| shown(of));
    let unit = TimeUnit::of(all.map(|of| of.window_s).fold(0.0, f64::max));
    let points = |widths: &[Width]| -> (Vec<f64>, Vec<f64>) {
        let each = widths.iter();
        each.map(|of| (of.window_s / unit.seconds, of.ratio))
            .unzip()
    };
    let lines = windows.iter().enumerate().map(|(nth, of)| {
        let (x, y) = points(&shown(of));
        Points::line(nth, &of.truth, x, y)
    });
    let mut own: Vec<f64> = windows
        .iter()
        .map(|of| of.window_s / unit.seconds)
        .collect();
    own.dedup();
    let own = match own[..] {
        [one] => format!(", that of the graph is {}", (100.0 * one).round() / 100.0),
        _ => String::new(),
    };
    let count = |of: &Windows| of.widths.iter().filter(|of| of.ratio.is_finite()).count();
    let cut = windows.iter().any(|of| shown(of).len() < count(of));
    let cut = if cut {
        "; wider ones: in the table"
    } else {
        ""
    };
    Picture {
        title: "Signal to noise of the drift against its window".to_owned(),
        x_label: format!("window in {}{own}{cut}", unit.name),
        y_label: "signal to noise (standard error of the slope)".to_owned(),
        points: lines.collect(),
        ..Picture::default()
    }
}

/// How long what a prediction leaves lasts.
pub(crate) fn autocorrelation(of: &Residuals) -> Picture {
    let count = of.autocorrelation.len();
    let unit = TimeUnit::of(count as f64 * of.spacing_s);
    let x: Vec<f64> = (1..=count)
        .map(|lag| lag as f64 * of.spacing_s / unit.seconds)
        .collect();
    // The bounds reach past the bars to either side, or half of the outer ones would be cut off.
    let ends = [0.4, of.bound.len() as f64 + 0.6].map(|lag| lag * of.spacing_s / unit.seconds);
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
    let known = x.iter().zip(&of.autocorrelation);
    let known = known.filter(|(_, r)| !r.is_nan());
    let (at, r) = known.unzip();
    let bars = Points {
        x: at,
        y: r,
        class: "c2",
        label: String::new(),
        mark: Mark::Bars,
    };
    let (above, below) = (
        bound(1.0, "95 %, if there is none from that lag on"),
        bound(-1.0, ""),
    );
    Picture {
        title: format!("Autocorrelation of the residuals of {}", of.prediction),
        x_label: format!("lag in {}", unit.name),
        y_label: format!("autocorrelation of what {} leaves", of.prediction),
        points: vec![bars, above, below],
        ..Picture::default()
    }
}

/// How features go with a truth.
pub(crate) fn with_truth(of: &Lags) -> Picture {
    lags(of, &of.truth, |feature| &feature.truth)
}

/// How features go with what is left of a truth, and from which lag on they were known when it was predicted.
fn with_residual(of: &Lags) -> Picture {
    let left = format!("what {} leaves of {}", of.prediction, of.truth);
    let mut picture = lags(of, &left, |feature| &feature.residual);
    let unit = TimeUnit::of(longest(&of.lag_s));
    let all = picture.points.iter().flat_map(|of| &of.y);
    let (low, high) = all
        .filter(|y| !y.is_nan())
        .fold((0.0, 0.0), |(low, high), &y| {
            (f64::min(low, y), f64::max(high, y))
        });
    picture.points.push(Points {
        x: vec![of.ahead_s / unit.seconds; 2],
        y: vec![low, high],
        class: KNOWN,
        label: "known from here on".to_owned(),
        mark: Mark::Line,
    });
    picture
}

/// Of each sensor the feature that explains most.
fn lags(of: &Lags, title: &str, side: fn(&FeatureLags) -> &Correlogram) -> Picture {
    let unit = TimeUnit::of(longest(&of.lag_s));
    let x: Vec<f64> = of.lag_s.iter().map(|lag| lag / unit.seconds).collect();
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
    let names: Vec<&str> = shown.iter().map(|of| &*of.feature).collect();
    let lines = shown.iter().zip(short(&names)).enumerate();
    let lines =
        lines.map(|(nth, (of, name))| Points::line(nth, name, x.clone(), side(of).r.clone()));
    let mut points: Vec<Points> = lines.collect();
    let widest = shown.iter().map(|of| side(of).bound).fold(0.0, f64::max);
    if widest < 1.0 {
        points.extend(Points::bounds(&x, widest, "99 % by chance, at most"));
    }
    Picture {
        title: format!("Correlation of features with {title}"),
        x_label: format!("{} by which {} follows the feature", unit.name, of.truth),
        y_label: format!("r with {title}"),
        points,
        ..Picture::default()
    }
}

/// Channels without their nodes, for a legend; with them where two would be called the same.
fn short<'a>(names: &[&'a str]) -> Vec<&'a str> {
    let channel = |name: &'a str| name.split_once('.').map_or(name, |(_, channel)| channel);
    let once = |name: &'a str| {
        let alike = names.iter().filter(|of| channel(of) == channel(name));
        alike.count() == 1
    };
    let each = names.iter();
    each.map(|&name| if once(name) { channel(name) } else { name })
        .collect()
}

/// How an estimator answers the sensors that it answers most: a step of one unit, or one unit for one minute. What a kelvin moves
/// cannot stand beside what a per cent moves, so that each unit has a picture, with what its name ends in.
pub(crate) fn responses(of: &Responses, impulse: bool) -> Vec<(String, Picture)> {
    let mut units: Vec<&str> = Vec::new();
    for sensor in &of.sensors {
        if !units.contains(&&*sensor.sensor_unit) {
            units.push(&sensor.sensor_unit);
        }
    }
    let pictures = units.into_iter().enumerate().map(|(nth, unit)| {
        let ending = match nth {
            0 => String::new(),
            nth => format!("-{}", nth + 1),
        };
        (ending, response(of, unit, impulse))
    });
    pictures.collect()
}

fn response(of: &Responses, of_unit: &str, impulse: bool) -> Picture {
    let alike = of.sensors.iter().filter(|of| of.sensor_unit == of_unit);
    let mut largest: Vec<&Response> = alike.collect();
    largest.sort_by(|a, b| b.peak.abs().total_cmp(&a.peak.abs()));
    largest.truncate(LINES.len());
    let times = largest.iter().flat_map(|of| &of.time_s).copied();
    let time = TimeUnit::of(times.fold(0.0, f64::max));
    let names: Vec<&str> = largest.iter().map(|of| &*of.sensor).collect();
    let lines = largest.iter().zip(short(&names)).enumerate();
    let lines = lines.map(|(nth, (sensor, name))| {
        // Predictions for the time until the horizon were made before anything happened.
        let ahead_s = sensor.time_s.first().copied().filter(|ahead| *ahead > 0.0);
        let before = ahead_s.map_or(Vec::new(), |ahead| vec![0.0, ahead]);
        let scale = if impulse { time.seconds / 60.0 } else { 1.0 };
        let answer = if impulse {
            &sensor.impulse
        } else {
            &sensor.step
        };
        let y = before.iter().map(|_| 0.0);
        let y = y.chain(answer.iter().map(|y| y * scale)).collect();
        let x = before.iter().chain(&sensor.time_s);
        let x = x.map(|at| at / time.seconds).collect();
        Points::line(nth, name, x, y)
    });
    let lines: Vec<Points> = lines.collect();
    let (what, unit) = if impulse {
        (
            "Impulse",
            format!("{} per {of_unit}·{}", of.unit, time.symbol),
        )
    } else {
        ("Step", format!("{} per {of_unit}", of.unit))
    };
    let y_range = impulse.then(|| most_of(&lines)).flatten();
    let cut = if y_range.is_some() {
        ", spikes cut"
    } else {
        ""
    };
    Picture {
        title: format!("{what} response of {}", of.node),
        x_label: format!(
            "{} after the {}",
            time.name,
            if impulse { "impulse" } else { "step" }
        ),
        y_label: format!("{}: {unit}{cut}", of.node),
        y_range,
        points: lines,
        ..Picture::default()
    }
}

/// Where the lines lie but for a few points of each, if these lie far beyond. An impulse makes a spike where a level enters, and beside
/// that nothing would be seen. A line that is hardly more than so few points is no spike: it is all that is answered.
fn most_of(lines: &[Points]) -> Option<(f64, f64)> {
    let (mut size, mut largest) = (0.0_f64, 0.0_f64);
    for line in lines {
        let sizes = line.y.iter().map(|y| y.abs()).filter(|y| *y > 0.0);
        let mut sizes: Vec<f64> = sizes.collect();
        sizes.sort_by(f64::total_cmp);
        let Some(&last) = sizes.last() else {
            continue;
        };
        let is_few = sizes.len() <= 2 * IN_SPIKES;
        let rest = if is_few {
            last
        } else {
            sizes[sizes.len() - 1 - IN_SPIKES]
        };
        (size, largest) = (size.max(rest), largest.max(last));
    }
    (largest > SPIKE * size).then_some((-1.1 * size, 1.1 * size))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(y: impl IntoIterator<Item = f64>) -> Points {
        let y: Vec<f64> = y.into_iter().collect();
        Points::line(0, "", vec![0.0; y.len()], y)
    }

    #[test]
    fn spikes_are_cut_where_they_hide_the_rest_of_an_answer_and_no_answer_is_one() {
        let slow = || line((0..100).map(|nth| 0.02 * f64::from(-nth).exp2().max(0.1)));
        let spike = || line([5.0, -5.0].into_iter().chain((0..100).map(|_| 0.02)));
        let short = || line([1.0, 1.5, 1.8, 1.2, -0.9, -1.5, -1.8, -1.1, 0.0, 0.0]);
        let size = |lines: &[Points]| most_of(lines).map(|range| range.1);
        assert_eq!(size(&[slow()]), None);
        assert!(size(&[spike(), slow()]).is_some_and(|size| size < 0.03));
        assert_eq!(size(&[slow(), short()]), None);
        assert_eq!(size(&[line([0.0; 9])]), None);
    }
}
