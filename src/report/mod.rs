//! What a fitted graph is worth on recorded data: the facts, and the page that shows them.
//!
//! [`gather`] steps the model over a recording and collects [`Facts`]; [`page`] makes one self-contained HTML page of
//! them, [`plots`] single pictures.

pub(crate) mod chart;
mod course;
mod page;
mod worth;

pub use course::{Axis, Course, SensorFacts, Voter};
pub use page::{page, plots};
pub use worth::{Settling, Worth};

use athermal_core::compile::Wanted;
use athermal_core::model::{Card, Model};
use athermal_core::recording::Recording;
use athermal_core::score::{Score, ScoreOptions, Scores, score};
use serde::Serialize;

/// All that a report says.
#[derive(Debug, Clone, Serialize)]
pub struct Facts {
    /// The graph's name.
    pub graph: String,
    /// Where the data come from, as given.
    pub data: Vec<String>,
    /// The scores of every prediction over all truths.
    pub scores: Vec<Score>,
    /// What happened over time.
    pub course: Course,
    /// What the correction is worth; none for a graph without a `compensate` node.
    pub worth: Option<Worth>,
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

/// Why there is no report.
pub type ReportError = Box<dyn std::error::Error + Send + Sync>;

/// Steps a model over a recording and collects what a report says.
///
/// # Errors
/// When the recording cannot be read, or the fit does not belong to the graph.
pub fn gather(
    model: &Model,
    recording: &dyn Recording,
    data: Vec<String>,
) -> Result<Facts, ReportError> {
    let Scores { scores, .. } = score(
        &model.plan,
        &model.fitted,
        recording,
        &ScoreOptions::default(),
        &mut |_| {},
    )?;
    let (course, track) = course::follow(model, recording)?;
    let worth = track
        .map(|mut track| worth::worth(&mut track))
        .transpose()?;
    Ok(Facts {
        graph: model.plan.name.clone().unwrap_or_default(),
        data,
        scores,
        course,
        worth,
        card: model.card.clone(),
    })
}

/// What a model must be loaded with so that a report can tell the noise of the truth.
pub const WANTED: Wanted = Wanted {
    standard_errors: true,
};
