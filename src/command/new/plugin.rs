//! `athermal new plugin`: a crate with a node type, a source, a sink, a companion or a machine.

use std::fs;
use std::path::{Path, PathBuf};

use athermal::core::node::NodeKind;
use athermal::core::registry::{Sort, all};
use athermal::trial::machine::KnownMachine;
use athermal_command::CommandKind;
use athermal_serve::companion::CompanionKind;
use athermal_serve::connector::{SinkKind, SourceKind};
use clap::Args;
use serde_json::json;

use super::template::{Names, Role, files};
use crate::checkout::{Checkout, VERSION, in_toml};
use crate::invocation::{command, program, quoted};
use crate::terminal::{Answer, Failure, Format, Terminal};

/// Write a crate with a node type, a source, a sink, a companion or a machine of your own
///
/// The crate builds as it is: something small that works, its tests, a graph with a test, and a README with what to do
/// next. A node, a source and a sink come with the tests of the rules that each of them keeps.
/// Change it into yours and run its tests.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  athermal new plugin room-lag
  athermal new plugin my-regression --role estimator
  athermal new plugin our-controller --role source")]
pub struct Plugin {
    /// The name of the crate and of what it brings: small letters, digits, `-` or `_`
    name: String,
    /// What the crate brings
    #[arg(long, value_enum, default_value = "feature")]
    role: Role,
    /// The folder that the crate goes into; by default one of its name, here
    #[arg(long, short, value_name = "FOLDER")]
    output: Option<PathBuf>,
    /// Where the sources of athermal are, as path:DIR; by default where this program was built
    #[arg(long, value_name = "path:DIR")]
    athermal: Option<String>,
}

impl Plugin {
    /// Writes the crate.
    ///
    /// # Errors
    /// When the name is none or taken, athermal is not found, or the folder is not empty.
    pub fn run(&self, terminal: &Terminal) -> Result<Answer, Failure> {
        let names = self.names()?;
        let checkout = Checkout::find(self.athermal.as_deref())?;
        let folder = self
            .output
            .clone()
            .unwrap_or_else(|| PathBuf::from(&self.name));
        let empty = fs::read_dir(&folder).map_or(!folder.exists(), |mut all| all.next().is_none());
        if !empty {
            return Err(Failure::Request(format!(
                "{} is there already and not empty; name another folder with -o",
                folder.display()
            )));
        }
        let of = |folder| in_toml(&checkout.folder().join(folder));
        let words = [
            ("VERSION", VERSION.to_owned()),
            ("CORE", of("core/framework")),
            ("SERVE", of("core/serve")),
            ("INTERFACE", of("plugins/beside/http")),
            ("COMMAND", of("core/command")),
            ("TRIAL", of("core/trial")),
            ("TESTKIT", of("core/testkit")),
        ];
        let mut written = Vec::new();
        for (path, text) in files(&names, self.role, &words) {
            let path = folder.join(path);
            write(&path, &text)?;
            written.push(path);
        }
        // What athermal is built with, so that it is built once.
        let lock = folder.join("Cargo.lock");
        fs::copy(checkout.folder().join("Cargo.lock"), &lock).map_err(|error| {
            Failure::Outside(format!("cannot write {}: {error}", lock.display()))
        })?;
        written.push(lock);
        if terminal.format == Format::Json {
            println!(
                "{:#}",
                json!({
                    "folder": folder,
                    "role": self.role,
                    "kind": self.role.has_kind().then_some(names.kind),
                    "files": written,
                })
            );
        } else {
            terminal.note(next(&folder, &names, self.role));
        }
        Ok(Answer::Fine)
    }

    fn names(&self) -> Result<Names, Failure> {
        let name = &self.name;
        let names = Names::of(name).ok_or_else(|| {
            Failure::Request(format!(
                "`{name}` cannot be the name of a crate and of what it brings: begin with a small letter, go on with small letters, \
                 digits and single `-` or `_`"
            ))
        })?;
        self.free(&names)?;
        Ok(names)
    }

    /// Refuses the name of what this program has already.
    fn free(&self, names: &Names) -> Result<(), Failure> {
        let kind = names.kind.as_str();
        let taken = match self.role {
            Role::Machine => bring::<KnownMachine>(&self.name),
            Role::Source => bring::<SourceKind>(kind),
            Role::Sink => bring::<SinkKind>(kind),
            Role::Companion => {
                bring::<CompanionKind>(kind).or_else(|| bring::<CommandKind>(&self.name))
            }
            _ => bring::<NodeKind>(kind),
        };
        taken.map_or(Ok(()), |taken| Err(Failure::Request(taken)))
    }
}

/// That there is one of the name, where there is.
fn bring<T: Sort>(name: &str) -> Option<String> {
    let taken = all::<T>().find(|of| of.name == name)?;
    Some(format!(
        "there is a {} `{name}` already, from {} {}; a second one of the name could not be used beside it",
        T::ONE,
        taken.package,
        taken.version
    ))
}

fn write(path: &Path, text: &str) -> Result<(), Failure> {
    let folder = path.parent().map_or(Ok(()), fs::create_dir_all);
    folder
        .and_then(|()| fs::write(path, text))
        .map_err(|error| Failure::Outside(format!("cannot write {}: {error}", path.display())))
}

/// What to do with a part of a service.
const SERVE: &str = "build a binary that has it, and serve a graph with it";

/// What was written, and what to type next.
fn next(folder: &Path, names: &Names, role: Role) -> String {
    let Names { package, kind, .. } = names;
    let (brings, then) = match role {
        Role::Feature | Role::Estimator | Role::Combiner => (
            format!("the node type `{kind}`"),
            "build a binary that has it, and use it in a graph",
        ),
        Role::Machine => (
            format!("the machine `{package}`"),
            "build a binary that has it, and try a graph on it",
        ),
        Role::Companion => (format!("the companion of `[{kind}]`"), SERVE),
        Role::Source => (format!("the source `{kind}`"), SERVE),
        Role::Sink => (format!("the sink `{kind}`"), SERVE),
    };
    let graph = format!("graphs/{package}.toml");
    let mut lines = vec![
        command(&["cd", &quoted(&folder.display().to_string())]),
        "  cargo test".to_owned(),
    ];
    let build = "build --with path:. -o target/athermal";
    lines.push(command(&[&program(), build]));
    let tries = match role.is_live() {
        true => "target/athermal serve",
        false => "target/athermal test",
    };
    lines.push(command(&[tries, &graph]));
    format!(
        "wrote {}, with {brings}; test it, {then}:\n{}",
        folder.display(),
        lines.join("\n")
    )
}
