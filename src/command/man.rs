//! `athermal man`: the pages of the manual, from what `--help` shows.

use std::fs;
use std::io::Write as _;
use std::path::PathBuf;

use athermal_command::Group;
use clap::Args;
use clap_mangen::Man as Page;

use crate::program::{commands, whole};
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
        let written = made
            .and_then(|()| clap_mangen::generate_to(whole(), &self.folder))
            .and_then(|()| fs::write(self.folder.join("athermal.1"), program_page()?));
        written.map(|()| Answer::Fine).map_err(|error| {
            Failure::Outside(format!(
                "cannot write manual pages into {}: {error}",
                self.folder.display()
            ))
        })
    }
}

/// The page of the program, with its commands in groups.
fn program_page() -> std::io::Result<Vec<u8>> {
    let (page, mut text) = (Page::new(whole()), Vec::new());
    page.render_title(&mut text)?;
    page.render_name_section(&mut text)?;
    page.render_synopsis_section(&mut text)?;
    page.render_options_section(&mut text)?;
    for group in Group::ALL {
        writeln!(text, ".SH {}", group.title().to_uppercase())?;
        for kind in commands(group) {
            let command = (kind.declare)();
            let about = command
                .get_about()
                .map_or_else(String::new, ToString::to_string);
            writeln!(
                text,
                ".TP\nathermal\\-{}(1)\n{about}",
                kind.name.replace('-', "\\-")
            )?;
        }
    }
    page.render_extra_section(&mut text)?;
    page.render_version_section(&mut text)?;
    Ok(text)
}
