//! The command line as a whole; each command stands in a file of its own.

use std::panic::{self, AssertUnwindSafe, PanicHookInfo};
use std::process::ExitCode;

use athermal::core::diagnostic::{panic_message, panic_text};
use clap::{CommandFactory, Parser};

use crate::terminal::{Answer, Failure, Format};
use crate::{command, terminal};

/// Predicts and corrects the thermal drift of precision machines.
#[derive(Debug, Parser)]
#[command(version, arg_required_else_help = true, max_term_width = 80, after_help = EXAMPLES)]
struct Arguments {
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
Exit status: 0 fine, 1 the answer is no, 2 the request was wrong, 3 something
outside failed, such as reading a file.";

/// The command line of athermal, with every plugin that the program links: all that its `main` has to do.
#[must_use]
pub fn command_line() -> ExitCode {
    let arguments = Arguments::parse();
    let mut terminal = terminal::Terminal::new(&arguments.terminal);
    terminal.events = terminal.format == Format::Json && arguments.command.writes_events();
    report_panics_in_a_line();
    match caught(|| arguments.command.run(&terminal)) {
        Ok(answer) => answer.into(),
        Err(failure) => {
            terminal.error(&failure);
            failure.exit_code()
        }
    }
}

/// The command line, as a shell completes it.
#[must_use]
pub fn whole() -> clap::Command {
    Arguments::command()
}

/// What a command answers, or that code of the program or of a plugin panicked in it.
fn caught(command: impl FnOnce() -> Result<Answer, Failure>) -> Result<Answer, Failure> {
    panic::catch_unwind(AssertUnwindSafe(command)).unwrap_or_else(|panic| {
        Err(Failure::Outside(format!(
            "the program cannot go on: {}; `RUST_BACKTRACE=1` shows the way to it",
            panic_text(&*panic)
        )))
    })
}

/// Reports a panic in one line, unless `RUST_BACKTRACE` asks for the way to it.
fn report_panics_in_a_line() {
    let in_full = panic::take_hook();
    panic::set_hook(Box::new(move |panic| {
        if std::env::var_os("RUST_BACKTRACE").is_some_and(|wanted| wanted != "0") {
            in_full(panic);
        } else {
            eprintln!("{}", in_a_line(panic));
        }
    }));
}

fn in_a_line(panic: &PanicHookInfo<'_>) -> String {
    let message = panic_message(panic.payload());
    match panic.location() {
        Some(place) => format!("panic at {place}: {message}"),
        None => format!("panic: {message}"),
    }
}

#[cfg(test)]
mod tests {
    use clap::{Command, CommandFactory};

    use super::Arguments;
    use crate::terminal::{Answer, Failure};

    /// The error of each argument of a command, and of those inside it, that is given a text instead of what it takes.
    fn refusals(command: &Command, words: &[String]) -> Vec<String> {
        let mut all = Vec::new();
        for argument in command
            .get_arguments()
            .filter_map(|argument| argument.get_long())
        {
            let call = words.iter().cloned().chain([format!("--{argument}=x")]);
            let refused = Arguments::command().try_get_matches_from(call).err();
            all.extend(refused.map(|error| error.to_string()));
        }
        for inner in command.get_subcommands() {
            let words = [words, &[inner.get_name().to_owned()]].concat();
            all.extend(refusals(inner, &words));
        }
        all
    }

    #[test]
    fn a_panic_in_a_command_ends_it_with_a_status_of_its_own() {
        let failed = super::caught(|| panic!("within a plugin"));
        let Err(Failure::Outside(message)) = failed else {
            panic!("{failed:?}")
        };
        assert!(message.contains("RUST_BACKTRACE=1"), "{message}");
        let fine = super::caught(|| Ok(Answer::Fine));
        assert!(matches!(fine, Ok(Answer::Fine)));
    }

    #[test]
    fn what_is_no_number_is_told_in_words_of_the_program() {
        let refusals = refusals(&Arguments::command(), &["athermal".to_owned()]);
        let ours = refusals
            .iter()
            .filter(|message| message.contains("expected ") && message.contains("number"));
        assert!(ours.count() >= 6, "{refusals:#?}");
        for words in [
            "invalid digit",
            "invalid float",
            "non-zero type",
            "from empty string",
        ] {
            let foreign = refusals.iter().find(|message| message.contains(words));
            assert_eq!(foreign, None);
        }
    }
}
