//! Decides which correlations and responses of an axis are shown: those that say most, one per sensor.

use super::super::verdict::is_channel;
use super::super::{Axis, Facts};
use crate::chart::{Chart, LINES, Layer};
use crate::diagnosis::response::Response;

/// Lines over lags or times in minutes.
pub(super) struct Curves {
    /// What they are, as part of a file's name.
    pub(super) kind: &'static str,
    title: String,
    x_label: &'static str,
    y_label: String,
    y_range: Option<(f64, f64)>,
    lines: Vec<Line>,
}

struct Line {
    name: String,
    minutes: Vec<f64>,
    value: Vec<f64>,
}

impl Curves {
    pub(super) fn chart(&self) -> Chart<'_> {
        let lines = self.lines.iter().zip(LINES);
        Chart {
            title: self.title.clone(),
            x_label: self.x_label,
            y_label: self.y_label.clone(),
            width: 460.0,
            height: 250.0,
            layers: lines
                .map(|(line, class)| {
                    Layer::line(&line.minutes, &line.value, class, line.name.as_str())
                })
                .collect(),
            limits: vec![0.0],
            y_range: self.y_range,
            ..Chart::default()
        }
    }
}

fn minutes(seconds: &[f64]) -> Vec<f64> {
    seconds.iter().map(|s| s / 60.0).collect()
}

/// The pictures of an axis: correlation against the lag, and impulse responses.
pub(super) fn of(axis: &Axis, facts: &Facts) -> Vec<Curves> {
    let [steps, impulses] = [false, true].map(|impulse| responses(axis, facts, impulse));
    [lags(axis, facts), steps, impulses]
        .into_iter()
        .flatten()
        .collect()
}

/// The features that go most with the truth, one of each sensor.
fn lags(axis: &Axis, facts: &Facts) -> Option<Curves> {
    let lags = facts
        .lags
        .iter()
        .find(|lags| is_channel(&lags.truth, &axis.name))?;
    let mut features: Vec<_> = lags
        .features
        .iter()
        .filter(|of| !of.truth.best.is_nan())
        .collect();
    features.sort_by(|a, b| b.truth.best.abs().total_cmp(&a.truth.best.abs()));
    let mut lines: Vec<Line> = Vec::new();
    let mut sensors = Vec::new();
    for feature in features {
        let (_, channel) = feature
            .feature
            .split_once('.')
            .unwrap_or(("", &feature.feature));
        let sensor = channel.split('@').next().unwrap_or(channel);
        if lines.len() < LINES.len() && !sensors.contains(&sensor) {
            sensors.push(sensor);
            lines.push(Line {
                name: channel.to_owned(),
                minutes: minutes(&lags.lag_s),
                value: feature.truth.r.clone(),
            });
        }
    }
    (!lines.is_empty()).then(|| Curves {
        kind: "lags",
        title: format!("Correlation of {} with features against the lag", axis.name),
        x_label: "lag in minutes",
        y_label: format!("{} correlation", axis.name),
        y_range: None,
        lines,
    })
}

/// How what is put out answers each sensor, or, where that is a vote, the first voter that answers any.
fn responses(axis: &Axis, facts: &Facts, impulse: bool) -> Option<Curves> {
    let of_axis = || {
        let all = facts.responses.iter();
        all.filter(|of| is_channel(&of.truth, &axis.name) && !of.sensors.is_empty())
    };
    let main = format!("{}.{}", axis.voters[axis.main].node, axis.name);
    let responses = of_axis()
        .find(|of| of.node == main)
        .or_else(|| of_axis().next())?;
    let mut sensors: Vec<_> = responses.sensors.iter().collect();
    sensors.sort_by(|a, b| b.peak.abs().total_cmp(&a.peak.abs()));
    let line = |of: &&Response| Line {
        name: of
            .sensor
            .split_once('.')
            .map_or(of.sensor.as_str(), |(_, name)| name)
            .to_owned(),
        minutes: minutes(&of.time_s),
        value: if impulse { &of.impulse } else { &of.step }.clone(),
    };
    let lines: Vec<Line> = sensors.iter().take(LINES.len()).map(line).collect();
    let (kind, name, per) = if impulse {
        ("impulses", "Impulse", "unit and minute")
    } else {
        ("steps", "Step", "unit")
    };
    Some(Curves {
        kind,
        title: format!("{name} responses of {}", responses.node),
        x_label: "minutes after the change",
        y_label: format!("{}, {} per {per}", responses.node, responses.unit),
        y_range: impulse.then(|| most_of(&lines)).flatten(),
        lines,
    })
}

/// Where nearly all of the lines lies. An impulse makes a spike in every slope that it enters, and beside that nothing would be seen.
fn most_of(lines: &[Line]) -> Option<(f64, f64)> {
    let values = lines.iter().flat_map(|line| &line.value);
    let mut sizes: Vec<f64> = values.map(|v| v.abs()).filter(|v| *v > 0.0).collect();
    sizes.sort_by(f64::total_cmp);
    let size = sizes.get(sizes.len() * 95 / 100)?;
    Some((-1.1 * size, 1.1 * size))
}
