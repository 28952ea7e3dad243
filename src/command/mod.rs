//! Decides which commands there are; each says in a file of its own what it does.

mod build;
mod check;
mod compare;
mod completions;
mod data;
mod demo;
mod diagnose;
mod diff;
mod evaluate;
mod explain;
mod fit;
mod init;
mod new;
mod nodes;
mod parameters;
mod report;
mod run;
mod schema;
mod show;
mod simulate;
mod swap;
mod test;
mod watched;

use clap::Subcommand;

use crate::terminal::{Answer, Failure, Terminal};

/// What the program can do.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// See what athermal does, on a simulated machine
    Demo(demo::Demo),
    /// Write a starter graph for a log of yours
    Init(init::Init),
    /// Show a graph: its plan, or a picture of it
    Show(show::Show),
    /// Look for mistakes in a graph file
    Check(check::Check),
    /// Explain the code of a mistake
    Explain(explain::Explain),
    /// Say what differs in meaning between two graphs or models
    Diff(diff::Diff),
    /// List the node types, or explain one
    Nodes(nodes::Nodes),
    /// Fit a graph's estimators on recorded data
    Fit(fit::Fit),
    /// Score a model's predictions on recorded data
    Evaluate(evaluate::Evaluate),
    /// Fit several graphs on the same data and score them on others, in one table
    Compare(compare::Compare),
    /// Show why a model predicts as well as it does, and what would make it better
    Diagnose(diagnose::Diagnose),
    /// Show what a model is worth on recorded data, as one page
    Report(report::Report),
    /// Run a model: rows in, predictions out
    Run(run::Run),
    /// Write the recording of a simulated machine, or list the machines
    Simulate(simulate::Simulate),
    /// Print a completion script for a shell
    Completions(completions::Completions),
    /// Run the tests that graph files carry
    Test(test::Test),
    /// Write the JSON Schema of graph files, for editors
    Schema(schema::Schema),
    /// Begin something of your own: a plugin crate
    New(new::New),
    /// Build this program with plugin crates of your choice
    Build(build::Build),
}

impl Command {
    /// Does what was asked for.
    ///
    /// # Errors
    /// When it cannot be done.
    pub fn run(&self, terminal: &Terminal) -> Result<Answer, Failure> {
        match self {
            Self::Demo(command) => command.run(terminal),
            Self::Show(command) => command.run(terminal),
            Self::Init(command) => command.run(terminal),
            Self::Completions(command) => command.run(terminal),
            Self::Check(command) => command.run(terminal),
            Self::Explain(command) => command.run(terminal),
            Self::Diff(command) => command.run(terminal),
            Self::Nodes(command) => command.run(terminal),
            Self::Fit(command) => command.run(terminal),
            Self::Evaluate(command) => command.run(terminal),
            Self::Compare(command) => command.run(terminal),
            Self::Diagnose(command) => command.run(terminal),
            Self::Report(command) => command.run(terminal),
            Self::Run(command) => command.run(terminal),
            Self::Simulate(command) => command.run(terminal),
            Self::Test(command) => command.run(terminal),
            Self::Schema(command) => command.run(terminal),
            Self::New(command) => command.run(terminal),
            Self::Build(command) => command.run(terminal),
        }
    }
}
