//! `athermal new plugin`: a crate with a node type.

use std::fs;
use std::path::{Path, PathBuf};

use athermal::core::node::kinds;
use clap::Args;
use serde_json::json;

use super::template::{Names, Role, files};
use crate::checkout::{Checkout, VERSION, in_toml};
use crate::invocation::{command, program, quoted};
use crate::terminal::{Answer, Failure, Format, Terminal};

/// Write a crate with a node type of your own
///
/// The crate builds as it is: a node that does something small, its tests, the tests of the rules that every node keeps, and a
/// graph with a test. Change the node into yours and see what the tests say.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  athermal new plugin room-lag
  athermal new plugin my-regression --role estimator")]
pub struct Plugin {
    /// The name of crate and node type: small letters, digits, `-`
    name: String,
    /// What the node is
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
        let core = in_toml(&checkout.core());
        let mut written = Vec::new();
        for (path, text) in files(&names, self.role, &core, VERSION) {
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
                json!({ "folder": folder, "kind": names.kind, "files": written })
            );
        } else {
            terminal.note(next(&folder, &names));
        }
        Ok(Answer::Fine)
    }

    fn names(&self) -> Result<Names, Failure> {
        let name = &self.name;
        let names = Names::of(name).ok_or_else(|| {
            Failure::Request(format!(
                "`{name}` cannot be the name of a crate and a node type: begin with a small letter, go on with small letters, \
                 digits and single `-`"
            ))
        })?;
        if let Some(kind) = kinds()
            .get(names.kind.as_str())
            .and_then(|same| same.first())
        {
            return Err(Failure::Request(format!(
                "there is a node type `{}` already, from {} {}; a second one of the name could not be used beside it",
                kind.name, kind.package, kind.version
            )));
        }
        if names.clash() {
            return Err(Failure::Request(format!(
                "`{name}` means something else already, to Rust or to the traits of nodes; take a name such as `my-{name}`"
            )));
        }
        Ok(names)
    }
}

fn write(path: &Path, text: &str) -> Result<(), Failure> {
    let folder = path.parent().map_or(Ok(()), fs::create_dir_all);
    folder
        .and_then(|()| fs::write(path, text))
        .map_err(|error| Failure::Outside(format!("cannot write {}: {error}", path.display())))
}

fn next(folder: &Path, names: &Names) -> String {
    let program = program();
    let into = command(&["cd", &quoted(&folder.display().to_string())]);
    let build = command(&[&program, "build --with path:. -o target/athermal"]);
    let test = command(&[
        "target/athermal test",
        &format!("graphs/{}.toml", names.package),
    ]);
    format!(
        "wrote {}, with the node type `{}`; test it, build a binary that has it, and use it in a graph:\n{into}\n  cargo test\n{build}\n{test}",
        folder.display(),
        names.kind
    )
}
