//! `athermal diagnose`: why a model predicts as well as it does, and what would make it better.

mod next;

use std::path::PathBuf;

use athermal::core::compile::Wanted;
use athermal::diagnosis::{plots, window};
use athermal_jobs::diagnose as job;
use athermal_jobs::diagnose::tables::Tables;
use athermal_jobs::model::load_fitted;
use athermal_jobs::path::graph_or_model;
use clap::Args;

use super::found;
use super::report::write_plots;
use crate::terminal::{Answer, Failure, Format, Terminal};

/// Show why a model predicts as well as it does, and what would make it better
///
/// Shows whether what predictions leave is white (p of Ljung and Box not below 0.01), and which features explain the truth or
/// the rest, at which lag. Shows how each estimator answers a change of each sensor, how well the data determine it, and what
/// each sensor contributes. Fits of its own on the data show how well each day is predicted from the others. They show how many
/// days are needed, and of several loggers how much their clocks differ. Each prediction is looked at wherever it is valid
/// itself; `evaluate` scores those of a truth where all of them are.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  athermal diagnose model.json --data week.csv
  athermal diagnose model.json --data week.csv --window --plots plots
  athermal diagnose model.json --data week.csv --of Z1
  athermal diagnose model.json --data hours.csv --day 30min
  athermal diagnose model.json --data test.csv --no-fit --format json")]
pub struct Diagnose {
    /// The model, or a graph that names one or in which nothing needs fitting
    #[arg(value_parser = graph_or_model())]
    model: PathBuf,
    #[command(flatten)]
    job: job::Diagnose,
    /// A folder for the pictures, each as an SVG file
    #[arg(long, value_name = "DIR")]
    plots: Option<PathBuf>,
}

impl Diagnose {
    /// Works out the facts and prints them.
    ///
    /// # Errors
    /// When the model or the data cannot be used, or a picture cannot be written.
    pub fn run(&self, terminal: &Terminal) -> Result<Answer, Failure> {
        self.job.data.check_lasting("--data")?;
        let model = load_fitted(&self.model, Wanted::default(), terminal)?;
        self.job.data.thin(Some(&self.model), &model)?;
        let with_others = terminal.format == Format::Table;
        let (_, diagnosis) =
            found::show(terminal, |host| self.job.find(&model, with_others, host))?;
        if let Some(folder) = &self.plots {
            write_plots(terminal, folder, &plots(&diagnosis, &self.job.of))?;
        }
        if terminal.format == Format::Table {
            let tables = Tables::new(&diagnosis, &self.job.of);
            if let Some(next) = self.next(&tables, &model, window::any(&model.plan)) {
                terminal.note(format_args!("\n{next}"));
            }
        }
        Ok(Answer::Fine)
    }
}
