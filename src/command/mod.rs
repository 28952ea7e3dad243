//! The commands, each in a file of its own.

pub(crate) mod aside;
mod build;
mod check;
pub(crate) mod compare;
mod completions;
mod demo;
pub(crate) mod diagnose;
mod diff;
pub(crate) mod evaluate;
mod explain;
pub(crate) mod fit;
pub(crate) mod found;
pub(crate) mod init;
mod man;
mod new;
mod nodes;
mod replay;
pub(crate) mod report;
mod run;
mod schema;
mod serve;
mod show;
pub(crate) mod simulate;
mod test;
mod unread;

use athermal_command::{Command, Group, numbers, register_command};

use crate::terminal::{Answer, Failure, Terminal};

/// The commands of the program: of each where it stands, its name, and its arguments.
macro_rules! commands {
    ($($group:ident: $($name:literal $arguments:ty),+;)*) => {
        $($(
            impl Command for $arguments {
                const GROUP: Group = Group::$group;
                const WRITES_EVENTS: bool = matches!($name.as_bytes(), b"run" | b"serve");

                fn run(&self, terminal: &Terminal) -> Result<Answer, Failure> {
                    <$arguments>::run(self, terminal)
                }
            }

            register_command!($arguments, $name);
        )+)*
    };
}

commands! {
    Begin: "demo" demo::Demo, "init" init::Init, "check" check::Check, "explain" explain::Explain, "test" test::Test;
    Model: "fit" fit::Fit, "evaluate" evaluate::Evaluate, "compare" compare::Compare;
    Look: "show" show::Show, "diff" diff::Diff, "diagnose" diagnose::Diagnose, "report" report::Report, "nodes" nodes::Nodes;
    Run: "run" run::Run, "serve" serve::Serve, "replay" replay::Replay, "simulate" simulate::Simulate;
    Make: "new" new::New, "build" build::Build, "schema" schema::Schema, "completions" completions::Completions, "man" man::Man;
}
