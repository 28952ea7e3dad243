//! The columns of the page's tables.

use std::fmt::Write as _;

use athermal_run::model::EstimatorCard;
use athermal_run::score::Score;

use super::super::scores::share;
use super::super::verdict::is_worse;
use super::super::{
    Compared, Departure, Effect, Excursion, Hours, Light, SensorFacts, figure, spelled,
};
use crate::figures::count;
use crate::markup::escaped;

fn table(header: &[&str], rows: &str) -> String {
    let header: String = header
        .iter()
        .map(|cell| format!("<th scope=\"col\">{cell}</th>"))
        .collect();
    format!(
        "<div class=\"wide\" tabindex=\"0\" role=\"region\" aria-label=\"table\"><table><tr>{header}</tr>{rows}</table></div>\
         <p class=\"muted more\">The table goes on to the right: scroll it.</p>"
    )
}

pub(super) fn scores(scores: &[&Score]) -> String {
    let mut rows = String::new();
    for score in scores {
        let both = score.rmse.zip(score.baseline_zero);
        let worse = match both.is_some_and(|(rmse, zero)| is_worse(rmse, zero)) {
            true => " class=\"bad\"",
            false => "",
        };
        let valid = score
            .valid
            .map_or("–".to_owned(), |valid| format!("{:.1} %", 100.0 * valid));
        let _ = write!(
            rows,
            "<tr><td>{}</td><td>{}</td><td{worse}>{}</td><td>{}{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{valid}</td><td>{}</td></tr>",
            escaped(&score.output),
            escaped(&score.unit),
            figure(score.rmse),
            figure(score.baseline_zero),
            score.no_model_is.remark(),
            persistence(score),
            figure(score.truth_noise),
            score.r2_zero.map_or_else(|| "–".to_owned(), share),
            figure(score.bias),
            figure(score.max_abs),
            count(score.n),
        );
    }
    let header = [
        "prediction",
        "unit",
        "RMSE",
        "no model",
        "persistence",
        "standard error of truth",
        "R² against no model",
        "bias",
        "largest",
        "valid",
        "instants scored",
    ];
    table(&header, &rows)
}

/// The error of persistence, with the number of instants where these are few.
fn persistence(score: &Score) -> String {
    let error = figure(score.baseline_persistence);
    match score.persistence_on_few() {
        Some(few) => format!("{error} on {} of them", count(few)),
        None => error,
    }
}

pub(super) fn settling(light: &Light, hours: &Hours) -> String {
    let unit = escaped(spelled(light.set_point_unit.as_deref().unwrap_or_default()));
    let mut rows = String::new();
    for s in &light.settling {
        let minutes =
            |m: Option<f64>| m.map_or("not settled".to_owned(), |m| format!("{m:.1} min"));
        let _ = write!(
            rows,
            "<tr><td>{:.1} h</td><td>{:.1} {unit}</td><td>{:.1} {unit}</td><td>{}</td><td>{}</td><td>{} dB</td><td>{} dB</td></tr>",
            hours.at(s.at_s),
            s.from,
            s.to,
            minutes(s.without_min),
            minutes(s.with_min),
            figure(s.largest_without),
            figure(s.largest_with)
        );
    }
    let header = [
        "at",
        "from",
        "to",
        "settle time without",
        "with",
        "largest loss without",
        "with",
    ];
    table(&header, &rows)
}

pub(super) fn steps(light: &Light) -> String {
    let unit = escaped(spelled(light.set_point_unit.as_deref().unwrap_or_default()));
    let mut rows = String::new();
    for step in &light.steps {
        let name = match step.changes {
            0 => format!("at {:.0} {unit}, before any step", step.to),
            _ => format!("{:.0} → {:.0} {unit}", step.from, step.to),
        };
        let _ = write!(
            rows,
            "<tr><td>{name}</td><td>{}</td><td>{} dB</td><td>{} dB</td></tr>",
            step.changes,
            figure(step.largest_without),
            figure(step.largest_with)
        );
    }
    table(
        &["step", "how often", "largest loss without", "with"],
        &rows,
    )
}

/// How far positions depart from where they were when their corrections began, and what held these back.
pub(super) fn departures(departures: &[Departure]) -> String {
    let mut rows = String::new();
    for of in departures {
        let held = of
            .held_back
            .iter()
            .map(|(by, share)| format!("{by} {:.1} %", 100.0 * share));
        let _ = write!(
            rows,
            "<tr><td>{}</td><td>{}</td><td{}>{}</td><td>{}</td><td>{}</td><td>{}</td><td class=\"left{}\">{}</td></tr>",
            escaped(&of.axis),
            figure(of.rms_without),
            if of.is_worse() { " class=\"bad\"" } else { "" },
            figure(of.rms_with),
            figure(of.largest_without),
            figure(of.largest_with),
            escaped(spelled(&of.unit)),
            if of.limited().is_some() { " bad" } else { "" },
            held.collect::<Vec<_>>().join("; "),
        );
    }
    let header = [
        "position from its start",
        "RMS without",
        "with",
        "largest without",
        "with",
        "unit",
        "held back, of all ticks",
    ];
    table(&header, &rows)
}

pub(super) fn sensors(sensors: &[SensorFacts]) -> String {
    let mut rows = String::new();
    for sensor in sensors {
        let (low, high) = sensor.range.unwrap_or((f64::NAN, f64::NAN));
        let remarks = sensor.remarks();
        let remarks = if remarks.is_empty() {
            "<td class=\"left good\">in order</td>".to_owned()
        } else {
            format!(
                "<td class=\"left bad\">{}</td>",
                escaped(&remarks.join("; "))
            )
        };
        let _ = write!(
            rows,
            "<tr><td>{}</td>{remarks}<td>{}</td><td>{}</td><td>{:.1} s</td><td>{:.0} s</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>",
            escaped(&sensor.name),
            sensor.samples,
            sensor.rejected,
            sensor.mean_gap_s,
            sensor.longest_gap_s,
            figure(sensor.noise),
            figure(Some(low)),
            figure(Some(high)),
            escaped(spelled(&sensor.unit)),
        );
    }
    let header = [
        "channel",
        "health",
        "samples",
        "rejected",
        "mean gap",
        "longest gap",
        "noise of a sample",
        "lowest",
        "highest",
        "unit",
    ];
    table(&header, &rows)
}

/// Each estimator that went outside of its fit.
pub(super) fn excursions(all: &[Excursion], hours: &Hours) -> String {
    let mut rows = String::new();
    for of in all {
        let Some(worst) = &of.worst else { continue };
        let share = of.share.map(|share| 100.0 * share);
        let _ = write!(
            rows,
            "<tr><td>{}</td><td>{} %</td><td class=\"left\">{}</td><td>{:.1} to {:.1}</td><td>{}</td><td class=\"left\">{}</td>{}</tr>",
            escaped(&of.node),
            figure(share),
            of.done(),
            hours.at(worst.from_s),
            hours.at(worst.to_s),
            figure(Some(worst.novelty)),
            escaped(worst.by.as_deref().unwrap_or("–")),
            compared(of.errors.as_ref())
        );
    }
    let header = [
        "estimator",
        "outside, of the time",
        "its predictions then",
        "worst, hours",
        "largest novelty",
        "pushed by",
        "truths then",
        "RMSE",
        "had nothing been done",
        "no model",
        "unit",
    ];
    table(&header, &rows)
}

/// What heeding novelty did to what is put out.
pub(super) fn effects(all: &[Effect]) -> String {
    let mut rows = String::new();
    for of in all {
        let _ = write!(
            rows,
            "<tr><td>{}</td>{}</tr>",
            escaped(&of.prediction),
            compared(Some(&of.errors))
        );
    }
    let header = [
        "prediction",
        "truths that it changes",
        "RMSE",
        "had nothing been done",
        "no model",
        "unit",
    ];
    table(&header, &rows)
}

/// Five cells; a prediction that heeding novelty makes worse is marked.
fn compared(errors: Option<&Compared>) -> String {
    let Some(of) = errors else {
        return "<td>0</td><td>–</td><td>–</td><td>–</td><td></td>".to_owned();
    };
    let worse = of.rmse.zip(of.rmse_unheeded);
    let worse = worse.is_some_and(|(with, without)| is_worse(with, without));
    format!(
        "<td>{}</td><td{}>{}</td><td>{}</td><td>{}</td><td>{}</td>",
        count(of.n),
        if worse { " class=\"bad\"" } else { "" },
        figure(of.rmse),
        figure(of.rmse_unheeded),
        figure(of.baseline_zero),
        escaped(spelled(&of.unit))
    )
}

/// How the fit of each node that has one went.
pub(super) fn estimators(estimators: &[EstimatorCard]) -> String {
    let mut rows = String::new();
    for estimator in estimators {
        let dropped = &estimator.dropped;
        let _ = write!(
            rows,
            "<tr><td>{}</td><td class=\"left\">{} of {}</td><td>{}</td><td>{}</td><td>{} {}</td><td>{}</td><td class=\"left\">{}</td></tr>",
            escaped(&estimator.node),
            escaped(&estimator.kind),
            escaped(&estimator.truth),
            estimator.rows,
            dropped.without_run + dropped.outside_limits + dropped.leapt + dropped.incomplete,
            figure(estimator.report.in_sample_rmse),
            escaped(&estimator.unit),
            figure(estimator.report.condition),
            escaped(&estimator.report.notes.join(" ")),
        );
    }
    table(
        &[
            "node",
            "kind",
            "rows",
            "left out",
            "RMSE of the fit",
            "condition",
            "notes",
        ],
        &rows,
    )
}
