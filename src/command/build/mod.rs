//! `athermal build`: this program with more plugins in it.

mod cargo;
mod project;
mod wish;

use std::env::consts::{DLL_PREFIX, DLL_SUFFIX, EXE_SUFFIX};
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use clap::Args;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use crate::checkout::{Checkout, VERSION};
use crate::terminal::{Answer, Failure, Format, Terminal};
use athermal::run::live::store::copy_whole;
use cargo::{Cargo, find_maturin, find_python};
use project::Product;
use wish::Wish;

/// Build this program with plugin crates of your choice
///
/// Writes a small cargo project that names the crates, checks that they are made for this version of athermal, and
/// builds it. The project and its lock file stay, so that the same binary can be built again.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  athermal build --with path:room-lag -o athermal-ours
  athermal build --with drift-nodes@0.3.1 --with path:../ours -o athermal-ours
  athermal build --wheel --with path:room-lag -o wheels
  athermal build --with path:room-lag --vendored vendor -o athermal-ours

The last one needs no network; `cargo vendor`, called in the project's folder where there is one, writes such a folder.")]
pub struct Build {
    /// A crate: NAME, NAME@VERSION, or path:DIR
    #[arg(long, required = true, value_name = "CRATE")]
    with: Vec<String>,
    /// The binary; with `--wheel` the folder of the wheel
    #[arg(long, short, value_name = "BINARY")]
    output: PathBuf,
    /// Build the Python package with these crates instead, as a wheel; needs maturin
    #[arg(long)]
    wheel: bool,
    /// The Python that the wheel is built for and asked with, 3.10 or later; by default what `PYO3_PYTHON` names, else `python3`
    #[arg(long, value_name = "PATH", requires = "wheel")]
    python: Option<PathBuf>,
    /// The folder of the cargo project; by default the name of what is built and `-project`
    #[arg(long, value_name = "DIR")]
    project: Option<PathBuf>,
    /// The profile of cargo: `dev` is compiled sooner and runs slower
    #[arg(long, value_name = "NAME", default_value = "release")]
    profile: String,
    /// Take crates from this folder, as `cargo vendor` writes it, and never from a network
    #[arg(long, value_name = "DIR")]
    vendored: Option<PathBuf>,
    /// Never use a network
    #[arg(long)]
    offline: bool,
    /// Where the sources of athermal are, as path:DIR; by default where this program was built
    #[arg(long, value_name = "path:DIR")]
    athermal: Option<String>,
}

impl Build {
    /// Writes the project, checks it and builds it.
    ///
    /// # Errors
    /// When athermal or a crate is not found, they do not go together, or cargo fails.
    pub fn run(&self, terminal: &Terminal) -> Result<Answer, Failure> {
        let checkout = Checkout::find(self.athermal.as_deref())?;
        let cargo = Cargo::new(
            &self.profile,
            self.offline || self.vendored.is_some(),
            terminal.quiet,
        );
        let wishes = self.with.iter().map(|text| Wish::read(text));
        let wishes: Vec<Wish> = wishes.collect::<Result<_, _>>()?;
        let folder = self.folder();
        let mut python = None;
        let product = if self.wheel {
            find_maturin()?;
            python = Some(find_python(self.python.as_deref())?);
            Product::Wheel
        } else {
            Product::Program
        };
        project::write(
            &folder,
            product,
            &wishes,
            &checkout,
            self.vendored.as_deref(),
        )?;
        let resolved = cargo.metadata(&folder)?;
        one_core(&resolved, &wishes)?;
        without_testkit(&resolved)?;
        let target = resolved["target_directory"].as_str().unwrap_or_default();
        let target = Path::new(target).join(cargo.folder());
        let built = match python {
            None => {
                cargo.build(&folder)?;
                Built::Program(target.join(format!("athermal{EXE_SUFFIX}")))
            }
            Some(python) => {
                let into =
                    std::path::absolute(&self.output).unwrap_or_else(|_| self.output.clone());
                cargo.build_wheel(&folder, &into, &python)?;
                Built::Package {
                    folder: folder.clone(),
                    library: target.join(format!("{DLL_PREFIX}athermal_with_plugins{DLL_SUFFIX}")),
                    python,
                }
            }
        };
        let kinds = built.known("nodes", "nodes")?;
        twice("node type", &kinds)?;
        let written = built.known("nodes", "written")?;
        for of in ["state", "predictor"] {
            let of_role = written.iter().filter(|known| known.role == of);
            twice(of, &of_role.cloned().collect::<Vec<_>>())?;
        }
        let machines = built.known("simulate", "machines")?;
        twice("machine", &machines)?;
        if let Built::Program(program) = &built {
            place(program, &self.output)?;
        }
        if terminal.format == Format::Json {
            println!(
                "{:#}",
                json!({ "binary": self.output, "project": folder, "nodes": kinds, "machines": machines })
            );
            return Ok(Answer::Fine);
        }
        println!(
            "{} has {} node types and {} machines",
            self.output.display(),
            kinds.len(),
            machines.len()
        );
        let all = [kinds, machines].concat();
        for Wish { package, .. } in &wishes {
            let version = packages(&resolved, package).next();
            let version = version
                .and_then(|of| of["version"].as_str())
                .unwrap_or_default();
            println!("  from {package} {version}: {}", brought(&all, package));
        }
        terminal.note(format!(
            "its cargo project is {}; keep it, with its Cargo.lock, to build the same again",
            folder.display()
        ));
        Ok(Answer::Fine)
    }

    fn folder(&self) -> PathBuf {
        self.project.clone().unwrap_or_else(|| {
            let mut name = self.output.file_stem().unwrap_or_default().to_owned();
            name.push("-project");
            self.output.with_file_name(name)
        })
    }
}

/// A kind, a machine, or a name under which something is written, of a binary.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Known {
    name: String,
    #[serde(default = "machine")]
    role: String,
    package: String,
    version: String,
}

fn machine() -> String {
    "machine".to_owned()
}

/// What a binary has from a crate.
fn brought(all: &[Known], package: &str) -> String {
    let own = all.iter().filter(|known| known.package == package);
    let own = own.map(|known| format!("{} ({})", known.name, known.role));
    let own: Vec<String> = own.collect();
    if own.is_empty() {
        return "no node type and no machine; they are made known by `athermal_core::register!` and `register_machine!`".to_owned();
    }
    own.join(", ")
}

/// What was built.
#[derive(Debug)]
enum Built {
    /// A program.
    Program(PathBuf),
    /// A Python package.
    Package {
        /// Its folder.
        folder: PathBuf,
        /// The library that belongs into it.
        library: PathBuf,
        /// What runs it.
        python: OsString,
    },
}

impl Built {
    /// What a command lists under a key.
    fn known(&self, command: &str, what: &str) -> Result<Vec<Known>, Failure> {
        let listed = || -> Result<Vec<Known>, std::io::Error> {
            let output = self.called(&[command, "--format", "json"])?;
            let mut listed: Value = serde_json::from_slice(&output.stdout)?;
            Ok(serde_json::from_value(listed[what].take())?)
        };
        let (Self::Program(path) | Self::Package { folder: path, .. }) = self;
        listed().map_err(|error| {
            Failure::Outside(format!(
                "{} was built and cannot list its {what}: {error}",
                path.display()
            ))
        })
    }

    fn called(&self, words: &[&str]) -> Result<Output, std::io::Error> {
        match self {
            Self::Program(program) => Command::new(program.canonicalize()?).args(words).output(),
            Self::Package {
                folder,
                library,
                python,
            } => {
                let beside = folder.join("athermal").join("_athermal.abi3.so");
                std::fs::copy(library, &beside)?;
                let python = Command::new(python)
                    .args(["-m", "athermal"])
                    .args(words)
                    .current_dir(folder)
                    .output();
                std::fs::remove_file(beside)?;
                python
            }
        }
    }
}

/// Refuses a name that two crates use for the same sort of thing.
fn twice(what: &str, all: &[Known]) -> Result<(), Failure> {
    for (nth, known) in all.iter().enumerate() {
        if let Some(other) = all[..nth].iter().find(|other| other.name == known.name) {
            return Err(Failure::Request(format!(
                "the {what} `{}` is in {} {} and in {} {}: a graph could mean either; leave one of them out, or rename it",
                known.name, other.package, other.version, known.package, known.version
            )));
        }
    }
    Ok(())
}

fn packages<'a>(resolved: &'a Value, name: &'a str) -> impl Iterator<Item = &'a Value> + 'a {
    let all = resolved["packages"].as_array().into_iter().flatten();
    all.filter(move |package| package["name"] == name)
}

/// Two copies of the core do not know each other's nodes.
fn one_core(resolved: &Value, wishes: &[Wish]) -> Result<(), Failure> {
    let cores: Vec<String> = packages(resolved, "athermal-core")
        .map(|package| {
            let text = |key: &str| package[key].as_str().unwrap_or_default().to_owned();
            format!("{} in {}", text("version"), text("manifest_path"))
        })
        .collect();
    if cores.len() == 1 {
        return Ok(());
    }
    let with: Vec<_> = wishes.iter().map(|wish| wish.package.as_str()).collect();
    Err(Failure::Request(format!(
        "{} would bring {} copies of athermal-core, which do not know each other's nodes: {}; this program is {VERSION}. \
         Let every crate depend on the same one",
        with.join(" and "),
        cores.len(),
        cores.join(", ")
    )))
}

/// The conformance kit is for the tests of a crate: with its default features it counts what a program allocates.
fn without_testkit(resolved: &Value) -> Result<(), Failure> {
    for package in resolved["packages"].as_array().into_iter().flatten() {
        let mut dependencies = package["dependencies"].as_array().into_iter().flatten();
        let brings_it = dependencies.any(|of| {
            of["name"] == "athermal-testkit"
                && of["kind"].is_null()
                && of["optional"] != true
                && of["uses_default_features"] != false
        });
        if brings_it {
            let name = package["name"].as_str().unwrap_or_default();
            return Err(Failure::Request(format!(
                "{name} has athermal-testkit under `[dependencies]`, which would count every allocation of the program: move it to \
                 `[dev-dependencies]`"
            )));
        }
    }
    Ok(())
}

/// Puts the binary where it was asked for, all at once.
fn place(built: &Path, output: &Path) -> Result<(), Failure> {
    let folder = output.parent().map_or(Ok(()), std::fs::create_dir_all);
    folder
        .and_then(|()| copy_whole(built, output))
        .map_err(|error| {
            Failure::Outside(format!(
                "cannot put {} at {}: {error}",
                built.display(),
                output.display()
            ))
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn known(name: &str, package: &str) -> Known {
        Known {
            name: name.to_owned(),
            role: "feature".to_owned(),
            package: package.to_owned(),
            version: "0.1.0".to_owned(),
        }
    }

    #[test]
    fn two_crates_with_the_same_kind_are_both_named() {
        let of = |package: &str, name: &str| known(name, package);
        assert!(twice("node type", &[of("one", "a"), of("two", "b")]).is_ok());
        let refused = twice(
            "node type",
            &[of("one", "a"), of("one", "b"), of("two", "a")],
        );
        let Err(Failure::Request(message)) = refused else {
            panic!("{refused:?}")
        };
        assert_eq!(
            message,
            "the node type `a` is in one 0.1.0 and in two 0.1.0: a graph could mean either; leave one of them out, or rename it"
        );
    }

    #[test]
    fn two_copies_of_the_core_are_told_with_their_places() {
        let core = |path: &str| json!({ "name": "athermal-core", "version": "0.1.0", "manifest_path": path });
        assert!(one_core(&json!({ "packages": [core("/a")] }), &[]).is_ok());
        let refused = one_core(&json!({ "packages": [core("/a"), core("/b")] }), &[]);
        let Err(Failure::Request(message)) = refused else {
            panic!("{refused:?}")
        };
        assert!(message.contains("0.1.0 in /a, 0.1.0 in /b"), "{message}");
    }
}
