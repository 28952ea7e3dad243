//! `athermal compare`: several graphs, fitted and scored on the same data, in one table.

mod table;

use athermal_core::watch::Watch;
use schemars::JsonSchema;
use serde::Deserialize;
use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::PathBuf;
use std::time::Instant;

use athermal_analysis::diagnosis::comparison::{Comparison, Contender, Row, compare};
use athermal_core::engine::{Engine, SampleRange};
use athermal_run::fit::{FitOptions, FitReport, Outcome};
use athermal_run::live::monitor::usual;
use athermal_run::model::Model;
use athermal_run::recording::Event;
use athermal_run::score::{Lack, ScoreOptions, Trace, trace_as};
use clap::Args;
use serde_json::{Map, Value, json};

use self::table::{describe, is_one_of_several};
use crate::Found;
use crate::beyond;
use crate::data::{self, Data, FITS, warn_overlap};
use crate::doubts;
use crate::faults::{self, FaultWatch, Purpose};
use crate::fit::FitOutcome;
use crate::remarks;
use crate::scored::Scored;
use athermal_analysis::figures::{count, number, seconds};
use athermal_core::failure::Failure;
use athermal_core::message::Message;

/// On which data graphs are fitted, and on which and how they are scored.
#[derive(Debug, Args, Deserialize, JsonSchema)]
#[group(skip)]
pub struct Compare {
    /// The data of the fits.
    #[command(flatten)]
    #[serde(flatten)]
    pub data: Data,
    /// The recording to score on; several files are joined as with --data
    #[arg(long, required = true, num_args = 1.., value_name = "FILE", value_parser = crate::path::recording())]
    on: Vec<PathBuf>,
    #[command(flatten)]
    #[serde(flatten)]
    scored: Scored,
}

/// A graph's fit.
struct Fitted {
    graph: String,
    path: String,
    seconds: f64,
    report: FitReport,
    /// Combiners that went by too few truths where they were scored.
    lacks: Vec<Lack>,
    /// What is doubtful in the data that it was scored on, and in those that it was fitted on, for programs.
    doubtful: Map<String, Value>,
    doubtful_in_fit: Map<String, Value>,
}

/// The warnings that were shown already: graphs that read the same data have the same ones.
struct Once<'a> {
    host: &'a dyn Watch,
    shown: BTreeSet<String>,
    /// Where samples lay in the fits so far.
    in_fits: Vec<SampleRange>,
}

impl Once<'_> {
    fn warn(&mut self, all: impl IntoIterator<Item = Message>) {
        for message in all {
            if self.shown.insert(message.to_string()) {
                self.host.warning(message);
            }
        }
    }

    fn note(&mut self, words: Option<String>) {
        if let Some(words) = words.filter(|words| self.shown.insert(words.clone())) {
            self.host.note(words);
        }
    }

    fn warn_beyond(&mut self, report: &FitReport, trace: &Trace) {
        let new = |range: &&SampleRange| usual(&self.in_fits, &range.channel).is_none();
        let new: Vec<_> = report.ranges.iter().filter(new).cloned().collect();
        beyond::warn(self.host, &beyond::beyond(&new, &trace.ranges));
        self.in_fits.extend(new);
    }
}

impl Compare {
    /// Fits and scores graphs, each with the name of its file; whether something could not be fitted.
    ///
    /// # Errors
    /// When the data cannot be used.
    pub fn find(
        &self,
        models: Vec<(String, Model)>,
        host: &dyn Watch,
    ) -> Result<(Found, bool), Failure> {
        let options = self.scored.options()?;
        let (contenders, fits) = self.fit_and_run(models, &options, host)?;
        let comparisons = compare(&contenders, options.abs_truth_below.as_ref());
        let mut text = String::new();
        let asked = self.scored.in_words();
        for line in &asked {
            let _ = writeln!(text, "{line}");
        }
        if !asked.is_empty() {
            text.push('\n');
        }
        for comparison in &comparisons {
            let spans = is_one_of_several(comparison, &comparisons);
            let table = describe(comparison, options.mode, fits.len() > 1, spans);
            let _ = writeln!(text, "{table}");
        }
        for fit in &fits {
            let seconds = number(fit.seconds);
            let _ = writeln!(text, "{} was fitted in {seconds} s", fit.graph);
        }
        let facts = self.facts(&comparisons, &fits);
        warn(host, &comparisons, &fits);
        let failed = failed(host, &fits);
        Ok((Found { text, facts }, failed))
    }

    fn fit_and_run(
        &self,
        models: Vec<(String, Model)>,
        scored: &ScoreOptions,
        host: &dyn Watch,
    ) -> Result<(Vec<Contender>, Vec<Fitted>), Failure> {
        self.data.check_offsets(&self.on)?;
        let on = self.data.others(self.on.clone());
        let several = models.len() > 1;
        let of_graph = |path: &str, failure| match failure {
            Failure::Request(reason) if several => {
                Failure::Request(format!("for the graph {path}: {reason}"))
            }
            other => other,
        };
        if several {
            self.data.check_lasting("--data")?;
            on.check_lasting("--on")?;
        }
        let (mut contenders, mut fits) = (Vec::new(), Vec::<Fitted>::new());
        let mut once = Once {
            host,
            shown: BTreeSet::new(),
            in_fits: Vec::new(),
        };
        let graphs = models.iter();
        let names = names(graphs.map(|(path, model)| (model.plan.name.as_deref(), path.as_str())));
        for ((path, mut model), name) in models.into_iter().zip(names) {
            self.scored.check(&model)?;
            let began = Instant::now();
            let options = FitOptions::default();
            let data = self.data.dataset();
            let fit = FitOutcome::of(&model.plan, &data, &options, host)
                .map_err(|error| of_graph(&path, error.into()))?
                .read_from(&data);
            model.fitted = fit.fitted;
            let seconds = began.elapsed().as_secs_f64();
            let report = fit.report;
            let rejected = &report.rejected;
            once.warn(remarks::doubts(
                &model.plan,
                &fit.files,
                report.refused,
                rejected,
            ));
            once.note(remarks::without_zone(&fit.files));
            let dataset = on.dataset();
            let mut progress = host.progress("scoring");
            let mut ticks = 0;
            let watch = FaultWatch::new(&dataset, Purpose::Scores);
            let mut look = |_: &Engine, _: Event| {
                ticks += 1;
                if ticks % 4096 == 0 {
                    progress.set(ticks);
                }
            };
            let scored = ScoreOptions {
                levels: report.levels.clone(),
                ..scored.clone()
            };
            let trace = trace_as(&model.plan, &model.fitted, &watch, &scored, &mut look)
                .map_err(|error| of_graph(&path, error.into()))?;
            drop(progress);
            let reports = dataset.reports();
            let rejected = &trace.rejected;
            once.warn(remarks::doubts(
                &model.plan,
                &reports,
                trace.refused,
                rejected,
            ));
            once.note(remarks::without_zone(&reports));
            once.warn_beyond(&report, &trace);
            if fits.is_empty() && !report.estimators.is_empty() {
                self.warn_fitted_on(host, &report, &trace);
            }
            let faults = watch.found();
            once.warn(faults::messages(&fit.faults));
            once.warn(faults::messages(&faults));
            let outside_fit = beyond::beyond(&report.ranges, &trace.ranges);
            let doubtful = doubts::facts(&faults, &outside_fit, &reports);
            let doubtful_in_fit = doubts::facts(&fit.faults, &[], &fit.files);
            fits.push(Fitted {
                graph: name.clone(),
                path,
                seconds,
                report,
                lacks: trace.lacks.clone(),
                doubtful,
                doubtful_in_fit,
            });
            contenders.push(Contender {
                name,
                plan: model.plan,
                trace,
            });
        }
        Ok((contenders, fits))
    }

    fn facts(&self, comparisons: &[Comparison], fits: &[Fitted]) -> Value {
        let of = |fit: &Fitted| {
            let mut facts = json!({
                "graph": fit.graph,
                "file": fit.path,
                "fit_s": fit.seconds,
                "lacks": fit.lacks,
            });
            for (key, found) in &fit.doubtful {
                facts[key] = found.clone();
            }
            if !fit.doubtful_in_fit.is_empty() {
                facts["in_fit"] = json!(fit.doubtful_in_fit);
            }
            facts
        };
        let on = self.data.others(self.on.clone());
        let mut facts = json!({ "data": self.data.names(), "on": on.names() });
        self.scored.add_to(&mut facts);
        facts["graphs"] = fits.iter().map(of).collect();
        facts["comparisons"] = json!(comparisons);
        facts
    }

    /// Warns where graphs are scored on the data of their fit.
    fn warn_fitted_on(&self, host: &dyn Watch, report: &FitReport, trace: &Trace) {
        let same = |on: &&PathBuf| {
            self.data
                .paths()
                .any(|data| data::is_same_content(data, on))
        };
        if let Some(path) = self.on.iter().find(same) {
            host.warning(format_args!(
                "{}: the graphs are fitted on this file and scored on it, so {FITS}",
                path.display()
            ));
            return;
        }
        let truths = trace.truths.iter();
        let all = truths.flat_map(|truth| truth.times.iter().map(|of| of.1));
        let times = || all.clone();
        let scored = times().min().zip(times().max());
        if let Some(((from, to), (first, last))) = report.period.zip(scored) {
            let fit = (seconds(from), seconds(to));
            warn_overlap(host, fit, (seconds(first), seconds(last)), false);
        }
    }
}

/// What graphs are called, by their names and files: all that share a name are called by their files, and files that come again
/// have a number too.
fn names<'a>(graphs: impl Iterator<Item = (Option<&'a str>, &'a str)> + Clone) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for (own, path) in graphs.clone() {
        let namesakes = |own| graphs.clone().filter(move |of| of.0 == Some(own)).count();
        let own = own.filter(|own| namesakes(*own) == 1);
        let again = (2..).map(|nth| format!("{path} ({nth})"));
        let first = own.unwrap_or(path).to_owned();
        let mut free = std::iter::once(first).chain(again);
        names.extend(free.find(|name| !names.contains(name)));
    }
    names
}

/// Warns of what makes scores say less than they seem to.
fn warn(host: &dyn Watch, comparisons: &[Comparison], fits: &[Fitted]) {
    if comparisons.is_empty() {
        host.warning("no graph predicts a measured truth, so there is nothing to compare");
    }
    for comparison in comparisons {
        warn_left_out(host, comparison);
    }
    for column in comparisons.iter().flat_map(|of| &of.truths) {
        if !column.otherwise.is_empty() {
            host.warning(format_args!(
                "`{}` of {} has other values than that of {}, on which all are scored: name truths that are not the same differently",
                column.truth,
                column.otherwise.join(", "),
                fits[0].graph
            ));
        }
    }
    for fit in fits {
        for message in Lack::warnings(&fit.lacks) {
            host.warning(format_args!("{}: {message}", fit.graph));
        }
    }
}

/// Warns where the scores hide what happens while a prediction has no value.
fn warn_left_out(host: &dyn Watch, comparison: &Comparison) {
    for column in &comparison.truths {
        if let Some((left_out, row)) = column.left_out {
            let Row { graph, node, .. } = &comparison.rows[row];
            host.warning(format_args!(
                "{}: {} instants are left out at which others predict and {node} of {graph} does not; what each does there is not shown: \
                 score it alone by `athermal evaluate --each-on-its-own`",
                column.truth,
                count(left_out)
            ));
        }
    }
}

/// Warns of nodes that could not be fitted; whether there is one.
fn failed(host: &dyn Watch, fits: &[Fitted]) -> bool {
    let mut failed = false;
    for fit in fits {
        for estimator in &fit.report.estimators {
            if let Outcome::Failed(error) = &estimator.outcome {
                failed = true;
                host.warning(format_args!(
                    "{}: {} could not be fitted: {error}; it gave no prediction",
                    fit.graph, estimator.node
                ));
            }
        }
    }
    failed
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn graphs_that_share_a_name_are_called_by_their_files() {
        let called = |graphs: &[(Option<&str>, &str)]| names(graphs.iter().copied());
        let shared = [
            (Some("a"), "one.toml"),
            (Some("b"), "b.toml"),
            (Some("a"), "two.toml"),
            (None, "no.toml"),
        ];
        assert_eq!(called(&shared), ["one.toml", "b", "two.toml", "no.toml"]);
        let again = [(Some("a"), "a.toml"); 3];
        assert_eq!(called(&again), ["a.toml", "a.toml (2)", "a.toml (3)"]);
    }
}
