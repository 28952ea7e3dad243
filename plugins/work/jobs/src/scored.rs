//! The options that say how predictions are scored.

use schemars::JsonSchema;
use serde::Deserialize;
use std::num::NonZeroU32;

use athermal_core::quantity::Quantity;
use athermal_run::model::Model;
use athermal_run::score::{Mode, ScoreOptions};
use clap::{Args, ValueEnum};
use serde_json::{Value, json};

use crate::model::check_limit;
use athermal_analysis::figures::counted;
use athermal_command::numbers;
use athermal_core::failure::Failure;

/// How predictions are scored.
#[derive(Debug, Args, Deserialize, JsonSchema)]
pub struct Scored {
    /// Only truths whose absolute value is below count, such as "250 nm/min"
    #[arg(long, value_name = "QUANTITY", allow_hyphen_values = true)]
    #[serde(default)]
    abs_truth_below: Option<Quantity>,
    /// Let no estimator learn on the way; otherwise, what learns does so after each truth has been predicted. Votes go by recent
    /// errors in either case
    #[arg(long)]
    #[serde(default)]
    frozen: bool,
    /// From which past truths predictions are made; only what reads or follows past truths differs
    #[arg(long, value_enum, default_value = "one-step")]
    #[serde(default)]
    mode: Horizon,
    /// How many steps ahead `--mode k-step` predicts
    #[arg(
        long,
        value_name = "K",
        allow_negative_numbers = true,
        value_parser = numbers::read::<NonZeroU32>("a whole number of steps, 1 or more and below 2^32")
    )]
    #[serde(default)]
    steps: Option<NonZeroU32>,
}

/// From which past truths predictions are made.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, ValueEnum, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
enum Horizon {
    /// From those measured, as beside a machine: all that the horizon and the embargo allow
    #[default]
    OneStep,
    /// From those measured up to K steps before the predicted one; newer ones are replaced by predictions of them, and
    /// nothing is learned from them. A step is the time from the newest truth that an estimator may read to the predicted one
    KStep,
    /// From its own predictions. A measured truth is read only where there is none yet, as at the beginning of a segment.
    /// Nothing is learned from any. What follows a state gets as many as it needs to find it
    FreeRun,
}

impl Scored {
    /// The same for the program's own functions.
    ///
    /// # Errors
    /// When mode and steps do not go together.
    pub fn options(&self) -> Result<ScoreOptions, Failure> {
        Ok(ScoreOptions {
            abs_truth_below: self.abs_truth_below.clone(),
            each_on_its_own: false,
            frozen: self.frozen,
            mode: self.mode()?,
            ..ScoreOptions::default()
        })
    }

    /// Refuses a limit that truths of a model cannot have.
    ///
    /// # Errors
    /// When there is one.
    pub fn check(&self, model: &Model) -> Result<(), Failure> {
        match &self.abs_truth_below {
            Some(limit) => check_limit(limit, model),
            None => Ok(()),
        }
    }

    /// How many steps ahead is predicted, where that was asked for.
    pub fn steps(&self) -> Option<NonZeroU32> {
        self.steps
    }

    fn mode(&self) -> Result<Mode, Failure> {
        match (self.mode, self.steps) {
            (Horizon::OneStep, None) => Ok(Mode::OneStep),
            (Horizon::FreeRun, None) => Ok(Mode::FreeRun),
            (Horizon::KStep, Some(steps)) => Ok(Mode::Steps(steps)),
            (Horizon::KStep, None) => Err(Failure::Request(
                "--mode k-step needs the number of steps: `--steps 3`".to_owned(),
            )),
            (other, Some(_)) => Err(Failure::Request(format!(
                "--steps is for `--mode k-step`, and the mode is {}",
                other.name()
            ))),
        }
    }

    /// For people: a line for each that is in force, none as a rule.
    pub fn in_words(&self) -> Vec<String> {
        let mut lines = Vec::new();
        match (self.mode, self.steps) {
            (Horizon::KStep, Some(steps)) => lines.push(format!(
                "{} ahead: no truth newer than that is read, but what was predicted of it",
                counted(steps.get(), "step")
            )),
            (Horizon::FreeRun, _) => lines.push(
                "free run: no measured truth is read where there is a prediction of it".to_owned(),
            ),
            _ => {}
        }
        if let Some(limit) = &self.abs_truth_below {
            lines.push(format!(
                "only truths whose absolute value is below {limit} count"
            ));
        }
        if self.frozen {
            lines.push("no estimator learns on the way".to_owned());
        }
        lines
    }

    /// For programs: adds all that could be asked for to an object.
    pub fn add_to(&self, facts: &mut Value) {
        let limit = self.abs_truth_below.as_ref().map(Quantity::to_string);
        facts["mode"] = self.mode.name().into();
        facts["steps"] = json!(self.steps);
        facts["abs_truth_below"] = json!(limit);
        facts["frozen"] = self.frozen.into();
    }
}

impl Horizon {
    fn name(self) -> &'static str {
        match self {
            Self::OneStep => "one-step",
            Self::KStep => "k-step",
            Self::FreeRun => "free-run",
        }
    }
}
