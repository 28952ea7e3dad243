//! What commands do, for programs that bring their own data and models and show the results themselves, as the Python package does.
//!
//! Arguments are those of the command line, without the file of the graph or the model. Data are named as there; a name stands for a
//! table in memory where there is one ([`athermal_files::with_tables`]). Reports go to the terminal, unless they are collected
//! ([`athermal_command::collect`]).

use std::path::Path;

use athermal::Model;
use athermal::core::compile::{Plan, Wanted};
use athermal::diagnosis::feedback;
use athermal::report::page;
use athermal::run::live::{Sink, run};
use athermal::run::recording::Recording as _;
use clap::Args;

use crate::command::beyond::beyond;
use crate::command::compare::Compare;
use crate::command::data::Data;
use crate::command::diagnose::Diagnose;
use crate::command::doubts::Doubts;
use crate::command::evaluate::Evaluate;
use crate::command::faults::{FaultWatch, Purpose};
use crate::command::fit::{self, Fit};
use crate::command::init::Init;
use crate::command::model::{check_fitted, warn_unfitted, warn_without_novelty};
use crate::command::report::Report;
use crate::command::simulate::Simulate;
use crate::terminal::{Failure, Options, Terminal};
use athermal_analysis::drawing::{diagram, svg};

pub use crate::command::found::Found;
pub use crate::starter::{Starter, WITHOUT_ZONE};

/// What stands for the file of a graph or a model that is in memory.
const IN_MEMORY: &str = "model";

fn terminal() -> Terminal {
    Terminal::new(&Options {
        format: "json".to_owned(),
        quiet: false,
    })
}

/// The arguments of a command.
fn parsed<C: Args>(name: &'static str, words: &[&str], arguments: &[String]) -> Result<C, Failure> {
    let command = C::augment_args(clap::Command::new(name))
        .no_binary_name(true)
        .disable_help_flag(true);
    let words = words.iter().copied();
    let words = words.chain(arguments.iter().map(String::as_str));
    let matches = command.try_get_matches_from(words);
    matches
        .and_then(|matches| C::from_arg_matches(&matches))
        .map_err(|error| {
            let text = error.to_string();
            let text = text.strip_prefix("error: ").unwrap_or(&text);
            let end = text.find("\n\nUsage").unwrap_or(text.len());
            Failure::Request(text[..end].trim_end().to_owned())
        })
}

/// How a fit went.
#[derive(Debug)]
pub struct Fitted {
    /// The model; none where nothing could be fitted.
    pub model: Option<Model>,
    /// For people, as `athermal fit` prints it.
    pub text: String,
    /// Why nodes could not be fitted.
    pub failed: Vec<String>,
}

/// `athermal fit`: fits a graph.
///
/// # Errors
/// When the arguments are wrong or the data cannot be read.
pub fn fit(graph: &Model, arguments: &[String]) -> Result<Fitted, Failure> {
    let command: Fit = parsed("fit", &[IN_MEMORY, "--output", "-"], arguments)?;
    let terminal = terminal();
    let mut model = graph.clone();
    let outcome = command.fit(&mut model, &terminal)?;
    let fits = &outcome.report.estimators;
    let failed: Vec<String> = fits.iter().filter_map(fit::unfitted).collect();
    let all = !failed.is_empty() && failed.len() == fits.len();
    if !all {
        failed.iter().for_each(|words| terminal.warning(words));
    }
    Ok(Fitted {
        model: (!all).then_some(model),
        text: fits.iter().map(|of| fit::describe(of, false)).collect(),
        failed,
    })
}

/// `athermal run`: rows in, outputs out.
#[derive(Debug, Args)]
struct Predict {
    #[command(flatten)]
    data: Data,
    /// Let no estimator learn on the way
    #[arg(long)]
    frozen: bool,
}

/// `athermal run` on recorded data: what the model puts out at each row goes to a sink.
///
/// # Errors
/// When the arguments are wrong, the data cannot be read, or the model is a graph that needs a fit.
pub fn predict(model: &Model, arguments: &[String], sink: &mut dyn Sink) -> Result<(), Failure> {
    let command: Predict = parsed("predict", &[], arguments)?;
    let (terminal, name) = (terminal(), Path::new(IN_MEMORY));
    check_fitted(model, name)?;
    warn_unfitted(&terminal, model, name);
    warn_without_novelty(&terminal, model, name);
    if let Some(words) = feedback::in_words(&model.plan) {
        terminal.warning(words);
    }
    let mut engine = model.engine()?;
    engine.freeze(command.frozen);
    let dataset = command.data.dataset();
    let watch = FaultWatch::new(&dataset, Purpose::Run);
    let mut source = watch.open(&model.plan).map_err(crate::terminal::outside)?;
    run(&mut engine, &mut *source, sink)?;
    drop(source);
    let (ranges, rejected) = (engine.sample_ranges(), engine.rejected_channels());
    let doubts = Doubts {
        plan: &model.plan,
        dataset: &dataset,
        refused: engine.refused(),
        rejected: &rejected,
        faults: watch.found(),
        outside_fit: beyond(model.sample_ranges(), &ranges),
    };
    doubts.warn(&terminal);
    Ok(())
}

/// `athermal evaluate`: scores a model.
///
/// # Errors
/// When the arguments are wrong, the data cannot be used, or the model is a graph that needs a fit.
pub fn evaluate(model: &Model, arguments: &[String]) -> Result<Found, Failure> {
    let command: Evaluate = parsed("evaluate", &[IN_MEMORY], arguments)?;
    check_fitted(model, Path::new(IN_MEMORY))?;
    command.find(&model.compiled_for(Wanted::SCORES)?, &terminal())
}

/// `athermal diagnose`: why a model predicts as well as it does.
///
/// # Errors
/// As of [`evaluate`].
pub fn diagnose(model: &Model, arguments: &[String]) -> Result<Found, Failure> {
    let command: Diagnose = parsed("diagnose", &[IN_MEMORY], arguments)?;
    check_fitted(model, Path::new(IN_MEMORY))?;
    Ok(command.find(model, &terminal())?.0)
}

/// `athermal report`: what a model is worth, and the same as a page of HTML.
///
/// # Errors
/// As of [`evaluate`].
pub fn report(model: &Model, arguments: &[String]) -> Result<(Found, String), Failure> {
    let command: Report = parsed("report", &[IN_MEMORY], arguments)?;
    check_fitted(model, Path::new(IN_MEMORY))?;
    let (found, facts) = command.find(&model.compiled_for(Wanted::SCORES)?, &terminal())?;
    Ok((found, page(&facts)))
}

/// `athermal compare`: fits graphs, each with its name, and scores them on other data.
///
/// # Errors
/// As of [`evaluate`].
pub fn compare(graphs: Vec<(String, Model)>, arguments: &[String]) -> Result<Found, Failure> {
    let command: Compare = parsed("compare", &[IN_MEMORY], arguments)?;
    Ok(command.find(graphs, &terminal())?.0)
}

/// `athermal init`: a starter graph for data, which stand before all other arguments.
///
/// # Errors
/// When the data cannot be read, or nothing in them drifts.
pub fn init(arguments: &[String]) -> Result<Starter, Failure> {
    let command: Init = parsed("init", &[], arguments)?;
    command.find()
}

/// `athermal simulate`: each row of a machine with its time in ns goes to `put`. Gives the names of the columns behind the time.
///
/// # Errors
/// When there is no such machine, or an argument does not fit it.
pub fn simulate(
    arguments: &[String],
    put: &mut dyn FnMut(i64, &[f64]),
) -> Result<Vec<String>, Failure> {
    let command: Simulate = parsed("simulate", &[], arguments)?;
    command.rows(&terminal(), put)
}

/// `athermal show --format svg`: a picture of a graph.
#[must_use]
pub fn picture(plan: &Plan) -> String {
    svg::text(&diagram(plan, false))
}
