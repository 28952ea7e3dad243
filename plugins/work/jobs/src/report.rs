//! `athermal report`: what a model is worth on recorded data, as a page.

use athermal_core::watch::Watch;
use schemars::JsonSchema;
use serde::Deserialize;

use athermal_analysis::report::{Facts, gather, outputs, text};
use athermal_core::engine::SampleRange;
use athermal_run::fit::FitError;
use athermal_run::model::Model;
use athermal_run::score::{FellBack, Lack};
use clap::Args;

use crate::Found;
use crate::beyond::beyond;
use crate::data::Data;
use crate::doubts;
use crate::faults::{FaultWatch, Purpose};
use athermal_core::failure::{Failure, outside};

/// On which data it is shown what a model is worth.
#[derive(Debug, Args, Deserialize, JsonSchema)]
#[group(skip)]
pub struct Report {
    /// The data.
    #[command(flatten)]
    #[serde(flatten)]
    pub data: Data,
}

impl Report {
    /// Gathers the facts on a model that is compiled for scores.
    ///
    /// # Errors
    /// When the data cannot be used.
    pub fn find(&self, model: &Model, host: &dyn Watch) -> Result<(Found, Facts), Failure> {
        self.data.check_offsets(&[])?;
        self.data.thin(None, model)?;
        let dataset = self.data.dataset();
        let watch = FaultWatch::new(&dataset, Purpose::Scores);
        let facts = gather(model, &watch, self.data.names()).map_err(|error| {
            let of_a_pass = error.downcast::<FitError>();
            of_a_pass.map_or_else(outside, |error| Failure::from(*error))
        })?;
        let course = &facts.course;
        crate::remarks::warn(
            host,
            &model.plan,
            &dataset.reports(),
            course.refused,
            &course.rejected,
        );
        self.data.warn_fitted_on(host, model, course.period_s);
        let fell_back = FellBack::warnings(&facts.fell_back);
        for message in Lack::warnings(&facts.lacks).into_iter().chain(fell_back) {
            host.warning(message);
        }
        for of in &facts.unjudged {
            host.warning(format_args!("`{}` cannot be judged: {}", of.of, of.why));
        }
        if course.axes.is_empty() {
            host.warning(
                "the graph has no prediction of a measured truth, so there is little to report",
            );
        }
        let mut json =
            serde_json::to_value(&facts).map_err(|error| Failure::Outside(error.to_string()))?;
        let ranges = course.sensors.iter().filter_map(|of| {
            let (channel, (lowest, highest)) = (of.name.clone(), of.range?);
            Some(SampleRange {
                channel,
                lowest,
                highest,
            })
        });
        let ranges: Vec<SampleRange> = ranges.collect();
        let outside_fit = beyond(model.sample_ranges(), &ranges);
        for (key, found) in doubts::facts(&watch.found(), &outside_fit, &dataset.reports()) {
            json[key] = found;
        }
        let found = Found {
            text: outputs(&model.plan).map_or_else(String::new, |of| of + "\n\n") + &text(&facts),
            facts: json,
        };
        Ok((found, facts))
    }
}
