//! `athermal evaluate`: scores a model's predictions on recorded data.

use athermal_core::watch::Watch;
use schemars::JsonSchema;
use serde::Deserialize;
use std::path::PathBuf;

use athermal::Model;
use athermal::core::compile::Wanted;
use athermal::report;
use athermal::run::score::{FellBack, Lack, Score, ScoreOptions, score};
use clap::Args;
use serde_json::json;

use super::asked::in_memory;
use super::beyond;
use super::data::Data;
use super::doubts::Doubts;
use super::faults::{FaultWatch, Purpose};
use super::found::{self, Found};
use super::model::load_fitted;
use super::scored::Scored;
use super::unscored;
use crate::invocation::next;
use crate::terminal::{Answer, Failure, Format, Terminal};
use athermal_analysis::figures::seconds;

/// Score a model's predictions on recorded data
///
/// Each prediction is compared with the truth measured later. Beside it stand no model, persistence (the
/// last truth that shares nothing with the predicted one), and the standard error of the truth itself. Persistence is K
/// steps back for predictions K steps ahead; a free run has none. What the graph puts out is scored wherever it has a value, as it is
/// used; all other predictions of a truth, to be compared, on the instants at which all of them are valid.
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
/// `--mode` shows how far the model reaches by itself: one step from measured past truths, several steps with its own
/// predictions in between, or freely, from features alone and its own past. Features made of what the truth is made of
/// stay as they were measured, and so do the weights of votes. Standard deviations are those of as many steps as there are
/// since the newest measured truth, under the model's own noise.
#[derive(Debug, Args, Deserialize, JsonSchema)]
#[command(
    after_help = "Examples:\n  athermal evaluate model.json --data test.csv\n  \
                        athermal evaluate model.json --data test.csv --format json \\\n      \
                        --abs-truth-below \"250 nm/min\"\n  \
                        athermal evaluate model.json --data test.csv --mode free-run"
)]
pub struct Evaluate {
    /// The model, or a graph that names one or in which nothing needs fitting
    #[arg(value_parser = crate::meant::graph_or_model())]
    #[serde(skip, default = "in_memory")]
    model: PathBuf,
    #[command(flatten)]
    #[serde(flatten)]
    data: Data,
    /// Score each prediction on all instants of its own
    #[arg(long)]
    #[serde(default)]
    each_on_its_own: bool,
    #[command(flatten)]
    #[serde(flatten)]
    scored: Scored,
}

impl Evaluate {
    /// Scores and prints.
    ///
    /// # Errors
    /// When the model or the data cannot be used.
    pub fn run(&self, terminal: &Terminal) -> Result<Answer, Failure> {
        let model = load_fitted(&self.model, Wanted::SCORES, terminal)?;
        let (found, ()) = found::show(terminal, |host| Ok((self.find(&model, host)?, ())))?;
        let mut scores = found.facts["scores"].as_array().into_iter().flatten();
        if terminal.format == Format::Table && scores.any(|of| of["n"] != 0) {
            // Why the scores are what they are.
            terminal.note(next(&self.data.words_with("diagnose", &self.model)));
        }
        Ok(Answer::Fine)
    }

    /// Scores a model that is compiled for scores.
    ///
    /// # Errors
    /// When the data cannot be used.
    pub fn find(&self, model: &Model, host: &dyn Watch) -> Result<Found, Failure> {
        self.scored.check(model)?;
        self.data.check_offsets(&[])?;
        self.data.thin(&self.model, &model.graph)?;
        let dataset = self.data.dataset();
        let options = ScoreOptions {
            each_on_its_own: self.each_on_its_own,
            levels: model.levels(),
            ..self.scored.options()?
        };
        let watch = FaultWatch::new(&dataset, Purpose::Scores);
        let mut progress = host.progress("evaluating");
        let scores = score(&model.plan, &model.fitted, &watch, &options, &mut |ticks| {
            progress.set(ticks)
        })?;
        drop(progress);
        let doubts = Doubts {
            plan: &model.plan,
            dataset: &dataset,
            refused: scores.refused,
            rejected: &scores.rejected,
            faults: watch.found(),
            outside_fit: beyond::beyond(model.sample_ranges(), &scores.ranges),
        };
        let period = scores.period.map(|(from, to)| {
            json!({ "from_s": seconds(from), "to_s": seconds(to), "ticks": scores.ticks })
        });
        let mut facts = json!({ "data": self.data.names() });
        self.scored.add_to(&mut facts);
        facts["each_on_its_own"] = self.each_on_its_own.into();
        facts["period"] = json!(period);
        facts["scores"] = json!(scores.scores);
        facts["unscored"] = json!(scores.unscored);
        facts["lacks"] = json!(scores.lacks);
        facts["fell_back"] = json!(scores.fell_back);
        doubts.add_to(&mut facts);
        doubts.warn(host);
        let period = scores.period.map(|(from, to)| (seconds(from), seconds(to)));
        self.data.warn_fitted_on(host, model, period);
        unscored::warn(host, &scores.unscored);
        let fell_back = FellBack::warnings(&scores.fell_back);
        for message in Lack::warnings(&scores.lacks).into_iter().chain(fell_back) {
            host.warning(message);
        }
        let none = |of: &Score| of.valid.is_some() && of.n == 0;
        if let Some(steps) = self.scored.steps()
            && scores.scores.iter().any(none)
        {
            host.warning(format_args!(
                "where no truth was predicted {steps} steps ahead, no stretch of the data may be that long: try fewer `--steps`"
            ));
        }
        if scores.scores.is_empty() {
            host.warning(
                "the graph has no prediction of a measured truth, so there is nothing to score",
            );
        }
        Ok(Found {
            text: report::scores(&scores, &self.in_words()),
            facts,
        })
    }

    /// How it is scored, where otherwise than usual.
    fn in_words(&self) -> Vec<String> {
        let mut words = self.scored.in_words();
        if self.each_on_its_own {
            words.push("each prediction is scored on all instants of its own".to_owned());
        }
        words
    }
}
