//! `athermal fleet`: what its commands have in common; each stands in a file of its own.

mod compare;
mod evaluate;
mod fit;
mod pooled;
mod report;
mod table;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use athermal_command::{Answer, Command, Failure, Group, Terminal, numbers, register_command};
use athermal_core::diagnostic::listed;
use athermal_run::model::Model;
use clap::{Args, Subcommand};

use crate::found::{Machines, machines_of};
use crate::pool::Event;
use crate::worker::{words, work};
use athermal_jobs::data::{Data, Reading};

/// Fit, score and compare the machines of a fleet
///
/// Each machine is fitted on its own files. The models stand in a folder, a file for each machine, beside a manifest
/// by which a fit is resumed.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  athermal fleet fit graph.toml --data 'logs/machine=*/*.csv' -o models\n  \
                        athermal fleet evaluate models --data 'new/machine=*/*.csv'\n  \
                        athermal fleet report models -o fleet.html\n  \
                        athermal fleet compare models --plot unlike.svg"
)]
struct Fleet {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    Fit(fit::Fit),
    Evaluate(evaluate::Evaluate),
    Report(report::Report),
    Compare(compare::Compare),
    /// Does jobs that come on standard input, for the other commands
    #[command(hide = true)]
    Worker,
}

impl Command for Fleet {
    const GROUP: Group = Group::Fleet;
    fn run(&self, terminal: &Terminal) -> Result<Answer, Failure> {
        match &self.action {
            Action::Fit(command) => command.run(terminal),
            Action::Evaluate(command) => command.run(terminal),
            Action::Report(command) => command.run(terminal),
            Action::Compare(command) => command.run(terminal),
            Action::Worker => {
                let worked = work(std::io::stdin().lock(), std::io::stdout().lock());
                // Whoever asked has gone.
                worked.map_err(|_| Failure::Exit(3))?;
                Ok(Answer::Fine)
            }
        }
    }
}

register_command!(Fleet, "fleet");

/// How files are given to machines, and how they are read.
#[derive(Debug, Args)]
pub(crate) struct Files {
    /// The key of the folders that name machines: `machine=17`
    #[arg(long, value_name = "KEY", default_value = "machine")]
    by: String,
    #[command(flatten)]
    reading: Reading,
}

impl Files {
    fn machines(&self, given: &[String]) -> Result<Machines, Failure> {
        let machines = machines_of(given, &self.by)
            .map_err(|error| Failure::Request(format!("--data {error}")))?;
        let files = machines.values().flatten().cloned().collect();
        Data::of(files, self.reading.clone()).check_offsets(&[])?;
        Ok(machines)
    }
}

/// How many work, and with how much memory.
#[derive(Debug, Args)]
pub(crate) struct Workers {
    /// Machines at a time, each in a process of its own; 0 takes one for each core
    #[arg(
        long,
        short,
        value_name = "N",
        default_value_t = 0,
        allow_negative_numbers = true,
        value_parser = numbers::read::<usize>("a whole number of machines, 0 for one per core")
    )]
    jobs: usize,
}

impl Workers {
    fn count(&self) -> usize {
        match self.jobs {
            0 => std::thread::available_parallelism().map_or(1, std::num::NonZero::get),
            jobs => jobs,
        }
    }
}

/// A failure of what looks at the pool, or of the pool itself.
pub(crate) struct PoolFailure(Failure);

impl From<Failure> for PoolFailure {
    fn from(failure: Failure) -> Self {
        Self(failure)
    }
}

impl From<std::io::Error> for PoolFailure {
    fn from(error: std::io::Error) -> Self {
        Self(Failure::Outside(format!("cannot work: {error}")))
    }
}

/// Warns of a worker that died.
fn warn_died(terminal: &Terminal, event: &Event) {
    if let Event::Died { machine, how } = event {
        terminal.warning(format_args!(
            "{machine}: its worker {how}; it is tried once more"
        ));
    }
}

/// The machines with the largest files first: the last to end are then small.
fn largest_first(machines: &Machines) -> Vec<&String> {
    let bytes = |files: &Vec<PathBuf>| -> u64 {
        let lengths = files.iter().filter_map(|file| std::fs::metadata(file).ok());
        lengths.map(|of| of.len()).sum()
    };
    let mut sizes: Vec<_> = machines
        .iter()
        .map(|(name, files)| (bytes(files), name))
        .collect();
    sizes.sort_by_key(|of| std::cmp::Reverse(of.0));
    sizes.into_iter().map(|(_, name)| name).collect()
}

/// The file of a machine's model in a folder of models.
fn model_of(folder: &Path, machine: &str) -> PathBuf {
    folder.join(format!("{machine}.json"))
}

/// All models in a folder by their machines, each as something is made of it. What cannot be loaded is warned of.
fn models_in<T: Send>(
    folder: &Path,
    terminal: &Terminal,
    of: impl Fn(Model) -> T + Sync,
) -> Result<BTreeMap<String, T>, Failure> {
    let entries = std::fs::read_dir(folder)
        .map_err(|error| Failure::Outside(format!("cannot read {}: {error}", folder.display())))?;
    let mut names: Vec<String> = Vec::new();
    for entry in entries.flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        if let Some(machine) = name
            .strip_suffix(".json")
            .filter(|of| !of.starts_with(['.', '_']))
        {
            names.push(machine.to_owned());
        }
    }
    names.sort();
    if names.is_empty() {
        let folder = folder.display();
        return Err(Failure::Request(format!(
            "{folder}: there is no model in this folder; `athermal fleet fit GRAPH --data FILES -o {folder}` makes them"
        )));
    }
    let threads = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let pieces = names.chunks(names.len().div_ceil(threads));
    let load = |name: &String| {
        let model = Model::load(model_of(folder, name));
        (name.clone(), model.map(&of).map_err(|error| words(&error)))
    };
    let loaded: Vec<_> = std::thread::scope(|scope| {
        let all: Vec<_> = pieces
            .map(|piece| scope.spawn(move || piece.iter().map(load).collect::<Vec<_>>()))
            .collect();
        all.into_iter()
            .flat_map(|of| {
                of.join()
                    .unwrap_or_else(|panic| std::panic::resume_unwind(panic))
            })
            .collect()
    });
    let mut models = BTreeMap::new();
    for (name, model) in loaded {
        match model {
            Ok(model) => _ = models.insert(name, model),
            Err(error) => terminal.warning(format_args!("{name} is left out: {error}")),
        }
    }
    Ok(models)
}

/// Reports machines that failed, each with its reason.
fn warn_failed(terminal: &Terminal, failed: &BTreeMap<String, String>) {
    for (machine, error) in failed {
        terminal.warning(format_args!("{machine} failed: {error}"));
    }
}

/// Some names for a message.
fn few(names: &[String]) -> String {
    listed(names, 5)
}
