//! `athermal fit`: fits what a graph has to learn on recorded data, estimators and encoders, and writes a model.

use std::path::PathBuf;

use athermal::Model;
use athermal::core::compile::PlannedChannel;
use athermal::core::diagnostic::Sources;
use athermal::core::watch::Watch;
use athermal::run::fit::Outcome;
use athermal::run::model::EstimatorCard;
use athermal_jobs::fit::{self as job, FitOutcome, text_of};
use athermal_jobs::path::{graph_or_model, written};
use athermal_jobs::{doubts, model};
use clap::Args;
use serde_json::json;

use super::aside::{check_apart, write_aside};
use super::check::mistakes_in_tests;
use crate::invocation::{next, program, quoted, words_with};
use crate::terminal::{Answer, Failure, Format, Terminal};

/// Fit a graph on recorded data
///
/// Fits every node that learns: estimators, and features such as encoders. For each it prints the rows used and left out,
/// the regressors chosen with their cross-validation scores (the mean, and each fold). Then come the condition number, and the error
/// on the rows of the fit. Then it writes the model: one JSON file that holds all that is needed to run.
/// `athermal show MODEL --format coefficients` prints what is in it.
///
/// A node that cannot be fitted gives nothing, and the exit status is 1. So it is where no voter of an output has a regressor left:
/// the model is written, and the first line names the output. Where none can be fitted, no model is written,
/// and an old one stays.
///
/// Where orders are compared, AIC, AICc and BIC count the variance of what is left as one parameter beside the
/// coefficients, and FPE does not.
///
/// What is fed by estimators, such as a `stack`, learns from predictions of rows that those were not fitted on. All below
/// it is fitted once more for each third of the data: four times with one such level, 13 times with two, 40 times with
/// three.
///
/// With `--blocks day` a fit learns from the sums of each UTC day in place of rows. With `--keep-blocks FOLDER` these are kept, and the
/// next fit of years reads them and the days that are new. An estimator that needs more than sums is named. What needs the rows is
/// missing in such a model: novelty, and singular values where features hang together.
///
/// With `--format json` all of that is data: `estimators` has an object for each node, and its `figures` are by name,
/// unrounded.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  athermal fit graphs/die-tester.toml --data train.csv -o model.json\n  \
                        athermal fit machine.toml --data monday.csv tuesday.csv -o model.json"
)]
pub struct Fit {
    /// The graph, or a model whose graph is fitted anew
    #[arg(value_parser = graph_or_model())]
    graph: PathBuf,
    #[command(flatten)]
    job: job::Fit,
    /// Where the model goes; `-` is standard output
    #[arg(long, short, value_name = "MODEL", value_parser = written())]
    output: PathBuf,
}

impl Fit {
    /// Fits, reports and writes.
    ///
    /// # Errors
    /// When the graph has mistakes, the data cannot be read, or the model cannot be written.
    pub fn run(&self, terminal: &Terminal) -> Result<Answer, Failure> {
        // A model may take the place of one whose graph is fitted anew.
        let is_model = self.graph.extension().is_some_and(|of| of == "json");
        let graph = (!is_model).then_some(&*self.graph);
        check_apart("--output", &self.output, self.job.data.paths().chain(graph))?;
        self.job.data.check_lasting("--data")?;
        let mut sources = Sources::new();
        let mut model = model::load_to_fit(&self.graph, &mut sources, terminal)?;
        self.job.data.thin(Some(&self.graph), &model)?;
        let outcome = self.job.fit(&mut model, terminal)?;
        self.doubt_tests(&model, sources, terminal);
        if outcome.is_nothing() {
            outcome.failed().iter().for_each(|of| terminal.warning(of));
            self.report(terminal, &outcome);
            self.warn_of_no_model(terminal);
            return Ok(Answer::No);
        }
        let text = text_of(&model)?;
        let to_stdout = self.output.as_os_str() == "-";
        // First, or a reader that has seen enough, as `head` has, would end the program without a model.
        if !to_stdout {
            write_aside(&self.output, &text)?;
        }
        self.report(terminal, &outcome);
        if to_stdout {
            print!("{text}");
        } else if terminal.format == Format::Table {
            terminal.note(format_args!("wrote {}", self.output.display()));
            terminal.note(self.next(&model));
        }
        let constant = outcome.bare.iter().any(|output| !output.has_others);
        Ok(if constant || !outcome.failed().is_empty() {
            Answer::No
        } else {
            Answer::Fine
        })
    }

    /// A model in which nothing is fitted is worth less than the one that it would take the place of, which may be running.
    fn warn_of_no_model(&self, host: &dyn Watch) {
        let output = self.output.display();
        if self.output.is_file() {
            host.warning(format_args!(
                "nothing could be fitted: no model is written, and {output} stays as it is"
            ));
        } else {
            host.warning("nothing could be fitted: no model is written");
        }
    }

    /// What to type next: a score on data that the fit has not seen; a run, where there is nothing to score.
    fn next(&self, model: &Model) -> String {
        let unseen = self.job.data.unseen();
        let predicts = |channel: &PlannedChannel| channel.predicts.is_some();
        if !model.plan.channels.iter().any(predicts) {
            let output = quoted(&self.output.display().to_string());
            return next(&[&program(), "run", &output, "--input", &unseen]);
        }
        let rest = self.job.data.rest();
        let unseen = rest.unwrap_or_else(|| self.job.data.others(vec![unseen.into()]));
        next(&words_with(&unseen, "evaluate", &self.output))
    }

    /// Warns of mistakes in the tests of a graph file. The fit does without tests, but nobody should find such mistakes only when the
    /// model is in use.
    fn doubt_tests(&self, model: &Model, mut sources: Sources, host: &dyn Watch) {
        if self.graph.extension().is_none_or(|kind| kind != "toml") {
            return;
        }
        let (of, path) = (mistakes_in_tests(model, &mut sources), self.graph.display());
        if of > 0 {
            let mistakes = if of == 1 {
                "a mistake".to_owned()
            } else {
                format!("{of} mistakes")
            };
            host.warning(format_args!(
                "the tests of {path} have {mistakes}, which the fit does without: see `athermal check {path}`"
            ));
        }
    }

    fn report(&self, terminal: &Terminal, outcome: &FitOutcome) {
        let FitOutcome {
            report,
            faults,
            files,
            ..
        } = outcome;
        let to_stdout = self.output.as_os_str() == "-";
        if terminal.format == Format::Json && !to_stdout {
            let estimators: Vec<_> = report
                .estimators
                .iter()
                .map(|fit| match &fit.outcome {
                    Outcome::Fitted(_) => json!(EstimatorCard::of(fit)),
                    Outcome::Failed(error) => {
                        json!({ "node": fit.node, "error": error.to_string() })
                    }
                })
                .collect();
            let mut facts = json!({ "ticks": report.ticks, "segments": report.segments, "estimators": estimators });
            for (key, found) in doubts::facts(faults, &[], files) {
                facts[key] = found;
            }
            println!("{facts:#}");
            return;
        }
        if !terminal.quiet && !to_stdout {
            print!("{}", outcome.text(self.job.candidates));
        }
    }
}
