//! `athermal fleet fit`: fits a graph on each machine of a fleet.

use athermal_core::watch::Watch;
use std::collections::BTreeMap;
use std::path::PathBuf;

use athermal_analysis::figures::counted;
use athermal_command::{Answer, Failure, Format, Terminal, numbers, println};
use athermal_core::compile::Wanted;
use athermal_core::diagnostic::{Diagnostics, Sources};
use athermal_core::time::Duration;
use athermal_files::TimeColumn;
use athermal_run::live::store::{FileLock, write_whole};
use athermal_run::model::Model;
use clap::Args;
use serde_json::json;

use super::pooled::Pooled;
use super::table::{self, remark};
use super::{Files, PoolFailure, Workers, few, largest_first, model_of, warn_died, warn_failed};
use crate::figure::{Figure, standings};
use crate::found::Machines;
use crate::job::{Job, Reply, Setup, Task, graph_hash};
use crate::manifest::{Entry, Maker, Manifest, Outcome, Stamp, Writing};
use crate::pool::{Event, run};
use athermal_jobs::blocks::BlockOptions;

/// Fit a graph on each machine of a fleet
///
/// Each machine is fitted by a worker, a process of its own: one that fails or dies takes no other with it. What was
/// fitted before on the same rows, with the same graph and program, is not fitted again: a fit that was stopped goes on
/// where it was. Machines that failed are tried again. The exit status is 1 where any failed.
///
/// With `--blocks day` each machine is fitted as `athermal fit --blocks day` does it, on the sums of each UTC day in place of rows. With
/// `--keep-blocks FOLDER` these are kept, and the next fit of years reads them and the days that are new.
///
/// The table shows of each machine the estimator with the largest error beside the fleet: on how many rows, and its error on
/// them. It also has that over the median error of this estimator over all machines, and the geometric mean of these ratios over all
/// estimators of the machine.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  athermal fleet fit graph.toml --data 'logs/machine=*/*.csv' -o models\n  \
                        athermal fleet fit graph.toml --data 'logs/{machine}-*.csv' -o models --jobs 4\n  \
                        athermal fleet fit graph.toml --data 'logs/machine=*/*.csv' --pooled -o type.json"
)]
pub(crate) struct Fit {
    /// The graph, or a model whose graph is fitted anew
    graph: PathBuf,
    /// Files, folders of files, or quoted patterns, such as 'logs/machine=*/*.csv'. A folder `machine=…` names the machine of a file, or
    /// what stands for `{machine}` in a pattern
    #[arg(long = "data", short, required = true, num_args = 1.., value_name = "FILES")]
    data: Vec<String>,
    #[command(flatten)]
    files: Files,
    /// The folder that the models go into; with `--pooled` the file of the prior
    #[arg(long, short, value_name = "FOLDER")]
    output: PathBuf,
    #[command(flatten)]
    workers: Workers,
    #[command(flatten)]
    blocks: BlockOptions,
    /// Megabytes of rows that each worker keeps; beyond, rows are streamed in a second pass
    #[arg(
        long,
        value_name = "MB",
        default_value_t = 64,
        allow_negative_numbers = true,
        value_parser = numbers::read::<usize>("a whole number of megabytes, such as 64")
    )]
    memory: usize,
    /// The date on the models, as RFC 3339 writes it; else the present time, or that of a fit that is resumed
    #[arg(long, value_name = "DATE", value_parser = date)]
    date: Option<String>,
    /// Find what the machines have in common instead, as a prior for a new one: its file is `--output`
    ///
    /// Of each `linear`, `ar` and `arx` with the solver `ridge` the prior has mean and covariance of the coefficients over the machines. A
    /// graph whose solver is `{ type = "ridge", prior = "type.json" }` is fitted towards it. The table shows the error of a machine that was
    /// left out, after a short stretch of its own data: with the prior, of its mean alone, and without it. Machines are fitted one after
    /// the other, in this process.
    #[arg(long, conflicts_with_all = ["date", "all", "blocks"])]
    pooled: bool,
    /// How long the data of a new machine are, for which the prior is made
    #[arg(
        long,
        value_name = "DURATION",
        default_value = "2h",
        requires = "pooled"
    )]
    stretch: Duration,
    /// Show all machines, not the worst 20 alone
    #[arg(long)]
    all: bool,
}

fn date(text: &str) -> Result<String, String> {
    let read: Result<jiff::Timestamp, _> = text.parse();
    let read =
        read.map_err(|_| format!("expected a date such as 2026-01-31T12:00:00Z, found {text:?}"))?;
    Ok(read.to_string())
}

/// What came of a call, machine by machine.
#[derive(Debug, Default)]
struct Tally {
    fitted: usize,
    unchanged: usize,
    failed: BTreeMap<String, String>,
}

impl Fit {
    /// Fits, reports and writes.
    ///
    /// # Errors
    /// When the graph has mistakes, files are of no machine, or models cannot be written.
    pub fn run(&self, terminal: &Terminal) -> Result<Answer, Failure> {
        let machines = self.files.machines(&self.data)?;
        if self.pooled {
            let pooled = Pooled {
                graph: &self.graph,
                machines: &machines,
                reading: &self.files.reading,
                output: &self.output,
                stretch: self.stretch,
                memory: self.memory.saturating_mul(1 << 20),
                threads: self.workers.count(),
            };
            return pooled.run(terminal);
        }
        let hash = self.checked_graph(terminal)?;
        std::fs::create_dir_all(&self.output).map_err(|error| {
            Failure::Outside(format!("cannot make {}: {error}", self.output.display()))
        })?;
        let Some(_lock) = FileLock::acquire(&Manifest::path_in(&self.output)) else {
            return Err(Failure::Outside(format!(
                "{}: another fit of a fleet writes there: wait for it, or name another folder",
                self.output.display()
            )));
        };
        let mut writing = Writing::new(self.manifest(&hash)?, &self.output);
        let maker = Maker {
            athermal: env!("CARGO_PKG_VERSION").to_owned(),
            graph_hash: hash.clone(),
            reading: self.files.reading.clone(),
            blocks: self.blocks.blocks,
        };
        let (jobs, stamps, unchanged) = self.jobs(&machines, &writing.manifest, &maker);
        let mut tally = Tally {
            unchanged,
            ..Tally::default()
        };
        writing.write().map_err(|error| self.not_written(&error))?;
        let setup = Setup {
            graph: Some((self.graph.clone(), hash)),
            reading: self.files.reading.clone(),
            blocks: self.blocks.clone(),
            memory: self.memory.saturating_mul(1 << 20),
            ..Setup::default()
        };
        let mut progress = terminal.begin("fitting", Some(jobs.len() as u64));
        let mut done = 0;
        run(&setup, self.workers.count(), jobs, |event| {
            warn_died(terminal, &event);
            if let Event::Done { job, reply } = event {
                done += 1;
                progress.set(done);
                let stamps = stamps[&job.machine].clone();
                self.take(&job, reply, stamps, &maker, &mut writing, &mut tally)?;
            }
            let written = writing.write_soon();
            Ok(written.map_err(|error| self.not_written(&error))?)
        })
        .map_err(|error: PoolFailure| error.0)?;
        drop(progress);
        writing.manifest.finished = true;
        writing.write().map_err(|error| self.not_written(&error))?;
        self.report(terminal, &machines, &writing.manifest, &tally);
        let is_poor = |entry: &Entry| !entry.unfitted.is_empty() || !entry.constant.is_empty();
        let poor = machines
            .keys()
            .filter_map(|name| writing.manifest.machines.get(name))
            .any(is_poor);
        Ok(if poor || !tally.failed.is_empty() {
            Answer::No
        } else {
            Answer::Fine
        })
    }

    /// The checksum of the graph, which has no mistakes.
    fn checked_graph(&self, terminal: &Terminal) -> Result<String, Failure> {
        let (mut sources, mut doubts) = (Sources::new(), Diagnostics::new());
        let graph = Model::load_to_fit(&self.graph, Wanted::default(), &mut sources, &mut doubts)?;
        terminal.doubts(&doubts, &sources);
        // What is wrong with these is wrong for all machines.
        let times = self.files.reading.times.stretch();
        times.of(&TimeColumn::from(&graph.plan.time))?;
        graph_hash(&graph).map_err(|error| Failure::Outside(error.to_string()))
    }

    /// The manifest that this call goes on with.
    fn manifest(&self, hash: &str) -> Result<Manifest, Failure> {
        let known =
            Manifest::read(&self.output).map_err(|error| Failure::Request(error.to_string()))?;
        let graph = self.graph.display().to_string();
        let mut manifest = known.unwrap_or_else(|| Manifest::new(graph.clone(), hash.to_owned()));
        let goes_on = !manifest.finished && manifest.graph_hash == hash;
        let begun = manifest.created.take().filter(|_| goes_on);
        manifest.created = self.date.clone().or(begun).or_else(present);
        (manifest.graph, manifest.graph_hash) = (graph, hash.to_owned());
        manifest.finished = false;
        Ok(manifest)
    }

    /// What is to be done: all machines but those whose model is of the same files, graph and program.
    fn jobs(
        &self,
        machines: &Machines,
        manifest: &Manifest,
        maker: &Maker,
    ) -> (Vec<Job>, BTreeMap<String, Vec<Stamp>>, usize) {
        let (mut jobs, mut all_stamps, mut unchanged) = (Vec::new(), BTreeMap::new(), 0);
        for machine in largest_first(machines) {
            let files = &machines[machine];
            let stamps: Vec<Stamp> = files.iter().map(|file| Stamp::of(file)).collect();
            let entry = manifest.machines.get(machine);
            let has_model = |_: &&Entry| model_of(&self.output, machine).is_file();
            let same = entry
                .filter(|of| of.outcome == Outcome::Fitted && of.by == *maker)
                .filter(has_model);
            if same.is_some_and(|of| of.files == stamps) {
                unchanged += 1;
                continue;
            }
            all_stamps.insert(machine.clone(), stamps);
            jobs.push(Job {
                machine: machine.clone(),
                files: files.clone(),
                task: Task::Fit {
                    created: manifest.created.clone(),
                    known: same.and_then(|of| of.rows.clone()),
                },
            });
        }
        (jobs, all_stamps, unchanged)
    }

    /// Writes what came of a machine.
    fn take(
        &self,
        job: &Job,
        reply: Reply,
        files: Vec<Stamp>,
        maker: &Maker,
        writing: &mut Writing,
        tally: &mut Tally,
    ) -> Result<(), Failure> {
        let machines = &mut writing.manifest.machines;
        let entry = match reply {
            Reply::Fitted(of) => {
                let path = model_of(&self.output, &job.machine);
                write_whole(&path, of.model.as_bytes()).map_err(|error| {
                    Failure::Outside(format!("cannot write {}: {error}", path.display()))
                })?;
                tally.fitted += 1;
                Entry {
                    outcome: Outcome::Fitted,
                    error: None,
                    created: writing.manifest.created.clone(),
                    files,
                    rows: Some(of.rows),
                    by: maker.clone(),
                    scores: of.scores,
                    unfitted: of.unfitted,
                    constant: of.constant,
                    doubts: of.doubts,
                }
            }
            Reply::Same => {
                tally.unchanged += 1;
                let Some(known) = machines.get(&job.machine) else {
                    return Ok(());
                };
                Entry {
                    files,
                    ..known.clone()
                }
            }
            Reply::Evaluated(_) => return Ok(()),
            Reply::Failed { error } => {
                tally.failed.insert(job.machine.clone(), error.clone());
                Entry {
                    outcome: Outcome::Failed,
                    error: Some(error),
                    created: None,
                    files,
                    rows: None,
                    by: maker.clone(),
                    scores: Vec::new(),
                    unfitted: Vec::new(),
                    constant: Vec::new(),
                    doubts: Vec::new(),
                }
            }
        };
        machines.insert(job.machine.clone(), entry);
        writing.is_new = true;
        writing
            .write_soon()
            .map_err(|error| self.not_written(&error))
    }

    fn not_written(&self, error: &std::io::Error) -> Failure {
        let path = Manifest::path_in(&self.output);
        Failure::Outside(format!("cannot write {}: {error}", path.display()))
    }

    fn report(&self, terminal: &Terminal, machines: &Machines, manifest: &Manifest, tally: &Tally) {
        let of_call = machines
            .keys()
            .filter_map(|name| Some((name, manifest.machines.get(name)?)));
        let fitted = of_call.filter(|(_, of)| of.outcome == Outcome::Fitted);
        let figures: BTreeMap<String, Vec<Figure>> = fitted
            .clone()
            .map(|(name, of)| (name.clone(), of.scores.clone()))
            .collect();
        let standings = standings(&figures);
        if terminal.format == Format::Json {
            let of_fitted = standings.iter().map(|of| {
                let mut facts = table::facts(of);
                let entry = &manifest.machines[&of.machine];
                facts["outcome"] = json!(entry.outcome);
                facts["model"] = json!(model_of(&self.output, &of.machine));
                for (key, found) in [
                    ("created", json!(entry.created)),
                    ("rows", json!(entry.rows)),
                    ("unfitted", json!(entry.unfitted)),
                    ("constant", json!(entry.constant)),
                    ("doubts", json!(entry.doubts)),
                ] {
                    facts[key] = found;
                }
                facts
            });
            let failed = tally.failed.iter();
            let failed = failed.map(|(machine, error)| {
                json!({ "machine": machine, "outcome": Outcome::Failed, "error": error })
            });
            println!(
                "{:#}",
                json!({
                    "models": self.output,
                    "graph": self.graph,
                    "fitted": tally.fitted,
                    "unchanged": tally.unchanged,
                    "failed": tally.failed.len(),
                    "machines": failed.chain(of_fitted).collect::<Vec<_>>(),
                })
            );
            return;
        }
        warn_failed(terminal, &tally.failed);
        if terminal.quiet {
            // What the exit status says stands in no table then.
            for (name, of) in fitted.clone() {
                let lacks = remark(&[], lacks(of));
                if !lacks.is_empty() {
                    terminal.warning(format_args!("{name}: {lacks}"));
                }
            }
        }
        if !terminal.quiet && !standings.is_empty() {
            let remarks = fitted.map(|(name, of)| (name.clone(), remark(&of.doubts, lacks(of))));
            athermal_command::print!(
                "{}",
                table::standings(&standings, &remarks.collect(), self.all)
            );
        }
        let others: Vec<String> = manifest
            .machines
            .keys()
            .filter(|name| !machines.contains_key(*name))
            .cloned()
            .collect();
        if !others.is_empty() {
            terminal.note(format_args!(
                "not among the data, and left as they were: {}",
                few(&others)
            ));
        }
        terminal.note(format_args!(
            "{} fitted, {} unchanged, {} failed; models in {}",
            counted(tally.fitted as u64, "machine"),
            tally.unchanged,
            tally.failed.len(),
            self.output.display()
        ));
        if tally.failed.len() < machines.len() {
            terminal.note(format_args!(
                "next: athermal fleet compare {}",
                self.output.display()
            ));
        }
    }
}

/// What a machine's model lacks.
fn lacks(of: &Entry) -> impl Iterator<Item = String> + '_ {
    let unfitted = of.unfitted.iter();
    let unfitted = unfitted.map(|of| format!("{} could not be fitted", of.node));
    unfitted.chain(of.constant.iter().map(|of| format!("{of} is constant")))
}

/// The present time, or the one that a reproducible build names in `SOURCE_DATE_EPOCH`.
fn present() -> Option<String> {
    let stated = std::env::var("SOURCE_DATE_EPOCH").ok();
    let stated = stated.and_then(|text| text.parse().ok());
    let now = || jiff::Timestamp::now().as_second();
    let time = jiff::Timestamp::from_second(stated.unwrap_or_else(now));
    Some(time.ok()?.to_string())
}
