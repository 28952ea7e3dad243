//! What a command of the command line is, how it speaks to people and programs, and how a crate brings one.
//!
//! A command is a struct of [`clap`] arguments that implements [`Command`]. A plugin crate makes it known with
//! [`register_command!`], and it stands among the others:
//!
//! ```
//! use athermal_command::{Answer, Command, Failure, Group, Terminal, println};
//! use clap::Args;
//!
//! /// Say how many windows a period has
//! #[derive(Debug, Args)]
//! struct Windows {
//!     /// The period, in minutes
//!     minutes: u32,
//! }
//!
//! impl Command for Windows {
//!     const GROUP: Group = Group::Look;
//!
//!     fn run(&self, _: &Terminal) -> Result<Answer, Failure> {
//!         println!("{}", self.minutes / 5);
//!         Ok(Answer::Fine)
//!     }
//! }
//!
//! athermal_command::register_command!(Windows, "windows");
//! # let kind = athermal_core::registry::find::<athermal_command::CommandKind>("windows").expect("it is registered");
//! # assert!((kind.declare)().try_get_matches_from(["windows", "15"]).is_ok());
//! ```

mod browse;
pub mod numbers;
#[macro_use]
pub mod output;
mod registry;
pub mod terminal;

pub use athermal_core::message::{self, Message};
pub use athermal_run::live::monitor::words as findings;
pub use browse::{Browse, Browsed, Scheme, browse};
pub use registry::{Command, CommandKind, Group, declare, run};
pub use terminal::{Answer, Failure, Format, Terminal};

/// What the macros of this crate use.
#[doc(hidden)]
pub mod __private {
    pub use athermal_core::__private::{list, no_schema};
}
