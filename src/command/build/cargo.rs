//! Calling cargo, and what is reported where it is missing or fails.

use std::ffi::OsString;
use std::path::Path;
use std::process::{Command, Stdio};

use serde_json::Value;

use crate::terminal::Failure;

/// The cargo of this machine.
#[derive(Debug)]
pub(super) struct Cargo {
    program: OsString,
    offline: bool,
    quiet: bool,
}

impl Cargo {
    /// With `quiet` it prints errors only.
    pub(super) fn new(offline: bool, quiet: bool) -> Self {
        Self {
            program: std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()),
            offline,
            quiet,
        }
    }

    /// What cargo knows of the crate in a folder and of all that it depends on.
    ///
    /// # Errors
    /// When cargo is not there, or the crates cannot be put together.
    pub(super) fn metadata(&self, folder: &Path) -> Result<Value, Failure> {
        let mut command = self.command(folder, "metadata");
        command.args(["--format-version", "1"]);
        if let Some(host) = self.host() {
            // Else cargo wants the crates of all platforms, which no build here has downloaded.
            command.args(["--filter-platform", &host]);
        }
        let output = command.output().map_err(|error| self.missing(&error))?;
        if !output.status.success() {
            let reason = String::from_utf8_lossy(&output.stderr);
            let reason = reason.trim().trim_start_matches("error: ");
            return Err(Failure::Outside(format!(
                "cargo cannot put the crates of {} together: {reason}",
                folder.display()
            )));
        }
        serde_json::from_slice(&output.stdout)
            .map_err(|error| Failure::Outside(format!("cargo metadata is no JSON: {error}")))
    }

    /// The platform of this machine, as cargo calls it.
    fn host(&self) -> Option<String> {
        let output = Command::new(&self.program).arg("-vV").output().ok()?;
        let version = String::from_utf8(output.stdout).ok()?;
        let mut lines = version.lines();
        lines.find_map(|line| Some(line.strip_prefix("host: ")?.to_owned()))
    }

    /// Builds the crate in a folder; cargo shows its own progress, unless it is to be quiet.
    ///
    /// # Errors
    /// When cargo is not there or fails.
    pub(super) fn build(&self, folder: &Path) -> Result<(), Failure> {
        let mut command = self.command(folder, "build");
        command.arg("--release").stdout(Stdio::null());
        if self.quiet {
            command.arg("--quiet");
        }
        let status = command.status().map_err(|error| self.missing(&error))?;
        if status.success() {
            return Ok(());
        }
        Err(Failure::Outside(format!(
            "cargo could not build {}; its output stands above",
            folder.display()
        )))
    }

    fn command(&self, folder: &Path, what: &str) -> Command {
        let mut command = Command::new(&self.program);
        command.arg(what).current_dir(folder);
        if self.offline {
            command.arg("--offline");
        }
        command
    }

    fn missing(&self, error: &std::io::Error) -> Failure {
        Failure::Outside(format!(
            "`{}` cannot be run ({error}): building needs a Rust toolchain, see https://rustup.rs",
            self.program.display()
        ))
    }
}
