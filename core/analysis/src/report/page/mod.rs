//! What stands on the page and in which order; [`crate::chart`] draws its pictures.

mod charts;
mod curves;
mod style;
mod tables;

use std::fmt::Write as _;

use athermal_run::score::Score;

use super::{Axis, Facts, Hours, Light, Verdict, Worth, figure};
use crate::chart::{COLOURS, Chart, Plot, STYLE};
use crate::figures::{count, time};
use crate::markup::escaped;

/// One self-contained HTML page: no request leaves it, it prints, and it follows the reader's light or dark.
#[must_use]
pub fn page(facts: &Facts) -> String {
    let title = escaped(&facts.graph);
    let mut html = format!(
        "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width,initial-scale=1\">\
         <title>{title} report</title><link rel=\"icon\" href=\"data:,\"><style>:root{{color-scheme:light dark}}{COLOURS}{STYLE}{}</style></head><body><h1>{title}</h1>",
        style::STYLE
    );
    verdicts(&mut html, facts);
    worth_section(&mut html, facts);
    scores(&mut html, facts);
    outside(&mut html, facts);
    over_time(&mut html, facts);
    votes(&mut html, facts);
    chosen(&mut html, facts);
    html.push_str("<h2 id=\"sensors\">Sensors</h2>");
    html.push_str(&tables::sensors(&facts.course.sensors));
    card(&mut html, facts);
    let _ = write!(html, "<script>{}</script></body></html>", style::SCRIPT);
    html
}

/// The first screen: the machine, when, the verdict on what drifts most and its picture, sensors to look at, all other verdicts.
fn verdicts(html: &mut String, facts: &Facts) {
    let data: Vec<String> = facts.data.iter().map(|path| escaped(path)).collect();
    let (from, to) = facts.course.period_s.unwrap_or((0.0, 0.0));
    let days = (to - from) / 86400.0;
    let hours = Hours::of(&facts.course);
    let when = hours
        .dates(to)
        .map_or(String::new(), |dates| format!("{dates}, "));
    let _ = write!(
        html,
        "<p class=\"muted\">{when}{days:.1} days, {} ticks, from {}. Errors are root mean squares.</p>",
        count(facts.course.ticks),
        data.join(", ")
    );
    for headline in facts.worth.iter().flat_map(Worth::headlines) {
        let _ = write!(html, "<p><b>{}</b></p>", escaped(&headline));
    }
    let drift = |verdict: &Verdict| verdict.baseline_zero.unwrap_or(0.0);
    let first = (0..facts.verdicts.len())
        .rev()
        .max_by(|a, b| drift(&facts.verdicts[*a]).total_cmp(&drift(&facts.verdicts[*b])));
    let Some(first) = first else { return };
    let _ = write!(
        html,
        "<ul class=\"verdicts\">{}</ul>",
        line(&facts.verdicts[first])
    );
    let axis = facts.course.axes.iter();
    if let Some(axis) = axis
        .into_iter()
        .find(|of| of.name == facts.verdicts[first].axis)
    {
        let errors = axis.errors();
        let _ = write!(
            html,
            "<div class=\"at-large\">{}</div><div class=\"at-small\">{}</div>",
            charts::drift(axis, &errors, facts).svg(),
            charts::drift_small(axis, &errors, facts).svg()
        );
    }
    html.push_str(&sensors_to_look_at(facts));
    let others = facts
        .verdicts
        .iter()
        .enumerate()
        .filter(|(nth, _)| *nth != first);
    let others: String = others.map(|(_, verdict)| line(verdict)).collect();
    let _ = write!(html, "<ul class=\"verdicts\">{others}</ul>");
}

/// A verdict in a line.
fn line(verdict: &Verdict) -> String {
    let class = if verdict.is_good() {
        ""
    } else {
        " class=\"bad\""
    };
    let ahead = match verdict.ahead_s {
        0.0 => String::new(),
        ahead_s => format!(", {} ahead", time(ahead_s)),
    };
    let (name, short) = (escaped(&verdict.output), escaped(&verdict.short()));
    format!("<li{class}><b>{name}</b>{ahead}: {short}</li>")
}

fn sensors_to_look_at(facts: &Facts) -> String {
    let sensors = &facts.course.sensors;
    let odd = sensors.iter().filter(|of| !of.remarks().is_empty());
    let odd: Vec<String> = odd
        .map(|of| {
            format!(
                "<b>{}</b> ({})",
                escaped(&of.name),
                escaped(&of.remarks().join("; "))
            )
        })
        .collect();
    match odd.is_empty() {
        true => format!(
            "<p class=\"good\">Sensors: all {} are in order.</p>",
            sensors.len()
        ),
        false => format!(
            "<p>Sensors to look at: {}. <a href=\"#sensors\">All sensors</a></p>",
            odd.join(", ")
        ),
    }
}

/// What goes out first, and folded the voters beside it.
fn scores(html: &mut String, facts: &Facts) {
    let goes_out = |score: &&Score| {
        facts
            .verdicts
            .iter()
            .any(|of| of.prediction == score.output)
    };
    let (out, others): (Vec<&Score>, Vec<&Score>) = facts.scores.iter().partition(goes_out);
    let _ = write!(
        html,
        "<h2>Scores</h2><p class=\"muted\">As <code>athermal evaluate</code> without options gives them: one step ahead, all truths. What goes \
         out is scored wherever it has a value.</p>{}",
        tables::scores(&out)
    );
    if !others.is_empty() {
        let _ = write!(
            html,
            "<details><summary>{} predictions beside these</summary><p class=\"muted\">On the instants at which all are valid.</p>{}</details>",
            others.len(),
            tables::scores(&others)
        );
    }
}

fn worth_section(html: &mut String, facts: &Facts) {
    if facts.worth.is_none() && facts.unjudged.is_empty() {
        return;
    }
    html.push_str("<h2>What the correction is worth</h2>");
    for of in &facts.unjudged {
        let _ = write!(
            html,
            "<p class=\"bad\">Nothing is known of <b>{}</b>: {}.</p>",
            escaped(&of.of),
            escaped(&of.why)
        );
    }
    let Some(worth) = &facts.worth else {
        return;
    };
    html.push_str(&tables::departures(&worth.departures));
    for light in worth.lights() {
        if let Some(name) = light.loss.as_ref().filter(|_| !worth.others.is_empty()) {
            let _ = write!(html, "<h3>{}</h3>", escaped(name));
        }
        light_section(html, light, &Hours::of(&facts.course));
    }
}

fn light_section(html: &mut String, light: &Light, hours: &Hours) {
    if let Some(chart) = charts::loss(light, hours) {
        let worst = |losses: &[f64]| figure(losses.iter().copied().reduce(f64::max));
        let _ = write!(
            html,
            "<p>Largest loss over {}: {} dB without, {} dB with correction; the picture ends at {} dB.</p><div class=\"wide\" tabindex=\"0\" role=\"region\" aria-label=\"picture\">{}</div>",
            light.span(),
            worst(&light.loss_without.value),
            worst(&light.loss_with.value),
            10.0 * light.loss_limit,
            chart.svg()
        );
    }
    if !light.settling.is_empty() {
        html.push_str("<h3>Settle time and largest loss per change of the set point</h3>");
        html.push_str(&tables::settling(light, hours));
        let _ = write!(
            html,
            "<p class=\"muted\">From the change, in {}, to the start of the first ten minutes that are stable throughout.</p>",
            hours.label
        );
    }
    if !light.steps.is_empty() {
        html.push_str("<h3>Largest loss per temperature step</h3>");
        html.push_str(&tables::steps(light));
    }
}

/// How far predictions went outside of their fits, and which sensors contradicted the others.
fn outside(html: &mut String, facts: &Facts) {
    let (novelty, hours) = (&facts.novelty, Hours::of(&facts.course));
    if novelty.estimators.is_empty() && novelty.contradictions.is_empty() {
        return;
    }
    let _ = write!(
        html,
        "<h2>Outside of what was learned</h2><p class=\"muted\">Novelty is how far the regressors of a prediction are outside of those of \
         the fit; 1 is its edge, where one row of a thousand of the fit lies. Times are in {}.</p>",
        hours.label
    );
    for contradiction in &novelty.contradictions {
        let sentence = contradiction.sentence(&hours);
        let _ = write!(html, "<p class=\"bad\">{}</p>", escaped(&sentence));
    }
    for learner in &novelty.learners {
        let _ = write!(html, "<p>{}</p>", escaped(&learner.sentence()));
    }
    if novelty.estimators.iter().all(|of| of.worst.is_none()) {
        html.push_str("<p>No prediction was made from outside.</p>");
        return;
    }
    html.push_str(&tables::excursions(&novelty.estimators, &hours));
    if !novelty.effects.is_empty() {
        html.push_str("<h3>What heeding it does to what is put out</h3>");
        html.push_str(&tables::effects(&novelty.effects));
    }
}

fn over_time(html: &mut String, facts: &Facts) {
    html.push_str("<h2>Drift over time</h2><p class=\"muted screen\">Drag across a picture to look closer, double-click for all; the wheel with Ctrl or Shift zooms.</p>");
    let axes = &facts.course.axes;
    for (states, of) in limits(axes) {
        let _ = write!(
            html,
            "<p class=\"muted\">Shaded{}: quasi-stable from {}.</p>",
            escaped(&of),
            escaped(&states)
        );
    }
    for axis in axes {
        let errors = axis.errors();
        wide(html, &charts::drift(axis, &errors, facts));
    }
}

/// Limits of the states of stability, each with the axes of which they are where others have others.
fn limits(axes: &[Axis]) -> Vec<(String, String)> {
    let mut limits: Vec<(String, Vec<&str>)> = Vec::new();
    for axis in axes {
        let Some((stable, transient)) = axis.states else {
            continue;
        };
        let text = format!("{stable}, transient from {transient} {}", axis.unit);
        match limits.iter_mut().find(|(known, _)| *known == text) {
            Some((_, names)) => names.push(&axis.name),
            None => limits.push((text, vec![&axis.name])),
        }
    }
    let several = limits.len() > 1;
    let of = |names: Vec<&str>| match several {
        true => format!(" of {}", names.join(", ")),
        false => String::new(),
    };
    let limits = limits.into_iter();
    limits.map(|(text, names)| (text, of(names))).collect()
}

fn wide(html: &mut String, chart: &Chart<'_>) {
    let _ = write!(
        html,
        "<div class=\"wide\" tabindex=\"0\" role=\"region\" aria-label=\"picture\">{}</div>",
        chart.svg()
    );
}

fn votes(html: &mut String, facts: &Facts) {
    html.push_str(
        "<h2>Votes, features and errors</h2><p class=\"muted\">At a positive lag the drift follows the feature, so that the feature can predict it. \
         Responses are the estimator's to one sensor alone: a step of one unit, and an impulse of the size that stands at its axis.</p>",
    );
    let hours = Hours::of(&facts.course);
    for (axis, errors) in facts.course.axes.iter().zip(&facts.errors) {
        let _ = write!(html, "<details><summary>{}</summary>", escaped(&axis.name));
        wide(html, &charts::votes(axis, &hours));
        if let Some(chart) = charts::weights(axis, &hours) {
            wide(html, &chart);
        }
        html.push_str("<div class=\"pair\">");
        for curves in curves::of(axis, facts) {
            html.push_str(&curves.chart().svg());
        }
        for (_, chart) in charts::errors(axis, errors) {
            html.push_str(&chart.svg());
        }
        html.push_str("</div></details>");
    }
}

fn chosen(html: &mut String, facts: &Facts) {
    let estimators = facts.card.iter().flat_map(|card| &card.estimators);
    let mut chosen = estimators
        .filter(|e| !e.report.selection.is_empty())
        .peekable();
    if chosen.peek().is_none() {
        return;
    }
    html.push_str(
        "<h2>Chosen features</h2><p class=\"muted\">Sensor and window, in the order chosen, with the cross-validated R² after each. A slope over a window follows what happens half of it later.</p>",
    );
    for estimator in chosen {
        let steps = estimator
            .report
            .selection
            .iter()
            .map(|step| format!("{} ({:.3})", escaped(&step.label()), step.score));
        let _ = write!(
            html,
            "<p><b>{}</b>: {}</p>",
            escaped(&estimator.node),
            steps.collect::<Vec<_>>().join(", ")
        );
    }
}

fn card(html: &mut String, facts: &Facts) {
    let Some(card) = &facts.card else {
        html.push_str("<h2>Model card</h2><p>A graph without a fit.</p>");
        return;
    };
    let _ = write!(
        html,
        "<h2>Model card</h2><p>Made by athermal {}",
        escaped(&card.athermal)
    );
    if let Some(created) = &card.created {
        let _ = write!(html, " on {}", escaped(created));
    }
    let _ = write!(html, " from {} ticks", card.ticks);
    if let Some(period) = card.period {
        let _ = write!(
            html,
            " over {:.1} days",
            (period.to_s - period.from_s) / 86400.0
        );
    }
    html.push_str(".</p><ul>");
    for data in &card.data {
        let path = Some(&*data.path).filter(|path| !path.is_empty());
        let time = |word: &str, of: &Option<String>| {
            let of = of.as_deref().map(escaped);
            of.map_or(String::new(), |of| format!(" {word} {of}"))
        };
        let _ = write!(
            html,
            "<li>{}{}{}: {} rows, {} bytes, checksum {}</li>",
            escaped(path.unwrap_or("rows from elsewhere")),
            time("from", &data.from),
            time("to", &data.to),
            data.rows,
            data.bytes,
            escaped(&data.hash)
        );
    }
    html.push_str("</ul>");
    html.push_str(&tables::estimators(&card.estimators));
}

/// Every picture of the page as files of its own; those with nothing to draw are left out.
#[must_use]
pub fn plots(facts: &Facts) -> Vec<Plot> {
    let hours = Hours::of(&facts.course);
    let mut plots = Vec::new();
    let mut add = |name: String, chart: &Chart<'_>| plots.extend(Plot::of(name, chart));
    for (axis, spread) in facts.course.axes.iter().zip(&facts.errors) {
        let (errors, name) = (axis.errors(), &axis.name);
        add(
            format!("drift-{name}"),
            &charts::drift(axis, &errors, facts),
        );
        add(format!("votes-{name}"), &charts::votes(axis, &hours));
        if let Some(chart) = charts::weights(axis, &hours) {
            add(format!("weights-{name}"), &chart);
        }
        for curves in curves::of(axis, facts) {
            add(format!("{}-{name}", curves.kind), &curves.chart());
        }
        for (kind, chart) in charts::errors(axis, spread) {
            add(format!("{kind}-{name}"), &chart);
        }
    }
    if let Some(worth) = &facts.worth {
        let several = !worth.others.is_empty();
        for light in worth.lights() {
            let named = light.loss.as_ref().filter(|_| several);
            let name = named.map_or("loss".to_owned(), |node| format!("loss-{node}"));
            if let Some(chart) = charts::loss(light, &hours) {
                add(name, &chart);
            }
        }
    }
    plots
}
