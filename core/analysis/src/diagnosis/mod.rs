//! Why a model predicts as well as it does, and what would make it better: the facts behind `athermal diagnose`.
//!
//! [`observe`] steps a model over a recording once; each of the modules works out one kind of fact from that and, where it
//! must, from further passes. All of them step the same engine that runs live.

pub mod comparison;
pub mod day;
mod gap;
pub mod lag;
pub mod leap;
pub mod noise;
mod observation;
pub mod offset;
mod plot;
mod reach;
pub mod regressor;
pub mod residual;
pub mod response;
mod rest;
pub mod sensor;
pub mod text;
pub mod watch;
pub mod window;

pub use observation::{Observation, SourceStatistics, is_asked, is_called, observe};
pub use plot::plots;
pub(crate) use plot::{
    Picture, autocorrelation as autocorrelation_picture, responses as response_pictures,
    with_truth as truth_picture,
};
pub use rest::SilentNode;

use athermal_core::compile::origins::{inputs, of_truths, upstream};
use athermal_core::time::Duration;
use athermal_run::fit::FitError;
use athermal_run::model::Model;
use athermal_run::recording::Recording;
use athermal_run::score::Lack;
use serde::Serialize;

use observation::main_prediction;

/// The facts of a diagnosis.
#[derive(Debug, Clone, Serialize)]
pub struct Diagnosis {
    /// The graph's name.
    pub graph: String,
    /// For each truth the prediction that the graph is about.
    pub main: Vec<Main>,
    /// What every prediction leaves.
    pub residuals: Vec<residual::Residuals>,
    /// Features against truths and residuals.
    pub lags: Vec<lag::Lags>,
    /// How estimators answer their sensors.
    pub responses: Vec<response::Responses>,
    /// How well the data determine the estimators.
    pub designs: Vec<regressor::Design>,
    /// What each sensor contributes.
    pub contributions: Vec<sensor::Contribution>,
    /// What could not be found of sensors, and which node gave nothing.
    #[serde(rename = "untold")]
    pub silent_nodes: Vec<SilentNode>,
    /// Combiners that went by fewer truths than they take, whichever predictions are asked for.
    pub lacks: Vec<Lack>,
    /// What fits on some days are worth on others; none where it was not asked for, or there are too few days or too many.
    pub days: Option<day::Days>,
    /// How many days the recording has.
    pub day_count: usize,
    /// Drifts against their windows, where that was asked for.
    pub windows: Vec<window::Windows>,
}

/// A truth and the prediction of it that is meant: of those asked for, or else all, the first that the graph puts out, or the last.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Main {
    /// The truth: `drift.Z1`.
    pub truth: String,
    /// Its name within its node: `Z1`.
    pub name: String,
    /// The unit of the truth.
    pub unit: String,
    /// The prediction: `vote.Z1`.
    pub prediction: String,
}

/// What is diagnosed beside what always is.
#[derive(Debug, Clone, Default)]
pub struct Options {
    /// Names of predictions that are asked for, by channel, node or axis; none for what the graph puts out.
    pub of: Vec<String>,
    /// How long a day is of which fits are made and scored; none leaves fits out.
    pub day: Option<Duration>,
    /// Whether drifts are set against their windows.
    pub windows: bool,
}

impl Diagnosis {
    /// Leaves out the facts of other predictions than those asked for by name, and of truths none of them predicts.
    pub fn keep_only(&mut self, of: &[String]) {
        self.residuals.retain(|it| is_asked(&it.prediction, of));
        let kept = |truth: &str| self.residuals.iter().any(|it| it.truth == truth);
        self.main.retain(|it| kept(&it.truth));
        self.lags.retain(|it| kept(&it.truth));
        self.windows.retain(|it| kept(&it.truth));
        self.responses.retain(|it| is_asked(&it.node, of));
        self.designs.retain(|it| is_asked(&it.node, of));
        self.contributions.retain(|it| is_asked(&it.prediction, of));
        self.silent_nodes
            .retain(|it| it.estimator.as_ref().is_none_or(|node| is_asked(node, of)));
        if let Some(days) = &mut self.days {
            let left_out = days.left_out.iter_mut().map(|it| &mut it.scores);
            let curve = days.curve.iter_mut().map(|it| &mut it.scores);
            left_out
                .chain(curve)
                .for_each(|scores| scores.retain(|it| is_asked(&it.prediction, of)));
        }
    }
}

/// What is done before fits of its own: the recording is read, and looked at in so many ways.
pub const LOOKING: (&str, u64) = ("looking", 6);

/// Diagnoses a model on a recording that has been read. `progress` gets what is done, how much of it has been, and of how much.
///
/// # Errors
/// When the recording cannot be read, or the fit does not belong to the graph.
pub fn diagnose(
    model: &Model,
    recording: &dyn Recording,
    options: &Options,
    progress: &mut dyn FnMut(&'static str, u64, u64),
) -> Result<(Diagnosis, Observation), FitError> {
    let plan = &*model.plan;
    let mut looked = 1;
    let mut look = || {
        progress(LOOKING.0, looked, LOOKING.1);
        looked += 1;
    };
    look();
    let observation = observe(model, recording)?;
    look();
    let main = observation.trace.truths.iter().filter_map(|truth| {
        let of = &truth.predictions[main_prediction(plan, truth, &options.of)?];
        let channel = &plan.channels[truth.slot];
        Some(Main {
            truth: channel.name.clone(),
            name: channel.channel.name.clone(),
            unit: channel.channel.unit.difference().to_string(),
            prediction: plan.channels[of.slot].name.clone(),
        })
    });
    let (responses, mut silent_nodes) = response::answers(model, &observation)?;
    look();
    let (contributions, more) = sensor::contributions(model, recording, &observation)?;
    silent_nodes.extend(more);
    look();
    let lags = lag::lags(model, recording, &observation, &options.of)?;
    look();
    let designs = regressor::designs(model, recording)?;
    look();
    let mut fitted = |done, all| progress("fitting", done, all);
    let diagnosis = Diagnosis {
        graph: plan.name.clone().unwrap_or_default(),
        main: main.collect(),
        residuals: residual::residuals(plan, &observation),
        lags,
        responses,
        designs,
        contributions,
        silent_nodes,
        lacks: observation.trace.lacks.clone(),
        days: match options.day {
            Some(day) => day::days(model, recording, &observation, day, &mut fitted)?,
            None => None,
        },
        day_count: options.day.map_or(0, |day| day::count(&observation, day)),
        windows: if options.windows {
            window::windows(model, recording)?
        } else {
            Vec::new()
        },
    };
    Ok((diagnosis, observation))
}
