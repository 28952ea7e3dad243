//! The commands, each in a file of its own.

mod aside;
mod beyond;
mod build;
mod check;
mod compare;
mod completions;
mod data;
mod demo;
mod diagnose;
mod diff;
mod doubts;
mod evaluate;
mod explain;
mod faults;
mod fit;
mod init;
mod model;
mod new;
mod nodes;
mod numbers;
mod refused;
mod report;
mod run;
mod schema;
mod scored;
mod show;
mod simulate;
mod test;
mod threads;
mod unread;
mod unscored;

use clap::Subcommand;

use crate::terminal::{Answer, Failure, Terminal};

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    Demo(demo::Demo),
    Init(init::Init),
    Show(show::Show),
    Check(check::Check),
    Explain(explain::Explain),
    Diff(diff::Diff),
    Nodes(nodes::Nodes),
    Fit(fit::Fit),
    Evaluate(evaluate::Evaluate),
    Compare(compare::Compare),
    Diagnose(diagnose::Diagnose),
    Report(report::Report),
    Run(run::Run),
    Simulate(simulate::Simulate),
    Completions(completions::Completions),
    Test(test::Test),
    Schema(schema::Schema),
    New(new::New),
    Build(build::Build),
}

impl Command {
    /// Whether reports beside the result are events for programs: the result is rows.
    #[must_use]
    pub fn tells_programs(&self) -> bool {
        matches!(self, Self::Run(_))
    }

    /// Does what was asked for; `whole` is the command line that it is part of.
    ///
    /// # Errors
    /// When it cannot be done.
    pub fn run(
        &self,
        terminal: &Terminal,
        whole: fn() -> clap::Command,
    ) -> Result<Answer, Failure> {
        match self {
            Self::Demo(command) => command.run(terminal),
            Self::Show(command) => command.run(terminal),
            Self::Init(command) => command.run(terminal),
            Self::Completions(command) => command.run(whole()),
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
