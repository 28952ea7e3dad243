//! `athermal fit`: fits what a graph has to learn on recorded data, estimators and encoders, and writes a model.

use athermal_core::watch::Watch;
use schemars::JsonSchema;
use serde::Deserialize;
use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::sync::Arc;

use athermal_core::compile::Plan;
use athermal_core::engine::Fitted;
use athermal_core::node::{OrderTable, SelectionStep, TrainingError};
use athermal_files::{Dataset, Report};
use athermal_run::fit::{
    BareOutput, EstimatorFit, FitError, FitOptions, FitProgress, FitReport, Outcome, fit,
};
use athermal_run::model::{Card, Model};
use athermal_run::recording::Recording;
use clap::Args;

use crate::Threads;
use crate::blocks::{BlockOptions, OfFiles, Sums};
use crate::data::Data;
use crate::faults::{self, ChannelFaults, FaultWatch, Purpose};
use crate::{noise, remarks};
use athermal_analysis::figures::{count, counted, number, paragraph, table};
use athermal_command::numbers;
use athermal_core::failure::Failure;
use athermal_core::message::Message;

/// How a graph is fitted on recorded data.
#[derive(Debug, Args, Deserialize, JsonSchema)]
#[group(skip)]
pub struct Fit {
    /// The data.
    #[command(flatten)]
    #[serde(flatten)]
    pub data: Data,
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
    pub candidates: bool,
}

/// So many megabytes of rows are kept where nothing else is asked for.
fn megabytes() -> usize {
    64
}

impl Fit {
    /// A fit on some data with what else is usual.
    #[must_use]
    pub fn on(data: Data) -> Self {
        Self {
            data,
            blocks: BlockOptions::default(),
            threads: Threads::default(),
            memory: megabytes(),
            candidates: false,
        }
    }

    /// Fits a graph, fills in its card, and warns of what was left out of the data or may be wrong in them.
    ///
    /// # Errors
    /// When the data cannot be read.
    pub fn fit(&self, model: &mut Model, host: &dyn Watch) -> Result<FitOutcome, Failure> {
        self.data.thin(None, model)?;
        self.data.check_offsets(&[])?;
        self.blocks.check(self.data.is_a_stretch())?;
        self.data.warn_of_machines(host);
        let options = FitOptions {
            memory: self.memory.saturating_mul(1 << 20),
            threads: self.threads.count(),
            ..FitOptions::default()
        };
        let plan = &model.plan;
        let (outcome, cards) = match self.blocks.blocks {
            Some(cut) => {
                let of = OfFiles {
                    cut,
                    files: self.data.files(),
                    reading: format!("{:?}", self.data.reading),
                    data: &|files, within| match files.is_empty() {
                        true => self.data.dataset(),
                        false => self.data.dataset_of(files, within),
                    },
                };
                let sums = Sums::of(plan, self.blocks.keep_blocks.as_deref(), &of, host)?;
                let cards = match sums.cards() {
                    Some(cards) => cards.to_vec(),
                    None => self.data.cards(plan, sums.files())?,
                };
                (sums.fit(plan, &options)?, cards)
            }
            None => {
                let dataset = self.data.dataset();
                let outcome = FitOutcome::of(plan, &dataset, &options, host)?;
                let outcome = outcome.read_from(&dataset);
                let cards = self.data.cards(plan, &outcome.files)?;
                (outcome, cards)
            }
        };
        outcome.warn(plan, host);
        model.card = Some(Card::of(&outcome.report, cards, created()));
        model.fitted = outcome.fitted.clone();
        Ok(outcome)
    }
}

/// The warning of a node that could not be fitted.
fn unfitted(fit: &EstimatorFit) -> Option<String> {
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
#[derive(Debug)]
pub struct FitOutcome {
    /// What was fitted.
    pub fitted: Fitted,
    /// How it went.
    pub report: FitReport,
    /// Outputs of which voters have no regressor left.
    pub bare: Vec<BareOutput>,
    /// What is wrong with channels.
    pub faults: Vec<ChannelFaults>,
    /// The warnings of fits that are better than the noise of their truths allows.
    pub below_noise: Vec<Message>,
    /// What was met in each file that was read.
    pub files: Vec<(String, Report)>,
    /// Blocks that were kept although their rows are gone.
    pub lost: Vec<String>,
}

impl FitOutcome {
    /// Fits a graph on rows: the one way to do so for whoever has some.
    ///
    /// # Errors
    /// When the rows cannot be read, or a node panics.
    pub fn of(
        plan: &Arc<Plan>,
        rows: &dyn Recording,
        options: &FitOptions,
        host: &dyn Watch,
    ) -> Result<Self, FitError> {
        let watch = FaultWatch::new(rows, Purpose::Fit);
        let mut progress = host.progress("fitting");
        let fitted = fit(plan, &watch, options, &mut |of| match of {
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
        });
        let mut outcome = Self::with(plan, fitted?, watch.found());
        outcome.below_noise = noise::warnings(rows, plan, &outcome.fitted, &outcome.report);
        Ok(outcome)
    }

    /// One of a fit that was made, with what is wrong with channels of its rows.
    #[must_use]
    pub fn with(
        plan: &Plan,
        (fitted, report): (Fitted, FitReport),
        faults: Vec<ChannelFaults>,
    ) -> Self {
        Self {
            bare: report.bare_outputs(plan),
            fitted,
            report,
            faults,
            below_noise: Vec::new(),
            files: Vec::new(),
            lost: Vec::new(),
        }
    }

    /// The same, with what was met in each file.
    #[must_use]
    pub fn read_from(self, dataset: &Dataset) -> Self {
        let files = dataset.reports();
        Self { files, ..self }
    }

    /// Why each node could not be fitted that could not.
    #[must_use]
    pub fn failed(&self) -> Vec<String> {
        self.report.estimators.iter().filter_map(unfitted).collect()
    }

    /// Whether there were nodes to fit, and none could be.
    #[must_use]
    pub fn is_nothing(&self) -> bool {
        let all = self.report.estimators.len();
        all > 0 && self.report.failed().count() == all
    }

    /// What was left out of the data, and what may be wrong with them: whoever fits reports these.
    #[must_use]
    pub fn doubts(&self, plan: &Plan) -> Vec<Message> {
        let report = &self.report;
        let mut all = Vec::new();
        all.extend(report.fallbacks(plan).into_iter().map(|(output, voter, share)| {
            let share = 100.0 * share;
            format!(
                "{output}: {voter} lacks a regressor in {share:.0}% of the rows, so it will be its fallback as often"
            )
            .into()
        }));
        let rejected = &report.rejected;
        all.extend(remarks::doubts(plan, &self.files, report.refused, rejected));
        if let (Some(first), Some(last)) = (self.lost.first(), self.lost.last()) {
            let [first, last] = [first, last].map(|name| name.trim_end_matches(".json"));
            let words = format!(
                "{} kept although the rows are gone, {first} to {last}: what files hold no more of these is as it was",
                counted(self.lost.len() as u64, "block")
            );
            all.push(words.into());
        }
        all.extend(faults::messages(&self.faults));
        all.extend(self.below_noise.iter().cloned());
        all
    }

    /// Reports these.
    pub fn warn(&self, plan: &Plan, host: &dyn Watch) {
        self.constant().into_iter().for_each(|of| host.warning(of));
        remarks::warn_of(host, self.doubts(plan), &self.files);
        if !self.is_nothing() {
            self.failed().iter().for_each(|words| host.warning(words));
        }
    }

    /// How each node was fitted, for people; with all that was tried where that is asked for.
    #[must_use]
    pub fn text(&self, candidates: bool) -> String {
        let fits = self.report.estimators.iter();
        fits.map(|fit| describe(fit, candidates)).collect()
    }

    /// Outputs that predict a constant, and voters that do beside others.
    fn constant(&self) -> Vec<Message> {
        let (some, none): (Vec<_>, Vec<_>) = self.bare.iter().partition(|of| of.has_others);
        let groups = [(none, true), (some, false)].into_iter();
        let groups = groups.filter(|(outputs, _)| !outputs.is_empty());
        let message = |(outputs, is_constant): (Vec<&BareOutput>, bool)| {
            let names: Vec<&str> = outputs.iter().map(|of| of.output.as_str()).collect();
            let bare: BTreeSet<&String> = outputs.iter().flat_map(|of| &of.bare).collect();
            let fits = self.report.estimators.iter();
            let mut of_bare = fits.filter(|fit| bare.contains(&fit.node));
            let why = match of_bare.any(|fit| !fit.dropped_candidates.is_empty()) {
                true => {
                    "; features have values in too few rows: are windows longer than the stretches between gaps?"
                }
                false => "",
            };
            let bare: Vec<&str> = bare.into_iter().map(String::as_str).collect();
            let (names, bare) = (names.join(", "), bare.join(", "));
            match is_constant {
                true => format!("{names}: predicts a constant, since no voter has a regressor left ({bare}){why}"),
                false => format!("{names}: {bare} predicts a constant, since it has no regressor left; other voters have{why}"),
            }
            .into()
        };
        groups.map(message).collect()
    }
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
fn describe(fit: &EstimatorFit, candidates: bool) -> String {
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
        (fit.dropped.leapt, "over a leap"),
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
