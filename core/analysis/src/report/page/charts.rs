//! The pictures of an axis and of a correction; [`crate::chart`] draws them.

use std::fmt::Write as _;

use super::super::{Axis, Errors, Facts, Hours, Light, Voter, Weight};
use crate::chart::{Chart, LINES, Layer, Mark};

/// Stretches that are quasi-stable or transient, run together where they follow each other.
fn bands(axis: &Axis) -> Vec<(f64, f64, &'static str)> {
    let Some((stable, transient)) = axis.states else {
        return Vec::new();
    };
    let mut bands: Vec<(f64, f64, &'static str)> = Vec::new();
    let pairs = axis.truth.time_s.windows(2).zip(&axis.truth.value);
    for (times, y) in pairs {
        let class = match y.abs() {
            size if size >= transient => "s2",
            size if size >= stable => "s1",
            _ => continue,
        };
        let to = times[1].min(times[0] + 600.0);
        match bands.last_mut() {
            Some(last) if last.2 == class && times[0] - last.1 < 600.0 => last.1 = to,
            _ => bands.push((times[0], to, class)),
        }
    }
    bands
}

fn over_time(axis: &Axis, title: &str, hours: &Hours) -> Chart<'static> {
    Chart {
        title: format!("{title} of {}", axis.name),
        x_label: hours.label.clone(),
        y_label: format!("{} in {}", axis.name, axis.unit),
        height: 220.0,
        time: true,
        zero: hours.from_s,
        ..Chart::default()
    }
}

/// Drift measured, predicted, and what is left of it.
pub(super) fn drift<'a>(axis: &'a Axis, errors: &'a [f64], facts: &'a Facts) -> Chart<'a> {
    let main = axis.put_out();
    let time_s = &axis.truth.time_s;
    let corrected = facts.worth.as_ref().and_then(|worth| {
        let i = worth.place_of(axis)?;
        Some(&worth.drift_with[i])
    });
    let mut chart = over_time(axis, "Drift", &Hours::of(&facts.course));
    if axis.states.is_some() {
        chart
            .x_label
            .push_str("; shaded: quasi-stable, darker: transient");
    }
    Chart {
        height: 260.0,
        layers: vec![
            Layer::line(time_s, &axis.truth.value, "c1", "measured"),
            Layer::line(
                time_s,
                &main.value,
                "c2",
                format!("predicted ({})", main.called),
            ),
            match corrected {
                Some(with) => Layer::line(&with.time_s, &with.value, "c3", "left after correction"),
                None => Layer::line(time_s, errors, "c3", "left: predicted − measured"),
            },
        ],
        bands: bands(axis),
        ..chart
    }
}

/// The same for a narrow screen.
pub(super) fn drift_small<'a>(axis: &'a Axis, errors: &'a [f64], facts: &'a Facts) -> Chart<'a> {
    Chart {
        width: 460.0,
        height: 240.0,
        ..drift(axis, errors, facts)
    }
}

/// The prediction of each voter.
pub(super) fn votes<'a>(axis: &'a Axis, hours: &Hours) -> Chart<'a> {
    let shown = shown(axis);
    let mut chart = over_time(axis, "Predictions", hours);
    if shown.len() < axis.voters.len() {
        let (some, all) = (shown.len(), axis.voters.len());
        let _ = write!(chart.y_label, ", {some} of {all} predictions");
    }
    chart.layers = shown
        .iter()
        .zip(LINES)
        .map(|(voter, class)| {
            Layer::line(
                &axis.truth.time_s,
                &voter.value,
                class,
                voter.called.as_str(),
            )
        })
        .collect();
    chart
}

/// The voters whose lines can be distinguished: all, or of many the output and those that weigh most.
fn shown(axis: &Axis) -> Vec<&Voter> {
    let weight = |voter: &Voter| {
        let of = axis.weights.iter().find(|of| of.slot == voter.slot);
        of.map_or(0.0, |of| {
            of.value.iter().filter(|weight| **weight > 0.0).sum::<f64>()
        })
    };
    let is_main = |nth: usize| nth == axis.main;
    let mut order: Vec<usize> = (0..axis.voters.len()).collect();
    order.sort_by(|&a, &b| {
        let weights = weight(&axis.voters[b]).total_cmp(&weight(&axis.voters[a]));
        is_main(b).cmp(&is_main(a)).then(weights)
    });
    order.truncate(LINES.len());
    order.sort_unstable();
    order.into_iter().map(|nth| &axis.voters[nth]).collect()
}

/// How much each voter counts; none where nothing is weighed.
pub(super) fn weights<'a>(axis: &'a Axis, hours: &Hours) -> Option<Chart<'a>> {
    let first = axis.weights.first()?;
    let shown = shown(axis);
    let layer = |weight: &'a Weight| {
        let nth = shown.iter().position(|voter| voter.slot == weight.slot)?;
        let name = shown[nth].called.as_str();
        Some(Layer::line(
            &axis.truth.time_s,
            &weight.value,
            LINES[nth],
            name,
        ))
    };
    Some(Chart {
        y_label: format!("{} weights in {}", axis.name, first.node),
        height: 160.0,
        layers: axis.weights.iter().filter_map(layer).collect(),
        y_range: Some((0.0, 1.0)),
        ..over_time(axis, "Weights", hours)
    })
}

fn small<'a>(
    title: String,
    x_label: String,
    y_label: String,
    x: &'a [f64],
    y: &'a [f64],
    mark: Mark,
) -> Chart<'a> {
    Chart {
        title,
        x_label,
        y_label,
        width: 460.0,
        height: 250.0,
        layers: vec![Layer {
            x,
            y,
            class: "c2",
            label: String::new(),
            mark,
        }],
        ..Chart::default()
    }
}

/// Predictions against truths, and the spread of the errors.
pub(super) fn errors<'a>(axis: &'a Axis, errors: &'a Errors) -> [(&'static str, Chart<'a>); 2] {
    let name = &axis.name;
    let scatter = small(
        format!("Predicted against measured, {name}"),
        format!("measured, in {}", axis.unit),
        format!("{name} predicted, in {}", axis.unit),
        &axis.truth.value,
        &axis.put_out().value,
        Mark::Dots,
    );
    let histogram = small(
        format!("Errors of {name}"),
        format!(
            "predicted − measured, in {}; the outermost hold all beyond",
            axis.error_unit
        ),
        format!("{name} errors, count"),
        &errors.centres,
        &errors.counts,
        Mark::Bars,
    );
    [("scatter", scatter), ("histogram", histogram)]
}

/// Optical loss without and with the correction; none without losses.
pub(super) fn loss<'a>(light: &'a Light, hours: &Hours) -> Option<Chart<'a>> {
    let (without, with) = (&light.loss_without, &light.loss_with);
    (!with.value.is_empty()).then(|| Chart {
        title: format!("Optical loss over {}", light.span()),
        x_label: hours.label.clone(),
        y_label: format!(
            "loss in dB, cut at {}; dashed: its limit",
            10.0 * light.loss_limit
        ),
        height: 260.0,
        layers: vec![
            Layer::line(&without.time_s, &without.value, "c1", "without correction"),
            Layer::line(&with.time_s, &with.value, "c3", "with correction"),
        ],
        limits: vec![light.loss_limit],
        y_range: Some((0.0, 10.0 * light.loss_limit)),
        time: true,
        zero: hours.from_s,
        ..Chart::default()
    })
}
