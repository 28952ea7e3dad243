//! `athermal completions`: what a shell needs to complete the commands.

use athermal_command::Group;
use clap::Args;
use clap_complete::Shell;

use crate::program::{commands, whole};
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
        let groups = Group::ALL
            .into_iter()
            .flat_map(|of| commands(of).into_iter().map(move |kind| (kind.name, of)));
        let mut grouped = groups.fold(whole(), |whole, (name, group)| {
            whole.mut_subcommand(name, |command| {
                let about = command
                    .get_about()
                    .map_or_else(String::new, ToString::to_string);
                command.about(format!("{} - {about}", group.title()))
            })
        });
        clap_complete::generate(self.shell, &mut grouped, "athermal", &mut script);
        print(&script)?;
        Ok(Answer::Fine)
    }
}
