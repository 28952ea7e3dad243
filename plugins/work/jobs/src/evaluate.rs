//! `athermal evaluate`: scores a model's predictions on recorded data.

use athermal_core::watch::Watch;
use schemars::JsonSchema;
use serde::Deserialize;

use athermal_analysis::report;
use athermal_run::model::Model;
use athermal_run::score::{FellBack, Lack, Score, ScoreOptions, score};
use clap::Args;
use serde_json::json;

use crate::Found;
use crate::beyond;
use crate::data::Data;
use crate::doubts::Doubts;
use crate::faults::{FaultWatch, Purpose};
use crate::scored::Scored;
use crate::unscored;
use athermal_analysis::figures::seconds;
use athermal_core::failure::Failure;

/// How predictions are scored on recorded data.
#[derive(Debug, Args, Deserialize, JsonSchema)]
#[group(skip)]
pub struct Evaluate {
    /// The data.
    #[command(flatten)]
    #[serde(flatten)]
    pub data: Data,
    /// Score each prediction on all instants of its own
    #[arg(long)]
    #[serde(default)]
    each_on_its_own: bool,
    #[command(flatten)]
    #[serde(flatten)]
    scored: Scored,
}

impl Evaluate {
    /// Scores a model that is compiled for scores.
    ///
    /// # Errors
    /// When the data cannot be used.
    pub fn find(&self, model: &Model, host: &dyn Watch) -> Result<Found, Failure> {
        self.scored.check(model)?;
        self.data.check_offsets(&[])?;
        self.data.thin(None, model)?;
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
            text: report::scores(&scores, &self.head(model)),
            facts,
        })
    }

    /// What goes out, and how it is scored where otherwise than usual.
    fn head(&self, model: &Model) -> Vec<String> {
        let outputs = report::outputs(&model.plan);
        let outputs = outputs.map(|of| format!("{of}; the other rows are beside it"));
        outputs.into_iter().chain(self.in_words()).collect()
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
