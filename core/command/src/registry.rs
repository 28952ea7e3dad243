//! Commands that crates bring.

use std::collections::BTreeMap;
use std::sync::OnceLock;

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

/// A command, as registered.
#[derive(Debug)]
pub struct CommandKind {
    /// What a command line says.
    pub name: &'static str,
    /// The crate that brings it.
    pub package: &'static str,
    /// Its arguments and their help.
    pub declare: fn() -> clap::Command,
    /// Does what was asked for.
    pub run: fn(&ArgMatches, &Terminal) -> Result<Answer, Failure>,
    /// Whether reports beside the result are events for programs.
    pub writes_events: bool,
}

inventory::collect!(CommandKind);

/// All commands that crates bring, by name.
pub fn kinds() -> &'static BTreeMap<&'static str, &'static CommandKind> {
    static KINDS: OnceLock<BTreeMap<&'static str, &'static CommandKind>> = OnceLock::new();
    KINDS.get_or_init(|| {
        let all = inventory::iter::<CommandKind>.into_iter();
        all.map(|kind| (kind.name, kind)).collect()
    })
}

/// The command of a name, if a crate brings it.
#[must_use]
pub fn kind(name: &str) -> Option<&'static CommandKind> {
    kinds().get(name).copied()
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
        $crate::__private::inventory::submit! {
            $crate::CommandKind {
                name: $name,
                package: env!("CARGO_PKG_NAME"),
                declare: || $crate::declare::<$command>($name),
                run: $crate::run::<$command>,
                writes_events: <$command as $crate::Command>::WRITES_EVENTS,
            }
        }
    };
}
