//! `athermal completions`: what a shell needs to complete the commands.

use clap::{Args, CommandFactory};
use clap_complete::Shell;

use crate::terminal::{Answer, Failure, Terminal};

/// Print a completion script for a shell
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  athermal completions bash > ~/.local/share/bash-completion/completions/athermal
  athermal completions zsh > ~/.zfunc/_athermal       # with fpath+=~/.zfunc in ~/.zshrc
  athermal completions fish > ~/.config/fish/completions/athermal.fish")]
pub struct Completions {
    /// The shell
    shell: Shell,
}

impl Completions {
    /// Prints the script.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn run(&self, _terminal: &Terminal) -> Result<Answer, Failure> {
        let mut script = Vec::new();
        let mut command = crate::program::Arguments::command();
        clap_complete::generate(self.shell, &mut command, "athermal", &mut script);
        crate::terminal::print(&script)?;
        Ok(Answer::Fine)
    }
}
