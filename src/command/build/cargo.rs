//! Calling cargo and maturin, and what is reported where one is missing or fails.

use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};

use serde_json::Value;

use crate::terminal::Failure;

/// The cargo of this machine.
#[derive(Debug)]
pub(super) struct Cargo {
    program: OsString,
    profile: String,
    offline: bool,
    quiet: bool,
}

impl Cargo {
    /// One that builds in a profile; with `quiet` it prints errors only.
    pub(super) fn new(profile: &str, offline: bool, quiet: bool) -> Self {
        Self {
            program: std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()),
            profile: profile.to_owned(),
            offline,
            quiet,
        }
    }

    /// The folder of what is built, inside of the target folder.
    pub(super) fn folder(&self) -> &str {
        match &*self.profile {
            "dev" => "debug",
            other => other,
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
        let command = self.command(folder, "build");
        let status = self.in_profile(command);
        let status = status.map_err(|error| self.missing(&error))?;
        built(status, "cargo", folder)
    }

    /// Builds the wheel of the crate in a folder, into another folder, for an interpreter.
    ///
    /// # Errors
    /// When maturin fails.
    pub(super) fn build_wheel(
        &self,
        folder: &Path,
        into: &Path,
        python: &OsStr,
    ) -> Result<(), Failure> {
        let mut command = self.called(&maturin(), folder, "build");
        command.arg("--out").arg(into);
        command.arg("--interpreter").arg(python);
        command.env("PYO3_PYTHON", python);
        let status = self.in_profile(command);
        let status = status.map_err(|error| without_maturin(&error))?;
        built(status, "maturin", folder)
    }

    fn in_profile(&self, mut command: Command) -> std::io::Result<ExitStatus> {
        command.args(["--profile", &self.profile]);
        command.stdout(Stdio::null());
        if self.quiet {
            command.arg("--quiet");
        }
        command.status()
    }

    fn command(&self, folder: &Path, what: &str) -> Command {
        self.called(&self.program, folder, what)
    }

    fn called(&self, program: &OsStr, folder: &Path, what: &str) -> Command {
        let mut command = Command::new(program);
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

fn maturin() -> OsString {
    std::env::var_os("MATURIN").unwrap_or_else(|| "maturin".into())
}

/// Makes sure that maturin is there, before anything is built for it.
///
/// # Errors
/// When it is not.
pub(super) fn find_maturin() -> Result<(), Failure> {
    let mut asked = Command::new(maturin());
    let answer = asked.arg("--version").output();
    answer.map(drop).map_err(|error| without_maturin(&error))
}

/// The interpreter that a wheel is built for: the one that is asked for, else what `PYO3_PYTHON` names, else `python3`.
///
/// # Errors
/// When it is not there, or too old.
pub(super) fn find_python(asked: Option<&Path>) -> Result<OsString, Failure> {
    let of_environment = || std::env::var_os("PYO3_PYTHON").filter(|of| !of.is_empty());
    let python = asked.map(|path| path.as_os_str().to_owned());
    let python = python.or_else(of_environment);
    let python = python.unwrap_or_else(|| "python3".into());
    // The project is built in another folder.
    let python = match Path::new(&python).components().count() {
        2.. => std::path::absolute(&python).map_or(python, PathBuf::into_os_string),
        _ => python,
    };
    let what = "import sys; print(sys.version_info >= (3, 10), sys.version.split()[0])";
    let answer = Command::new(&python).args(["-c", what]).output();
    let shown = python.display();
    let failed = |why: &str| {
        Failure::Outside(format!(
            "`{shown}` is no Python that runs ({why}); name the interpreter that the wheel is for with `--python PATH`"
        ))
    };
    let answer = answer.map_err(|error| failed(&error.to_string()))?;
    let version = String::from_utf8_lossy(&answer.stdout);
    match version.trim().split_once(' ') {
        Some(("True", _)) => Ok(python),
        Some((_, version)) => Err(Failure::Request(format!(
            "`{shown}` is Python {version}, and the package needs 3.10 or later; name another with `--python PATH`"
        ))),
        None => Err(failed(&answer.status.to_string())),
    }
}

fn without_maturin(error: &std::io::Error) -> Failure {
    Failure::Outside(format!(
        "`{}` cannot be run ({error}): it makes wheels; install it with `pip install maturin`",
        maturin().display()
    ))
}

/// What became of a build.
fn built(status: ExitStatus, by: &str, folder: &Path) -> Result<(), Failure> {
    if status.success() {
        return Ok(());
    }
    Err(Failure::Outside(format!(
        "{by} could not build {}; its output stands above",
        folder.display()
    )))
}
