//! Commands that crates bring.

use athermal_core::registry::Sort;
use clap::{ArgMatches, Args};

use crate::terminal::{Answer, Failure, Terminal};

/// Where a command stands among others: what it is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Group {
    /// The first steps with a log.
    Begin,
    /// From a graph to a model, and what it is worth.
    Model,
    /// What a graph, a model or a program has.
    Look,
    /// Rows in, predictions out.
    Run,
    /// A service at work.
    Service,
    /// Many machines.
    Fleet,
    /// What others make use of: files for controllers, editors and shells, plugin crates.
    Make,
}

impl Group {
    /// All of them, in order.
    pub const ALL: [Self; 7] = [
        Self::Begin,
        Self::Model,
        Self::Look,
        Self::Run,
        Self::Service,
        Self::Fleet,
        Self::Make,
    ];

    /// What stands above its commands.
    #[must_use]
    pub fn title(self) -> &'static str {
        match self {
            Self::Begin => "Begin",
            Self::Model => "Models",
            Self::Look => "Look",
            Self::Run => "Run",
            Self::Service => "Services",
            Self::Fleet => "Fleets",
            Self::Make => "Make",
        }
    }
}

/// A command. Its doc comment is what `--help` shows.
pub trait Command: Args {
    /// Where it stands among others.
    const GROUP: Group;
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
    /// Where it stands among others.
    pub group: Group,
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
                group: <$command as $crate::Command>::GROUP,
                run: $crate::run::<$command>,
                writes_events: <$command as $crate::Command>::WRITES_EVENTS,
            }
        );
    };
}
