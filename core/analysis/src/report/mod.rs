//! What a fitted graph is worth on recorded data: the facts, and the page that shows them.
//!
//! [`gather`] steps the model over a recording and collects [`Facts`]; [`page`] makes one self-contained HTML page of
//! them, [`plots`] single pictures, [`text`] what fits on a terminal.

mod change;
mod course;
mod departure;
mod errors;
mod excursions;
mod hours;
mod light;
mod novelty;
mod page;
mod realignment;
mod recomputed;
mod scores;
mod sensors;
mod stays;
mod text;
mod track;
mod verdict;
mod worth;

pub use change::{Settling, StepLoss};
pub use course::{Axis, Course, Voter, Weight};
pub use departure::Departure;
pub use errors::Errors;
use excursions::NoveltyWatch;
use hours::Hours;
pub use light::Light;
pub use novelty::{Compared, Contradiction, Effect, Excursion, Novelty, Spoken, Stretch};
pub use page::{page, plots};
pub use realignment::Realignment;
pub use scores::{outputs, scores};
pub use sensors::SensorFacts;
pub use stays::Stays;
pub use text::text;
pub use track::Unjudged;
pub use verdict::Verdict;
pub use worth::Worth;

use athermal_core::diagnostic::digits;
use athermal_run::model::{Card, Model};
use athermal_run::recording::Recording;
use athermal_run::score::{FellBack, Lack, Score, ScoreOptions, Scores, score};
use serde::Serialize;

use crate::diagnosis::lag::{Lags, lags};
use crate::diagnosis::observe;
use crate::diagnosis::residual::residuals;
use crate::diagnosis::response::{Responses, responses};

/// The facts of a report.
#[derive(Debug, Clone, Serialize)]
pub struct Facts {
    /// The graph's name.
    pub graph: String,
    /// Where the data come from, as given.
    pub data: Vec<String>,
    /// What the model is worth, by axis.
    pub verdicts: Vec<Verdict>,
    /// The scores of every prediction over all truths.
    pub scores: Vec<Score>,
    /// The combiners that went by fewer truths than they take.
    pub lacks: Vec<Lack>,
    /// How often fallbacks took over.
    pub fell_back: Vec<FellBack>,
    /// What happened over time.
    pub course: Course,
    /// How far predictions went outside of their fits, and which sensors contradicted the others.
    pub novelty: Novelty,
    /// How the errors of what is put out are spread, by axis.
    pub errors: Vec<Errors>,
    /// How features go with truths and residuals, against the lag.
    pub lags: Vec<Lags>,
    /// How estimators answer a change of one sensor.
    pub responses: Vec<Responses>,
    /// What the correction is worth; none for a graph without a `compensate` node, or where it cannot be judged.
    pub worth: Option<Worth>,
    /// Corrections, losses and settle times that cannot be judged, and why.
    pub unjudged: Vec<Unjudged>,
    /// How the model was made.
    pub card: Option<Card>,
}

/// A series over time.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Series {
    /// Instants in s.
    pub time_s: Vec<f64>,
    /// The value at each; NaN (null in JSON) where there is none.
    pub value: Vec<f64>,
}

impl Series {
    fn push(&mut self, time_s: f64, value: f64) {
        self.time_s.push(time_s);
        self.value.push(value);
    }
}

/// Root mean square of what is there; none of nothing.
#[must_use]
pub fn rms(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (mut sum, mut count) = (0.0, 0_usize);
    for value in values.filter(|value| !value.is_nan()) {
        sum += value * value;
        count += 1;
    }
    (count > 0).then(|| (sum / count as f64).sqrt())
}

/// A figure to about three significant digits, however small or large its unit makes it; a dash for none.
fn figure(value: Option<f64>) -> String {
    match value {
        Some(value) if value.is_nan() => "–".to_owned(),
        None => "–".to_owned(),
        Some(value) if value.abs() >= 1e6 => digits(value, 3),
        Some(value) if value.abs() >= 100.0 => format!("{value:.0}"),
        Some(value) if value.abs() >= 10.0 => format!("{value:.1}"),
        Some(value) if value.abs() >= 0.1 || value == 0.0 => format!("{value:.2}"),
        Some(value) if value.abs() >= 0.01 => format!("{value:.3}"),
        Some(value) => digits(value, 3),
    }
}

/// A unit as people write it.
fn spelled(unit: &str) -> &str {
    match unit {
        "Cel" => "°C",
        "[degF]" => "°F",
        unit => unit,
    }
}

/// Why there is no report.
pub type ReportError = Box<dyn std::error::Error + Send + Sync>;

/// Steps a model over a recording and collects the facts of a report.
///
/// # Errors
/// When the recording cannot be read, or the fit does not belong to the graph.
pub fn gather(
    model: &Model,
    recording: &dyn Recording,
    data: Vec<String>,
) -> Result<Facts, ReportError> {
    let Scores {
        scores,
        lacks,
        fell_back,
        ..
    } = score(
        &model.plan,
        &model.fitted,
        recording,
        &ScoreOptions {
            levels: model.levels(),
            ..ScoreOptions::default()
        },
        &mut |_| {},
    )?;
    let observation = observe(model, recording)?;
    let mut watch = NoveltyWatch::new(model);
    let (course, track, mut unjudged) =
        course::follow(model, recording, &observation.trace, &mut watch)?;
    let (mut novelty, periods) = watch.finish();
    novelty.compare(model, recording, &course.axes, &periods)?;
    let worth = worth::worth(track, &mut unjudged)?;
    let verdict = |axis, nth| Verdict::of(axis, nth, &scores, worth.as_ref());
    let shown = course.axes.iter().map(|axis| verdict(axis, axis.main));
    let others = course.axes.iter().flat_map(|axis| {
        let others = axis.other_outputs();
        others.map(move |nth| verdict(axis, nth))
    });
    let residuals = residuals(&model.plan, &observation);
    Ok(Facts {
        graph: model.plan.name.clone().unwrap_or_default(),
        data,
        verdicts: shown.chain(others).collect(),
        novelty,
        errors: course
            .axes
            .iter()
            .map(|axis| Errors::of(axis, &residuals))
            .collect(),
        lags: lags(model, recording, &observation, &[])?,
        responses: responses(model, &observation)?,
        scores,
        lacks,
        fell_back,
        course,
        worth,
        unjudged,
        card: model.card.clone(),
    })
}

#[cfg(test)]
mod tests {
    use super::figure;

    #[test]
    fn a_figure_keeps_its_digits_in_any_unit() {
        let texts = [0.0, 107.3, 21.46, 2.534, 0.0683, -4.2e-8, 1.234e-3, 3.5e9]
            .map(|value| figure(Some(value)));
        let expected = [
            "0.00", "107", "21.5", "2.53", "0.068", "-4.20e-8", "0.00123", "3.50e9",
        ];
        assert_eq!(texts, expected);
        assert_eq!([None, Some(f64::NAN)].map(figure), ["–", "–"]);
    }
}
