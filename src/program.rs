//! Decides what the command line is made of; each command says what it does.

use std::process::ExitCode;

use clap::Parser;

use crate::{command, terminal};

/// Predicts and corrects the thermal drift of precision machines.
#[derive(Debug, Parser)]
#[command(version, arg_required_else_help = true, max_term_width = 80, after_help = EXAMPLES)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    command: command::Command,
    #[command(flatten)]
    terminal: terminal::Options,
}

const EXAMPLES: &str = "\
Start here:
  athermal demo                         all of it, on a simulated machine
  athermal init LOG.csv -o graph.toml   a starter graph for a log of yours
  athermal fit graph.toml --data LOG.csv -o model.json
  athermal evaluate model.json --data OTHER.csv
  athermal run model.json --input - --output -

`athermal COMMAND --help` says more, with examples.
Exit status: 0 fine, 1 the answer is no, 2 the request was wrong, 3 something outside failed.";

/// The command line of athermal, with every plugin that the program links: all that its `main` has to do.
#[must_use]
pub fn command_line() -> ExitCode {
    let arguments = Arguments::parse();
    let terminal = terminal::Terminal::new(&arguments.terminal);
    match arguments.command.run(&terminal) {
        Ok(answer) => answer.into(),
        Err(failure) => {
            terminal.error(&failure);
            failure.exit_code()
        }
    }
}
