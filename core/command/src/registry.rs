//! Commands that crates bring.

use athermal_core::registry::Sort;
use clap::{ArgMatches, Args};

use crate::terminal::{Answer, Failure, Terminal};

/// A command. Its doc comment is what `--help` shows.
pub trait Command: Args {
    /// Whether reports beside the result are events for programs under `--format json`, as where the result is rows.
    const WRITES_EVENTS: bool = false;

    /// Does what was asked for.
    ///
    /// # Errors
    /// When it cannot be done.
    fn run(&self, terminal: &Terminal) -> Result<Answer, Failure>;
}

/// A command, by its name on the command line.
#[derive(Debug)]
pub struct CommandKind {
    /// Its arguments and their help.
    pub declare: fn() -> clap::Command,
    /// Does what was asked for.
    pub run: fn(&ArgMatches, &Terminal) -> Result<Answer, Failure>,
    /// Whether reports beside the result are events for programs.
    pub writes_events: bool,
}

impl Sort for CommandKind {
    const ONE: &'static str = "command";
    const MANY: &'static str = "commands";
}

/// The arguments of a command; [`register_command!`](crate::register_command) makes use of it.
#[doc(hidden)]
#[must_use]
pub fn declare<C: Command>(name: &'static str) -> clap::Command {
    C::augment_args(clap::Command::new(name))
}

/// Does what a command line asks for; [`register_command!`](crate::register_command) makes use of it.
#[doc(hidden)]
pub fn run<C: Command>(matches: &ArgMatches, terminal: &Terminal) -> Result<Answer, Failure> {
    let command = C::from_arg_matches(matches);
    let command = command.map_err(|error| Failure::Request(error.to_string()))?;
    command.run(terminal)
}

/// Makes a command known: the type of its arguments, which implements [`Command`](crate::Command), and its name.
#[macro_export]
macro_rules! register_command {
    ($command:ty, $name:literal) => {
        $crate::__private::list!(
            $crate::CommandKind,
            $name,
            $crate::__private::no_schema,
            $crate::CommandKind {
                declare: || $crate::declare::<$command>($name),
                run: $crate::run::<$command>,
                writes_events: <$command as $crate::Command>::WRITES_EVENTS,
            }
        );
    };
}
