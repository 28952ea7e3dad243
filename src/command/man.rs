//! `athermal man`: the pages of the manual, from what `--help` shows.

use std::fs;
use std::path::PathBuf;

use clap::Args;

use crate::program::whole;
use crate::terminal::{Answer, Failure, Terminal};

/// Write the manual pages of all commands into a folder
#[derive(Debug, Args)]
#[command(after_help = "Example:
  athermal man ~/.local/share/man/man1 && man athermal-fit")]
pub struct Man {
    /// The folder, which is made where it is not there
    folder: PathBuf,
}

impl Man {
    /// Writes a page of the program and one of each command.
    ///
    /// # Errors
    /// When the folder cannot be written.
    pub fn run(&self, _: &Terminal) -> Result<Answer, Failure> {
        let made = fs::create_dir_all(&self.folder);
        let written = made.and_then(|()| clap_mangen::generate_to(whole(), &self.folder));
        written.map(|()| Answer::Fine).map_err(|error| {
            Failure::Outside(format!(
                "cannot write manual pages into {}: {error}",
                self.folder.display()
            ))
        })
    }
}
