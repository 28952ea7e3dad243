//! The commands, each in a file of its own.

pub(crate) mod aside;
pub(crate) mod beyond;
mod build;
mod check;
pub(crate) mod compare;
mod completions;
pub(crate) mod data;
mod demo;
pub(crate) mod diagnose;
mod diff;
pub(crate) mod doubts;
pub(crate) mod evaluate;
mod explain;
pub(crate) mod faults;
pub(crate) mod fit;
mod fit_blocks;
pub(crate) mod found;
pub(crate) mod init;
mod man;
pub(crate) mod mistaken;
pub(crate) mod model;
mod new;
mod nodes;
mod refused;
mod replay;
pub(crate) mod report;
mod run;
mod schema;
mod scored;
mod serve;
mod show;
pub(crate) mod simulate;
mod test;
mod thinned;
mod threads;
mod unread;
mod unscored;

use athermal_command::numbers;
use clap::Subcommand;

use crate::terminal::{Answer, Failure, Terminal};

/// The commands: a variant of each, and its call.
macro_rules! commands {
    ($($name:ident($arguments:ty)),* $(,)?) => {
        /// The commands.
        #[derive(Debug, Subcommand)]
        pub enum Command {
            $($name($arguments)),*
        }

        impl Command {
            /// Does what was asked for.
            ///
            /// # Errors
            /// When it cannot be done.
            pub fn run(&self, terminal: &Terminal) -> Result<Answer, Failure> {
                match self {
                    $(Self::$name(command) => command.run(terminal)),*
                }
            }
        }
    };
}

commands! {
    Demo(demo::Demo), Init(init::Init), Show(show::Show), Check(check::Check),
    Explain(explain::Explain), Diff(diff::Diff), Nodes(nodes::Nodes), Fit(fit::Fit),
    Evaluate(evaluate::Evaluate), Compare(compare::Compare), Diagnose(diagnose::Diagnose),
    Report(report::Report), Run(run::Run), Serve(serve::Serve), Replay(replay::Replay), Simulate(simulate::Simulate),
    Completions(completions::Completions), Man(man::Man), Test(test::Test), Schema(schema::Schema),
    New(new::New), Build(build::Build),
}

impl Command {
    /// Whether reports beside the result are events for programs: the result is rows.
    #[must_use]
    pub fn writes_events(&self) -> bool {
        matches!(self, Self::Run(_) | Self::Serve(_))
    }
}
