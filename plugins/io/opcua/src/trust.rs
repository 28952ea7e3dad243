//! `athermal trust`: which certificates of servers are trusted.

use std::path::{Path, PathBuf};

use athermal_command::{Answer, Command, Failure, Group, Terminal, println};
use athermal_core::compile::Wanted;
use athermal_core::diagnostic::{Diagnostics, Sources};
use athermal_run::model::Model;
use athermal_serve::deployment::Deployment;
use clap::Args;

use crate::certificates::{Certificates, Theirs};

/// Trust the certificate of a server, or list those that are not trusted
///
/// A source or sink that meets a certificate nobody has trusted keeps it and says its fingerprint. Compare that with the fingerprint that
/// the server shows, then trust it by that. There is no way to trust all.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  athermal trust machine.toml\n  athermal trust machine.toml 5d1c0e5f9a3b8c7d6e4f2a1b0c9d8e7f6a5b4c3d"
)]
struct Trust {
    /// A machine file, or the folder with the state of its service
    machine: PathBuf,
    /// The fingerprint; without it those that are not trusted are listed
    fingerprint: Option<String>,
}

athermal_command::register_command!(Trust, "trust");

impl Command for Trust {
    const GROUP: Group = Group::Service;

    fn run(&self, terminal: &Terminal) -> Result<Answer, Failure> {
        let state = match self.machine.is_dir() {
            true => self.machine.clone(),
            false => state_of(&self.machine)?,
        };
        let all = rejected(&state);
        let Some(fingerprint) = &self.fingerprint else {
            for (name, _, theirs) in &all {
                println!("{}  {name}, {}", theirs.fingerprint, theirs.words);
            }
            terminal.note(format_args!("{} certificates are not trusted", all.len()));
            return Ok(Answer::Fine);
        };
        let plain = |of: &str| of.replace([':', ' '], "").to_lowercase();
        let meant = all
            .into_iter()
            .filter(|(.., of)| plain(&of.fingerprint) == plain(fingerprint));
        let meant: Vec<_> = meant.collect();
        if meant.is_empty() {
            return Err(Failure::Request(format!(
                "no certificate that is not trusted has the fingerprint {fingerprint}: `athermal trust {}` lists them",
                self.machine.display()
            )));
        }
        for (name, certificates, theirs) in meant {
            let moved = certificates.trust(&theirs);
            moved.map_err(|why| Failure::Outside(format!("{name}: {why}")))?;
            terminal.note(format_args!(
                "{name} trusts the certificate {}",
                theirs.words
            ));
        }
        Ok(Answer::Fine)
    }
}

fn state_of(machine: &Path) -> Result<PathBuf, Failure> {
    let (mut sources, mut mistakes) = (Sources::new(), Diagnostics::new());
    let model = Model::load_to_fit(machine, Wanted::default(), &mut sources, &mut mistakes);
    let model = model.map_err(|error| Failure::Request(error.to_string()))?;
    let deployment = Deployment::read(&model.graph, &model.plan, &sources, &mut mistakes);
    let deployment =
        deployment.ok_or_else(|| Failure::Request(mistakes.render(&sources, false, 100)))?;
    Ok(deployment.state(machine))
}

/// The certificates that are not trusted, with the names of those that met them.
fn rejected(state: &Path) -> Vec<(String, Certificates, Theirs)> {
    let mut all = Vec::new();
    for (role, folder) in [("source", "sources"), ("sink", "sinks")] {
        let folders = std::fs::read_dir(state.join(folder));
        let mut folders: Vec<_> = folders.into_iter().flatten().flatten().collect();
        folders.sort_by_key(std::fs::DirEntry::file_name);
        for of in folders {
            let name = format!("{role} {}", of.file_name().display());
            let certificates = Certificates::of(&of.path());
            for theirs in certificates.rejected() {
                all.push((name.clone(), certificates.clone(), theirs));
            }
        }
    }
    all
}
