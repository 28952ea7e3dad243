//! The command line of athermal.

mod command;
mod figures;
mod terminal;

use std::process::ExitCode;

use clap::Parser;

// The plugins that the library links.
use athermal as _;

/// Predicts and corrects the thermal drift of precision machines.
#[derive(Debug, Parser)]
#[command(version, arg_required_else_help = true, max_term_width = 100)]
struct Arguments {
    #[command(subcommand)]
    command: command::Command,
    #[command(flatten)]
    terminal: terminal::Options,
}

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
