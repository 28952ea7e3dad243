//! `athermal fleet evaluate`: scores the model of each machine on recorded data.

use athermal_core::watch::Watch;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use athermal_analysis::figures::counted;
use athermal_command::{Answer, Failure, Format, Terminal, print, println};
use athermal_core::quantity::Quantity;
use clap::Args;
use serde_json::json;

use super::table::{self, remark};
use super::{Files, PoolFailure, Workers, few, largest_first, model_of, warn_died, warn_failed};
use crate::figure::{Figure, standings};
use crate::found::Machines;
use crate::job::{Evaluated, Job, Reply, Setup, Task};
use crate::pool::{Event, run};

/// Score the model of each machine on recorded data
///
/// Outputs that predict a measured truth are scored as by `athermal evaluate`. The table shows of each machine the output
/// with the largest error beside the fleet: on how many instants, and its error. That stands also over the median error of
/// this output over all machines. The table has the geometric mean of these ratios over all outputs of the machine, and the error over that of no
/// model.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  athermal fleet evaluate models --data 'new/machine=*/*.csv'\n  \
                        athermal fleet evaluate models --data 'new/machine=*/*.csv' --format json"
)]
pub(crate) struct Evaluate {
    /// The folder of the models
    models: PathBuf,
    /// Files, folders of files, or quoted patterns, such as 'new/machine=*/*.csv'. A folder `machine=…` names the machine of a file, or
    /// what stands for `{machine}` in a pattern
    #[arg(long = "data", short, required = true, num_args = 1.., value_name = "FILES")]
    data: Vec<String>,
    #[command(flatten)]
    scoring: Scoring,
    /// Show all machines, not the worst 20 alone
    #[arg(long)]
    all: bool,
}

/// How machines are scored.
#[derive(Debug, Args)]
pub(crate) struct Scoring {
    #[command(flatten)]
    files: Files,
    #[command(flatten)]
    workers: Workers,
    /// Only truths whose absolute value is below count, such as "250 nm/min"
    #[arg(long, value_name = "QUANTITY", allow_hyphen_values = true)]
    abs_truth_below: Option<Quantity>,
}

/// What came of scoring a fleet.
#[derive(Debug, Default)]
pub(crate) struct Scored {
    /// The machines that were scored.
    pub machines: BTreeMap<String, Evaluated>,
    /// Those that could not be, and why.
    pub failed: BTreeMap<String, String>,
}

impl Scored {
    /// The figures of each machine.
    pub fn figures(&self) -> BTreeMap<String, Vec<Figure>> {
        let all = self.machines.iter();
        all.map(|(machine, of)| (machine.clone(), of.scores.clone()))
            .collect()
    }
}

impl Scoring {
    /// Scores the models in a folder, each on the files of its machine.
    ///
    /// # Errors
    /// When files are of no machine, or no worker can be started.
    pub fn score(
        &self,
        models: &Path,
        data: &[String],
        terminal: &Terminal,
    ) -> Result<Scored, Failure> {
        let machines: Machines = self.files.machines(data)?;
        let mut scored = Scored::default();
        let mut jobs = Vec::new();
        for machine in largest_first(&machines) {
            let model = model_of(models, machine);
            if model.is_file() {
                jobs.push(Job {
                    machine: machine.clone(),
                    files: machines[machine].clone(),
                    task: Task::Evaluate { model },
                });
            } else {
                let error = format!("there is no model {}", model.display());
                scored.failed.insert(machine.clone(), error);
            }
        }
        let setup = Setup {
            reading: self.files.reading.clone(),
            abs_truth_below: self.abs_truth_below.clone(),
            ..Setup::default()
        };
        let mut progress = terminal.begin("evaluating", Some(jobs.len() as u64));
        let mut done = 0;
        run(&setup, self.workers.count(), jobs, |event| {
            warn_died(terminal, &event);
            if let Event::Done { job, reply } = event {
                done += 1;
                progress.set(done);
                match reply {
                    Reply::Evaluated(of) => _ = scored.machines.insert(job.machine, *of),
                    Reply::Failed { error } => _ = scored.failed.insert(job.machine, error),
                    Reply::Same | Reply::Fitted(_) => {}
                }
            }
            Ok(())
        })
        .map_err(|error: PoolFailure| error.0)?;
        Ok(scored)
    }
}

impl Evaluate {
    /// Scores and prints.
    ///
    /// # Errors
    /// As of [`Scoring::score`].
    pub fn run(&self, terminal: &Terminal) -> Result<Answer, Failure> {
        let scored = self.scoring.score(&self.models, &self.data, terminal)?;
        let standings = standings(&scored.figures());
        if terminal.format == Format::Json {
            let of_scored = standings.iter().map(|of| {
                let mut facts = table::facts(of);
                let machine = &scored.machines[&of.machine];
                facts["rows"] = json!(machine.rows);
                facts["fitted_on"] = machine.fitted_on.into();
                facts["doubts"] = json!(machine.doubts);
                facts
            });
            let failed = scored.failed.iter();
            let failed =
                failed.map(|(machine, error)| json!({ "machine": machine, "error": error }));
            println!(
                "{:#}",
                json!({
                    "models": self.models,
                    "abs_truth_below": self.scoring.abs_truth_below.as_ref().map(Quantity::to_string),
                    "failed": scored.failed.len(),
                    "machines": failed.chain(of_scored).collect::<Vec<_>>(),
                })
            );
        } else {
            warn_failed(terminal, &scored.failed);
            let remarks = scored.machines.iter();
            let remarks = remarks.map(|(machine, of)| (machine.clone(), remark(&of.doubts, None)));
            if !standings.is_empty() {
                print!(
                    "{}",
                    table::standings(&standings, &remarks.collect(), self.all)
                );
            }
            terminal.note(format_args!(
                "{} scored, {} failed",
                counted(scored.machines.len() as u64, "machine"),
                scored.failed.len()
            ));
        }
        let seen = scored.machines.iter().filter(|(_, of)| of.fitted_on);
        let seen: Vec<String> = seen.map(|(machine, _)| machine.clone()).collect();
        if !seen.is_empty() {
            terminal.warning(format_args!(
                "{}: fitted on these rows, so the scores show how well it fits, not how well it predicts",
                few(&seen)
            ));
        }
        Ok(if scored.failed.is_empty() {
            Answer::Fine
        } else {
            Answer::No
        })
    }
}
