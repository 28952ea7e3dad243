//! `athermal fit`: fits what a graph has to learn on recorded data, estimators and encoders, and writes a model.

use athermal_core::watch::Watch;
use schemars::JsonSchema;
use serde::Deserialize;
use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::PathBuf;

use athermal::Model;
use athermal::core::compile::PlannedChannel;
use athermal::core::diagnostic::Sources;
use athermal::core::node::{OrderTable, SelectionStep, TrainingError};
use athermal::files::Dataset;
use athermal::run::fit::{
    BareOutput, EstimatorFit, FitOptions, FitProgress, FitReport, Outcome, fit,
};
use athermal::run::model::{Card, EstimatorCard};
use athermal_fleet::blocks::BlockOptions;
use clap::Args;
use serde_json::json;

use super::aside::{check_apart, write_aside};
use super::asked::in_memory;
use super::check::mistakes_in_tests;
use super::data::{self, Data};
use super::doubts;
use super::faults::{self, ChannelFaults, FaultWatch, Purpose};
use super::fit_blocks::fit_on_blocks;
use super::model;
use super::numbers;
use super::threads::Threads;
use crate::invocation::{next, program, quoted};
use crate::message::Message;
use crate::terminal::{Answer, Failure, Format, Terminal};
use athermal_analysis::figures::{count, counted, number, paragraph, table};

/// Fit a graph on recorded data
///
/// Fits every node that learns: estimators, and features such as encoders. For each it prints the rows used and left out,
/// the regressors chosen with their cross-validation scores (the mean, and each fold), the condition number, and the error
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
#[derive(Debug, Args, Deserialize, JsonSchema)]
#[command(
    after_help = "Examples:\n  athermal fit graphs/die-tester.toml --data train.csv -o model.json\n  \
                        athermal fit machine.toml --data monday.csv tuesday.csv -o model.json"
)]
pub struct Fit {
    /// The graph, or a model whose graph is fitted anew
    #[arg(value_parser = crate::meant::graph_or_model())]
    #[serde(skip, default = "in_memory")]
    graph: PathBuf,
    #[command(flatten)]
    #[serde(flatten)]
    data: Data,
    /// Where the model goes; `-` is standard output
    #[arg(long, short, value_name = "MODEL", value_parser = crate::meant::written())]
    #[serde(skip)]
    output: PathBuf,
    #[command(flatten)]
    #[serde(flatten)]
    blocks: BlockOptions,
    #[command(flatten)]
    #[serde(flatten)]
    threads: Threads,
    /// Megabytes of rows to keep; beyond, rows are streamed in a second pass
    #[arg(
        long,
        value_name = "MB",
        default_value_t = megabytes(),
        allow_negative_numbers = true,
        value_parser = numbers::read::<usize>("a whole number of megabytes, such as 64")
    )]
    #[serde(default = "megabytes")]
    memory: usize,
    /// Show what else was tried at each step of a selection, with its score, and all orders that were compared
    #[arg(long)]
    #[serde(default)]
    candidates: bool,
}

/// So many megabytes of rows are kept where nothing else is asked for.
fn megabytes() -> usize {
    64
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
        check_apart("--output", &self.output, self.data.paths().chain(graph))?;
        self.data.check_lasting("--data")?;
        let mut sources = Sources::new();
        let mut model = model::load_to_fit(&self.graph, &mut sources, terminal)?;
        self.data.thin(&self.graph, &model.graph)?;
        let outcome = self.fit(&mut model, terminal)?;
        self.doubt_tests(&model, sources, terminal);
        let failed = outcome.report.failed().count();
        if failed > 0 && failed == outcome.report.estimators.len() {
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
        Ok(if failed > 0 || constant {
            Answer::No
        } else {
            Answer::Fine
        })
    }

    /// Fits a graph, and warns of what may be wrong in the data.
    ///
    /// # Errors
    /// When the data cannot be read.
    pub fn fit(&self, model: &mut Model, host: &dyn Watch) -> Result<FitOutcome, Failure> {
        self.data.check_offsets(&[])?;
        self.blocks.check(self.data.is_a_stretch())?;
        self.data.warn_of_machines(host);
        let options = FitOptions {
            memory: self.memory.saturating_mul(1 << 20),
            threads: self.threads.count(),
            ..FitOptions::default()
        };
        match self.blocks.blocks {
            Some(_) => fit_on_blocks(&self.blocks, model, &self.data, &options, host),
            None => fit_on(model, &self.data, &options, host),
        }
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
        let unseen = self.data.unseen();
        let predicts = |channel: &PlannedChannel| channel.predicts.is_some();
        if !model.plan.channels.iter().any(predicts) {
            let output = quoted(&self.output.display().to_string());
            return next(&[&program(), "run", &output, "--input", &unseen]);
        }
        let unseen = self.data.others(vec![unseen.into()]);
        next(&unseen.words_with("evaluate", &self.output))
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
            dataset,
            report,
            faults,
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
            for (key, found) in doubts::facts(faults, &[], dataset) {
                facts[key] = found;
            }
            println!("{facts:#}");
            return;
        }
        for fit in &report.estimators {
            if let Some(warning) = unfitted(fit) {
                terminal.warning(warning);
            }
            if !terminal.quiet && !to_stdout {
                print!("{}", describe(fit, self.candidates));
            }
        }
    }
}

/// The warning of a node that could not be fitted.
#[must_use]
pub fn unfitted(fit: &EstimatorFit) -> Option<String> {
    match &fit.outcome {
        Outcome::Fitted(_) => None,
        Outcome::Failed(error) => Some(format!(
            "{} could not be fitted: {error}; it will give no prediction",
            fit.node
        )),
    }
}

/// A model as it is written to a file.
///
/// # Errors
/// When it cannot be written as JSON.
pub fn text_of(model: &Model) -> Result<String, Failure> {
    model
        .to_text()
        .map_err(|error| Failure::Outside(format!("the model cannot be written as JSON: {error}")))
}

/// What came of a fit.
pub struct FitOutcome {
    /// What was read.
    pub dataset: Dataset,
    /// How it went.
    pub report: FitReport,
    /// Outputs of which voters have no regressor left.
    pub bare: Vec<BareOutput>,
    /// What is wrong with channels.
    pub faults: Vec<ChannelFaults>,
    /// What was left out of the data, and what may be wrong in them.
    pub doubts: Vec<Message>,
}

/// Fits a model on data, fills in its card, and warns of what was left out of the data or may be wrong in them.
///
/// # Errors
/// When the data cannot be read.
pub fn fit_on(
    model: &mut Model,
    data: &Data,
    options: &FitOptions,
    host: &dyn Watch,
) -> Result<FitOutcome, Failure> {
    let mut outcome = fit_without_card(model, data, options, host)?;
    warn_bare(&outcome, host);
    for (output, voter, share) in outcome.report.fallbacks(&model.plan) {
        host.warning(format_args!(
            "{output}: {voter} lacks a regressor in {:.0}% of the rows, so it will be its fallback as often",
            100.0 * share
        ));
    }
    let doubts = std::mem::take(&mut outcome.doubts);
    let (dataset, report) = (&outcome.dataset, &outcome.report);
    data::warn_of(host, doubts, &dataset.reports());
    faults::warn(host, &outcome.faults);
    let cards = data.cards(&model.plan, dataset)?;
    model.card = Some(Card::of(report, cards, created()));
    Ok(outcome)
}

/// Warns of outputs that predict a constant, and of voters that do beside others.
pub fn warn_bare(outcome: &FitOutcome, host: &dyn Watch) {
    let (some, none): (Vec<_>, Vec<_>) = outcome.bare.iter().partition(|of| of.has_others);
    for (outputs, is_constant) in [(none, true), (some, false)] {
        if outputs.is_empty() {
            continue;
        }
        let names: Vec<&str> = outputs.iter().map(|of| of.output.as_str()).collect();
        let bare: BTreeSet<&String> = outputs.iter().flat_map(|of| &of.bare).collect();
        let fits = outcome.report.estimators.iter();
        let mut of_bare = fits.filter(|fit| bare.contains(&fit.node));
        let why = match of_bare.any(|fit| !fit.dropped_candidates.is_empty()) {
            true => {
                "; features have values in too few rows: are windows longer than the stretches between gaps?"
            }
            false => "",
        };
        let bare: Vec<&str> = bare.into_iter().map(String::as_str).collect();
        let (names, bare) = (names.join(", "), bare.join(", "));
        host.warning(match is_constant {
            true => format!("{names}: predicts a constant, since no voter has a regressor left ({bare}){why}"),
            false => format!("{names}: {bare} predicts a constant, since it has no regressor left; other voters have{why}"),
        });
    }
}

/// The same without a card, which has the checksums of all data, and without warnings.
///
/// # Errors
/// When the data cannot be read.
pub fn fit_without_card(
    model: &mut Model,
    data: &Data,
    options: &FitOptions,
    host: &dyn Watch,
) -> Result<FitOutcome, Failure> {
    let dataset = data.dataset();
    let watch = FaultWatch::new(&dataset, Purpose::Fit);
    let mut progress = host.progress("fitting");
    let (fitted, report) = fit(
        &model.plan,
        &watch,
        options,
        &mut |progress_of| match progress_of {
            FitProgress::Ticks { stepped, fit, of } => {
                progress.doing(match of {
                    1 => "fitting".to_owned(),
                    _ => format!("fitting {fit} of {of}"),
                });
                progress.set(stepped);
            }
            FitProgress::Order { node, nth, of } => {
                progress.doing(format!("fitting `{node}`, order {nth} of {of}"));
            }
        },
    )?;
    drop(progress);
    let faults = watch.found();
    model.fitted = fitted;
    let doubts = data::doubts(
        &model.plan,
        &dataset.reports(),
        report.refused,
        &report.rejected,
    );
    let bare = report.bare_outputs(&model.plan);
    Ok(FitOutcome {
        dataset,
        bare,
        report,
        faults,
        doubts,
    })
}

/// The line of a step of a selection.
fn write_step(
    text: &mut String,
    nth: &str,
    step: &SelectionStep,
    (width, candidates): (usize, bool),
) {
    let folds: Vec<String> = step.folds.iter().map(|r2| format!("{r2:.3}")).collect();
    let folds = folds.join(" ");
    let line = format!(
        "  {nth:>3} {:<width$}  R² {:.4}  {folds}",
        step.label(),
        step.score
    );
    let _ = writeln!(text, "{}", line.trim_end());
    if candidates {
        for tried in &step.candidates {
            let _ = writeln!(text, "      {:<width$}     {:.4}", tried.name, tried.score);
        }
    }
}

/// How many of the orders that were compared are shown where not all are asked for.
const BEST_ORDERS: usize = 8;

/// The table of orders that were compared, the best first.
fn write_orders(text: &mut String, orders: &OrderTable, all: bool) {
    let header = ["  order", "coefficients", "AIC", "AICc", "BIC", "FPE"];
    let ranks = orders.ranked();
    let most = if all { ranks.len() } else { BEST_ORDERS };
    let shown = most.min(ranks.len());
    let cells = ranks[..shown].iter().map(|&nth| {
        let tried = &orders.tried[nth];
        let chosen = nth == orders.chosen;
        let mut cells = vec![
            format!("  {}", tried.order),
            tried.coefficients.to_string(),
            format!("{:.2}", tried.aic),
            format!("{:.2}", tried.aicc),
            format!("{:.2}", tried.bic),
            match tried.fpe {
                small if small < 0.1 => format!("{small:.3e}"),
                large => number(large),
            },
        ];
        if chosen {
            cells.push(format!(
                "smallest {}, on {}",
                orders.by,
                counted(orders.rows as u64, "row")
            ));
        }
        cells
    });
    text.push_str(&table(&header, &cells.collect::<Vec<_>>()));
    if shown < ranks.len() {
        let more = ranks.len() - shown;
        let _ = writeln!(text, "  and {more} more: see --candidates");
    }
}

/// How wide the longest name in a selection is.
fn width(steps: &[&SelectionStep], candidates: bool) -> usize {
    let tried = steps.iter().flat_map(|step| &step.candidates);
    let tried = tried.filter(|_| candidates);
    let tried = tried.map(|tried| tried.name.chars().count());
    let taken = steps.iter().map(|step| step.label().chars().count());
    // A width of `format!` ends there, and a name may be longer.
    let most = usize::from(u16::MAX);
    taken.chain(tried).max().unwrap_or(0).min(most)
}

/// The text about one fitted node.
#[must_use]
pub fn describe(fit: &EstimatorFit, candidates: bool) -> String {
    let mut text = String::new();
    let _ = write!(
        text,
        "{} ({} of {}): {}",
        fit.node,
        fit.kind,
        fit.truth,
        counted(fit.rows, "row")
    );
    let without_run = match &fit.outcome {
        Outcome::Failed(TrainingError::NeverRan { .. }) => "not predicted",
        _ => "too early to be predicted",
    };
    let dropped = [
        (fit.dropped.outside_limits, "outside the limits"),
        (fit.dropped.without_run, without_run),
        (fit.dropped.incomplete, "incomplete"),
    ];
    let dropped = dropped.iter().filter(|(n, _)| *n > 0);
    let dropped = dropped.map(|(n, why)| format!("{} {why}", count(*n)));
    let dropped: Vec<_> = dropped.collect();
    text.push('\n');
    if !dropped.is_empty() {
        let _ = writeln!(text, "  left out: {}", dropped.join(", "));
    }
    for (name, share) in &fit.dropped_candidates {
        let why = format!("a value in only {:.0} % of the rows", 100.0 * share);
        text.push_str(&paragraph(&format!("  left out {name}:"), 6, &why));
    }
    let Outcome::Fitted(report) = &fit.outcome else {
        return text;
    };
    let refused = report.refused.as_ref().filter(|_| candidates);
    let steps: Vec<_> = report.selection.iter().chain(refused).collect();
    let width = width(&steps, candidates);
    for (nth, step) in steps.into_iter().enumerate() {
        let nth = match nth < report.selection.len() {
            true => (nth + 1).to_string(),
            false => "not".to_owned(),
        };
        write_step(&mut text, &nth, step, (width, candidates));
    }
    if let Some(next) = report.refused.as_ref().filter(|_| !candidates) {
        let would = format!("{} would make it R² {:.4}", next.label(), next.score);
        text.push_str(&paragraph("  no more:", 6, &would));
    }
    if let Some(orders) = &report.orders {
        write_orders(&mut text, orders, candidates);
    }
    let mut facts = Vec::new();
    if let Some(rmse) = report.in_sample_rmse {
        facts.push(format!("in-sample RMSE {} {}", number(rmse), fit.unit));
    }
    if let Some(condition) = report.condition {
        let condition = number(condition);
        facts.push(format!("condition number of the regressors {condition}"));
    }
    if fit.streamed {
        facts.push("rows streamed".to_owned());
    }
    if !facts.is_empty() {
        let _ = writeln!(text, "  {}", facts.join(", "));
    }
    for note in &report.notes {
        text.push_str(&paragraph("  note:", 6, note));
    }
    text
}

/// The present time, or the one that a reproducible build names in `SOURCE_DATE_EPOCH`.
#[must_use]
pub fn created() -> Option<String> {
    let stated = std::env::var("SOURCE_DATE_EPOCH").ok();
    let stated = stated.and_then(|text| text.parse().ok());
    let now = || jiff::Timestamp::now().as_second();
    let time = jiff::Timestamp::from_second(stated.unwrap_or_else(now));
    Some(time.ok()?.to_string())
}
