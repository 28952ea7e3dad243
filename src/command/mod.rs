//! Decides which commands there are; each says in a file of its own what it does.

mod check;
mod completions;
mod data;
mod demo;
mod evaluate;
mod fit;
mod nodes;
mod report;
mod run;
mod simulate;
mod swap;

use clap::Subcommand;

use crate::terminal::{Answer, Failure, Terminal};

/// What the program can do.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// See what athermal does, on a simulated machine
    Demo(demo::Demo),
    /// Look for mistakes in a graph file
    Check(check::Check),
    /// List the node types, or explain one
    Nodes(nodes::Nodes),
    /// Fit a graph's estimators on recorded data
    Fit(fit::Fit),
    /// Score a model's predictions on recorded data
    Evaluate(evaluate::Evaluate),
    /// Show what a model is worth on recorded data, as one page
    Report(report::Report),
    /// Run a model: rows in, predictions out
    Run(run::Run),
    /// Write the recording of a simulated machine, or list the machines
    Simulate(simulate::Simulate),
    /// Print a completion script for a shell
    Completions(completions::Completions),
}

impl Command {
    /// Does what was asked for.
    ///
    /// # Errors
    /// When it cannot be done.
    pub fn run(&self, terminal: &Terminal) -> Result<Answer, Failure> {
        match self {
            Self::Demo(command) => command.run(terminal),
            Self::Completions(command) => command.run(terminal),
            Self::Check(command) => command.run(terminal),
            Self::Nodes(command) => command.run(terminal),
            Self::Fit(command) => command.run(terminal),
            Self::Evaluate(command) => command.run(terminal),
            Self::Report(command) => command.run(terminal),
            Self::Run(command) => command.run(terminal),
            Self::Simulate(command) => command.run(terminal),
        }
    }
}
