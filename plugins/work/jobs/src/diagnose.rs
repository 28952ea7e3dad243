//! `athermal diagnose`: why a model predicts as well as it does, and what would make it better.

mod offsets;
pub mod tables;

use athermal_core::watch::{Progress, Watch};
use schemars::JsonSchema;
use serde::Deserialize;
use std::collections::BTreeSet;
use std::path::Path;

use athermal_analysis::diagnosis::day::Days;
use athermal_analysis::diagnosis::{
    Diagnosis, LOOKING, Observation, Options, day, diagnose, is_called, window,
};
use athermal_core::compile::Plan;
use athermal_core::time::Duration;
use athermal_run::model::Model;
use athermal_run::recording::{Recording, Table};
use athermal_run::score::Lack;
use clap::Args;
use serde_json::json;

use crate::Found;
use crate::beyond;
use crate::data::Data;
use crate::doubts::Doubts;
use crate::faults::{FaultWatch, Purpose};
use crate::model::check_fitted;
use athermal_analysis::figures::counted;
use athermal_core::failure::{Failure, outside};
use offsets::{OfFile, offsets};
use tables::Tables;

/// What of a model is looked at, on which data.
#[derive(Debug, Args, Deserialize, JsonSchema)]
#[group(skip)]
pub struct Diagnose {
    /// The data.
    #[command(flatten)]
    #[serde(flatten)]
    pub data: Data,
    /// Show these predictions, by node, channel or axis, each with all its regressors; else the first of each truth that the graph
    /// puts out
    #[arg(long, num_args = 1.., value_name = "NAME")]
    #[serde(default)]
    pub of: Vec<String>,
    /// Show the signal to noise of each drift against the window that it is taken over. Noise is the standard error of its
    /// slopes, in which scatter and curvature within the window both count
    #[arg(long)]
    #[serde(default)]
    pub window: bool,
    /// How long a day is, of which each is left out once
    #[arg(
        long,
        value_name = "LENGTH",
        default_value = "1d",
        conflicts_with = "no_fit"
    )]
    #[serde(default = "a_day")]
    day: Duration,
    /// Leave out what needs fits of its own: days left out, how many are needed, and how much clocks differ
    #[arg(long)]
    #[serde(default)]
    no_fit: bool,
}

/// So many numbers of a recording are kept in memory, where it has no more: 256 MB. A row takes so many beside its values.
const IN_MEMORY: usize = 32 << 20;
const ROW: usize = 6;

/// How long a day is where nothing else is asked for.
fn a_day() -> Duration {
    Duration::from_ns(86_400_000_000_000)
}

impl Diagnose {
    /// Diagnoses a model, and may note what else could be shown.
    ///
    /// # Errors
    /// When a name or the length of a day is none, or the data cannot be used.
    pub fn find(
        &self,
        model: &Model,
        with_others: bool,
        host: &dyn Watch,
    ) -> Result<(Found, Diagnosis), Failure> {
        if self.day <= Duration::ZERO {
            return Err(Failure::Request(format!(
                "--day is {} and must be greater than 0",
                self.day
            )));
        }
        check_fitted(model, Path::new(crate::model::IN_MEMORY))?;
        self.check_names(&model.plan)?;
        self.data.check_offsets(&[])?;
        self.data.thin(None, model)?;
        let dataset = self.data.dataset();
        let options = Options {
            of: self.of.clone(),
            day: (!self.no_fit).then_some(self.day),
            windows: self.window,
        };
        let mut bar: Option<(&str, Box<dyn Progress>)> = None;
        let mut progress = |what, done, total| match &mut bar {
            Some((of, bar)) if *of == what => bar.set(done),
            bar => bar
                .insert((what, host.progress_to(what, total)))
                .1
                .set(done),
        };
        progress(LOOKING.0, 0, LOOKING.1);
        let watch = FaultWatch::new(&dataset, Purpose::Scores);
        // It is read dozens of times, mostly for fits.
        let most = IN_MEMORY / (model.plan.sources.len() + ROW);
        let table = Table::read_up_to(&watch, &model.plan, most).map_err(outside)?;
        let recording: &dyn Recording = table.as_ref().map_or(&watch, |table| table);
        let (diagnosis, observation) = diagnose(model, recording, &options, &mut progress)?;
        drop(bar);
        let clocks = match self.no_fit {
            true => Vec::new(),
            false => offsets(model, &dataset, host)?,
        };
        let tables = Tables::new(&diagnosis, &self.of);
        let trace = &observation.trace;
        let doubts = Doubts {
            plan: &model.plan,
            dataset: &dataset,
            refused: trace.refused,
            rejected: &trace.rejected,
            faults: watch.found(),
            outside_fit: beyond::beyond(model.sample_ranges(), &trace.ranges),
        };
        let mut facts = json!({ "data": self.data.names(), "diagnosis": tables.shown() });
        if !clocks.is_empty() {
            facts["offsets"] = clocks.iter().map(OfFile::facts).collect();
        }
        doubts.add_to(&mut facts);
        let sentences = clocks.iter().map(OfFile::sentence);
        let text = tables.text() + &sentences.collect::<String>();
        doubts.warn(host);
        for message in Lack::warnings(&diagnosis.lacks) {
            host.warning(message);
        }
        self.report(host, &diagnosis);
        if self.of.is_empty() && with_others {
            note_others(host, &model.plan, &diagnosis);
        }
        warn_empty(host, &model.plan, &diagnosis, &observation);
        if self.window && !window::any(&model.plan) {
            host.note("--window shows nothing, since no truth is a slope");
        }
        Ok((Found { text, facts }, diagnosis))
    }

    fn report(&self, host: &dyn Watch, diagnosis: &Diagnosis) {
        if let Some(days) = &diagnosis.days {
            warn_dropped(host, days);
        }
        if diagnosis.main.is_empty() {
            host.warning(
                "the graph has no prediction of a measured truth, so there is nothing to diagnose",
            );
        } else if !self.no_fit && diagnosis.days.is_none() {
            let (count, day) = (diagnosis.day_count, self.day);
            let advice = if count < 2 {
                "a shorter --day shows how fits on some parts do on others"
            } else {
                "a longer --day leaves fewer out"
            };
            let most = day::MOST_DAYS;
            host.note(format_args!(
                "no days left out: the data have {count} of {day}, and from 2 to {most} can be; {advice}"
            ));
        }
    }

    /// Whether every name of `--of` stands for something.
    fn check_names(&self, plan: &Plan) -> Result<(), Failure> {
        let predictions = plan.channels.iter().filter(|of| of.predicts.is_some());
        let known: Vec<&str> = predictions.map(|of| of.name.as_str()).collect();
        let is_known = |name: &&String| known.iter().any(|known| is_called(known, name));
        let Some(unknown) = self.of.iter().find(|name| !is_known(name)) else {
            return Ok(());
        };
        let graph = plan.name.as_deref().unwrap_or("the graph");
        Err(Failure::Request(format!(
            "{graph} predicts nothing called `{unknown}`; there are {}",
            known.join(", ")
        )))
    }
}

/// Warns of what only some of the fits on parts of the data had, so that they differ by more than their days.
fn warn_dropped(host: &dyn Watch, days: &Days) {
    let left_out = || days.left_out.iter();
    let all = left_out().flat_map(|day| &day.dropped);
    let all = all.chain(days.curve.iter().flat_map(|point| &point.dropped));
    for name in all.collect::<BTreeSet<&String>>() {
        let without = left_out().filter(|day| day.dropped.contains(name));
        let without: Vec<String> = without.map(|day| day.day.to_string()).collect();
        let which = match without.len() {
            0 => "fits on a few days".to_owned(),
            all if all == days.left_out.len() => continue,
            _ => format!("fits without day {}", without.join(", ")),
        };
        host.warning(format_args!(
            "{name} has a value in too few rows for {which}, which do without it; their scores suffer from that too"
        ));
    }
}

/// Names predictions that the graph puts out beside those that are shown.
fn note_others(host: &dyn Watch, plan: &Plan, diagnosis: &Diagnosis) {
    let outputs = plan.outputs.iter().map(|of| &plan.channels[of.slot]);
    let predictions = outputs.filter(|of| of.predicts.is_some());
    let is_shown = |name: &str| diagnosis.main.iter().any(|main| main.prediction == name);
    let others = predictions.filter(|of| !is_shown(&of.name));
    let nodes: BTreeSet<&str> = others.filter_map(|of| of.name.split('.').next()).collect();
    if !nodes.is_empty() {
        let nodes: Vec<&str> = nodes.into_iter().collect();
        host.note(format_args!(
            "shown is the first prediction of each truth that the graph puts out; the others:\n  --of {}",
            nodes.join(" ")
        ));
    }
}

/// Warns of predictions without a residual.
fn warn_empty(host: &dyn Watch, plan: &Plan, diagnosis: &Diagnosis, observation: &Observation) {
    for main in &diagnosis.main {
        let residuals = diagnosis.residuals.iter();
        let mut of_main = residuals.filter(|of| of.prediction == main.prediction);
        if of_main.all(|of| of.n > 0) {
            continue;
        }
        let mut truths = observation.trace.truths.iter();
        let truth = truths.find(|of| plan.channels[of.slot].name == main.truth);
        let there = truth.map_or(0, |of| of.values.iter().filter(|y| !y.is_nan()).count());
        if there == 0 {
            let truth = &main.truth;
            host.warning(format_args!("the data have no value of the truth {truth}"));
        } else {
            host.warning(format_args!(
                "{} is at none of the {} at which {} was measured, so it cannot be judged",
                main.prediction,
                counted(there as u64, "instant"),
                main.truth
            ));
        }
    }
}
