//! `athermal compare`: several graphs, fitted and scored on the same data, in one table.

use std::path::PathBuf;

use athermal::Model;
use athermal::core::diagnostic::Sources;
use athermal::core::watch::Watch;
use athermal_jobs::path::graph_or_model;
use athermal_jobs::{compare as job, model};
use clap::Args;

use super::found;
use crate::terminal::{Answer, Failure, Terminal};

/// Fit several graphs on the same data and score them on others, in one table
///
/// Every prediction of every graph is a row, every axis a column. All that predict the same truth over the same horizon are
/// scored on the instants at which all of them are valid, beside no model and persistence. One that is valid at less than
/// half of the instants is scored on its own, and compared with none.
///
/// `--mode` shows how far each model reaches by itself, as in `evaluate`: one step from measured past truths, several, or a
/// free run.
///
/// Beside each score stands the standard error of its difference to the best of the column. The instants are cut, in order
/// of time, into ten blocks of equal size; the spread of the differences over the blocks gives it (batch means; Law and
/// Kelton). A difference of less than two standard errors, marked ~, may be chance: of two such graphs choose the simpler
/// one, or score them on more days.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  athermal compare graphs/die-tester.toml mine.toml --data week.csv \\
      --on days.csv
  athermal compare graphs/zoo.toml --data week.csv --on days.csv \\
      --abs-truth-below \"250 nm/min\"
  athermal compare arx.toml oe.toml --data train.csv --on test.csv \\
      --mode free-run")]
pub struct Compare {
    /// The graphs, or models whose graphs are fitted anew
    #[arg(required = true, value_name = "GRAPH", value_parser = graph_or_model())]
    graphs: Vec<PathBuf>,
    #[command(flatten)]
    job: job::Compare,
}

impl Compare {
    /// Fits, scores and prints.
    ///
    /// # Errors
    /// When a graph has mistakes or the data cannot be used.
    pub fn run(&self, terminal: &Terminal) -> Result<Answer, Failure> {
        let models = self.models(terminal)?;
        let (_, failed) = found::show(terminal, |host| self.job.find(models, host))?;
        Ok(if failed { Answer::No } else { Answer::Fine })
    }

    /// The graphs, each with the name of its file.
    fn models(&self, host: &dyn Watch) -> Result<Vec<(String, Model)>, Failure> {
        let load = |path: &PathBuf| {
            let model = model::load_to_fit(path, &mut Sources::new(), host)?;
            Ok((path.display().to_string(), model))
        };
        self.graphs.iter().map(load).collect()
    }
}
