//! `athermal new`: something to begin with.

mod plugin;
mod template;

use clap::{Args, Subcommand};

use crate::terminal::{Answer, Failure, Terminal};

/// Begin something of your own: a plugin crate
#[derive(Debug, Args)]
pub struct New {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    Plugin(plugin::Plugin),
}

impl New {
    /// Writes it.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn run(&self, terminal: &Terminal) -> Result<Answer, Failure> {
        match &self.what {
            What::Plugin(plugin) => plugin.run(terminal),
        }
    }
}
