//! `athermal evaluate`: scores a model's predictions on recorded data.

use std::path::PathBuf;

use athermal::core::compile::Wanted;
use athermal_jobs::evaluate as job;
use athermal_jobs::model::load_fitted;
use athermal_jobs::path::graph_or_model;
use clap::Args;

use super::found;
use crate::invocation::{next, words_with};
use crate::terminal::{Answer, Failure, Format, Terminal};

/// Score a model's predictions on recorded data
///
/// Each prediction is compared with the truth measured later. Beside it stand no model, persistence (the
/// last truth that shares nothing with the predicted one), and the standard error of the truth itself. Persistence is K
/// steps back for predictions K steps ahead; a free run has none. What the graph puts out is scored wherever it has a value, as it is
/// used. All other predictions of a truth are compared, on the instants at which all of them are valid.
///
/// The standard error of a truth that is a slope is that of its line, from the residuals about it (root mean square over
/// the instants). Scatter of the samples and curvature of the drift within the window both count there. So it may be more
/// than the noise of the measurement, and a prediction may come below it.
///
/// No model predicts zero of a rate. Of a level whose zero is arbitrary, such as a position or a temperature in °C, it predicts the
/// mean over the fit. R² is against no model, 1 − SSE / Σ (y − no model)². R²mean is against the truth's mean, 1 − SSE / Σ (y − ȳ)², the R² of scikit-learn. Fit is 1 − √(SSE / Σ (y − ȳ)²), as in system identification.
///
/// Ahead is how far ahead of the newest truth that it may use a prediction was made. With `--mode k-step` that is K − 1
/// steps more, where past truths change it; in a free run it has no bound. Bias is the mean error, prediction less truth.
/// Largest is the largest error in size. Valid is the share of the instants with a measured truth that have a prediction.
///
/// Predictions with intervals get a second table: bounds, as of `conformal`, or 1.645 standard deviations to either side,
/// which should cover nine tenths. It shows the share of truths covered, the mean width, and the interval score: the width
/// plus 2/(1 − share to cover) times the mean distance of truths outside. A small score is good.
///
/// `--mode` shows how far the model reaches by itself. It goes one step from measured past truths, several steps with its own
/// predictions in between, or freely, from features alone and its own past. Features made of what the truth is made of
/// stay as they were measured, and so do the weights of votes. Standard deviations are those of as many steps as there are
/// since the newest measured truth, under the model's own noise.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  athermal evaluate model.json --data test.csv\n  \
                        athermal evaluate model.json --data test.csv --format json \\\n      \
                        --abs-truth-below \"250 nm/min\"\n  \
                        athermal evaluate model.json --data test.csv --mode free-run"
)]
pub struct Evaluate {
    /// The model, or a graph that names one or in which nothing needs fitting
    #[arg(value_parser = graph_or_model())]
    model: PathBuf,
    #[command(flatten)]
    job: job::Evaluate,
}

impl Evaluate {
    /// Scores and prints.
    ///
    /// # Errors
    /// When the model or the data cannot be used.
    pub fn run(&self, terminal: &Terminal) -> Result<Answer, Failure> {
        let model = load_fitted(&self.model, Wanted::SCORES, terminal)?;
        self.job.data.thin(Some(&self.model), &model)?;
        let (found, ()) = found::show(terminal, |host| Ok((self.job.find(&model, host)?, ())))?;
        let mut scores = found.facts["scores"].as_array().into_iter().flatten();
        if terminal.format == Format::Table && scores.any(|of| of["n"] != 0) {
            // Why the scores are what they are.
            terminal.note(next(&words_with(&self.job.data, "diagnose", &self.model)));
        }
        Ok(Answer::Fine)
    }
}
