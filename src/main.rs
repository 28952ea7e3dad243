//! The command line of athermal.

#[macro_use]
mod output;

mod command;
mod drawing;
mod figures;
mod invocation;
mod starter;
mod terminal;

use std::process::ExitCode;

use clap::Parser;

// The plugins that the library links.
use athermal as _;

/// Predicts and corrects the thermal drift of precision machines.
#[derive(Debug, Parser)]
#[command(version, arg_required_else_help = true, max_term_width = 100, after_help = EXAMPLES)]
struct Arguments {
    #[command(subcommand)]
    command: command::Command,
    #[command(flatten)]
    terminal: terminal::Options,
}

const EXAMPLES: &str = "\
Start here:
  athermal demo                                     all of it, on a simulated machine
  athermal init LOG.csv -o graph.toml               a starter graph for a log of yours
  athermal fit graph.toml --data LOG.csv -o model.json
  athermal evaluate model.json --data OTHER.csv
  athermal run model.json --input - --output -      rows in, predictions out

`athermal COMMAND --help` says more, with examples.
Exit status: 0 fine, 1 the answer is no, 2 the request was wrong, 3 something outside failed.";

fn main() -> ExitCode {
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
