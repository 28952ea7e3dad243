//! `athermal completions`: what a shell needs to complete the commands.

use clap::Args;
use clap_complete::Shell;

use crate::program::whole;
use crate::terminal::{Answer, Failure, Terminal, print};

/// Print a completion script for a shell
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  athermal completions bash \\
      > ~/.local/share/bash-completion/completions/athermal
  athermal completions zsh > ~/.zfunc/_athermal # fpath+=~/.zfunc in ~/.zshrc
  athermal completions fish > ~/.config/fish/completions/athermal.fish")]
pub struct Completions {
    /// The shell
    shell: Shell,
}

impl Completions {
    /// Prints the script that completes a command line.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn run(&self, _: &Terminal) -> Result<Answer, Failure> {
        let mut script = Vec::new();
        clap_complete::generate(self.shell, &mut whole(), "athermal", &mut script);
        print(&script)?;
        Ok(Answer::Fine)
    }
}
