//! What commands do, for programs that bring their own data and models and show the results themselves, as the Python package does.
//!
//! Options are those of the command line, as data: `keep_blocks` is `--keep-blocks`. Data are named as there; a name stands for a
//! table in memory where there is one ([`athermal_files::with_tables`]). What is remarked on the way goes to a [`Watch`].

use std::path::Path;

use athermal::Model;
use athermal::core::compile::{Plan, Wanted};
use athermal::diagnosis::feedback;
use athermal::report::page;
use athermal::run::live::{Sink, run};
use athermal::run::recording::Recording as _;
use athermal_core::watch::Watch;
use schemars::JsonSchema;
use serde::Deserialize;

use crate::command::asked::{IN_MEMORY, done, schema_of};
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
use crate::terminal::Failure;
use athermal_analysis::drawing::{diagram, svg};

pub use crate::command::asked::Asked;
pub use crate::command::found::Found;
pub use crate::starter::{Starter, WITHOUT_ZONE};

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
pub fn fit(graph: &Model, asked: &Asked, host: &dyn Watch) -> Result<Fitted, Failure> {
    done(asked, host, |command: &Fit, host| {
        let mut model = graph.clone();
        let outcome = command.fit(&mut model, host)?;
        let fits = &outcome.report.estimators;
        let failed: Vec<String> = fits.iter().filter_map(fit::unfitted).collect();
        let all = !failed.is_empty() && failed.len() == fits.len();
        if !all {
            failed.iter().for_each(|words| host.warning(words));
        }
        Ok(Fitted {
            model: (!all).then_some(model),
            text: fits.iter().map(|of| fit::describe(of, false)).collect(),
            failed,
        })
    })
}

/// `athermal run`: rows in, outputs out.
#[derive(Debug, Deserialize, JsonSchema)]
struct Predict {
    #[serde(flatten)]
    data: Data,
    /// Let no estimator learn on the way
    #[serde(default)]
    frozen: bool,
}

/// `athermal run` on recorded data: what the model puts out at each row goes to a sink.
///
/// # Errors
/// When the arguments are wrong, the data cannot be read, or the model is a graph that needs a fit.
pub fn predict(
    model: &Model,
    asked: &Asked,
    sink: &mut dyn Sink,
    host: &dyn Watch,
) -> Result<(), Failure> {
    done(asked, host, |command: &Predict, host| {
        let name = Path::new(IN_MEMORY);
        check_fitted(model, name)?;
        warn_unfitted(host, model, name);
        warn_without_novelty(host, model, name);
        if let Some(words) = feedback::in_words(&model.plan) {
            host.warning(words);
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
        doubts.warn(host);
        Ok(())
    })
}

/// `athermal evaluate`: scores a model.
///
/// # Errors
/// When the arguments are wrong, the data cannot be used, or the model is a graph that needs a fit.
pub fn evaluate(model: &Model, asked: &Asked, host: &dyn Watch) -> Result<Found, Failure> {
    done(asked, host, |command: &Evaluate, host| {
        check_fitted(model, Path::new(IN_MEMORY))?;
        command.find(&model.compiled_for(Wanted::SCORES)?, host)
    })
}

/// `athermal diagnose`: why a model predicts as well as it does.
///
/// # Errors
/// As of [`evaluate`].
pub fn diagnose(model: &Model, asked: &Asked, host: &dyn Watch) -> Result<Found, Failure> {
    done(asked, host, |command: &Diagnose, host| {
        check_fitted(model, Path::new(IN_MEMORY))?;
        Ok(command.find(model, false, host)?.0)
    })
}

/// `athermal report`: what a model is worth, and the same as a page of HTML.
///
/// # Errors
/// As of [`evaluate`].
pub fn report(model: &Model, asked: &Asked, host: &dyn Watch) -> Result<(Found, String), Failure> {
    done(asked, host, |command: &Report, host| {
        check_fitted(model, Path::new(IN_MEMORY))?;
        let (found, facts) = command.find(&model.compiled_for(Wanted::SCORES)?, host)?;
        Ok((found, page(&facts)))
    })
}

/// `athermal compare`: fits graphs, each with its name, and scores them on other data.
///
/// # Errors
/// As of [`evaluate`].
pub fn compare(
    graphs: Vec<(String, Model)>,
    asked: &Asked,
    host: &dyn Watch,
) -> Result<Found, Failure> {
    done(asked, host, |command: &Compare, host| {
        Ok(command.find(graphs, host)?.0)
    })
}

/// `athermal init`: a starter graph for data.
///
/// # Errors
/// When the data cannot be read, or nothing in them drifts.
pub fn init(asked: &Asked, host: &dyn Watch) -> Result<Starter, Failure> {
    done(asked, host, |command: &Init, _| command.find())
}

/// `athermal simulate`: each row of a machine with its time in ns goes to `put`. Gives the names of the columns behind the time.
///
/// # Errors
/// When there is no such machine, or an argument does not fit it.
pub fn simulate(
    asked: &Asked,
    put: &mut dyn FnMut(i64, &[f64]),
    host: &dyn Watch,
) -> Result<Vec<String>, Failure> {
    done(asked, host, |command: &Simulate, host| {
        command.rows(host, put)
    })
}

/// The options of every job as JSON Schema, by its name: for programs that show them to their users.
#[must_use]
pub fn options() -> Asked {
    let all = [
        ("fit", schema_of::<Fit>()),
        ("predict", schema_of::<Predict>()),
        ("evaluate", schema_of::<Evaluate>()),
        ("diagnose", schema_of::<Diagnose>()),
        ("report", schema_of::<Report>()),
        ("compare", schema_of::<Compare>()),
        ("init", schema_of::<Init>()),
        ("simulate", schema_of::<Simulate>()),
    ];
    all.map(|(job, schema)| (job.to_owned(), schema))
        .into_iter()
        .collect()
}

/// `athermal show --format svg`: a picture of a graph.
#[must_use]
pub fn picture(plan: &Plan) -> String {
    svg::text(&diagram(plan, false))
}
