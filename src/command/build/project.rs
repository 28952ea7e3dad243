//! What the cargo project of a binary with chosen plugins consists of.

use std::fs;
use std::path::{Path, PathBuf};

use super::wish::Wish;
use crate::checkout::{Checkout, in_toml};
use crate::terminal::Failure;

/// What every manifest written here begins with, so that no other is written over.
const MARK: &str = "# Written by `athermal build`, which writes it again.\n";

/// The project, written.
#[derive(Debug)]
pub(super) struct Project {
    folder: PathBuf,
}

/// The name of the binary in the target folder.
pub(super) fn executable() -> String {
    format!("athermal{}", std::env::consts::EXE_SUFFIX)
}

impl Project {
    /// Writes it into a folder, which is new or has one already. A lock file that is there stays; a new one begins as that of
    /// athermal, so that what is common is the same.
    ///
    /// # Errors
    /// When the folder holds something else, or cannot be written.
    pub(super) fn write(
        folder: &Path,
        manifest: &str,
        wishes: &[Wish],
        checkout: &Checkout,
        vendored: Option<&Path>,
    ) -> Result<Self, Failure> {
        let failed = |error: std::io::Error| {
            Failure::Outside(format!(
                "cannot write the project into {}: {error}",
                folder.display()
            ))
        };
        let there = fs::read_to_string(folder.join("Cargo.toml"));
        if there.is_ok_and(|manifest| !manifest.starts_with(MARK)) {
            return Err(Failure::Request(format!(
                "{} has a Cargo.toml that `athermal build` did not write; name another folder with --project",
                folder.display()
            )));
        }
        fs::create_dir_all(folder.join("src")).map_err(failed)?;
        fs::create_dir_all(folder.join(".cargo")).map_err(failed)?;
        let config = match vendored {
            Some(vendored) => source(vendored)?,
            None => String::new(),
        };
        let files = [
            ("Cargo.toml", manifest.to_owned()),
            ("src/main.rs", program(wishes)),
            (".cargo/config.toml", config),
        ];
        for (path, text) in files {
            fs::write(folder.join(path), text).map_err(failed)?;
        }
        let lock = folder.join("Cargo.lock");
        if !lock.exists() {
            fs::copy(checkout.folder().join("Cargo.lock"), lock).map_err(failed)?;
        }
        Ok(Self {
            folder: folder.to_owned(),
        })
    }

    /// Where it is.
    pub(super) fn folder(&self) -> &Path {
        &self.folder
    }
}

/// The manifest. With `registry`, crates that ask a registry for the core get the one at hand.
pub(super) fn manifest(wishes: &[Wish], checkout: &Checkout, registry: bool) -> String {
    let athermal = in_toml(checkout.folder());
    let crates: String = [
        ("athermal-core", "core/framework"),
        ("athermal-graph", "core/graph"),
        ("athermal-run", "core/run"),
        ("athermal-trial", "core/trial"),
        ("athermal-testkit", "core/testkit"),
        ("athermal-numerics", "core/numerics"),
    ]
    .map(|(name, folder)| {
        format!(
            "{name} = {{ path = {} }}\n",
            in_toml(&checkout.folder().join(folder))
        )
    })
    .concat();
    let plugins: String = wishes.iter().map(|wish| wish.dependency() + "\n").collect();
    let patch = format!(
        "# A plugin that asks a registry for athermal gets this one.\n\
         [patch.crates-io]\n\
         {crates}\n"
    );
    let patch = if registry { patch.as_str() } else { "" };
    format!(
        "{MARK}\
         [package]\n\
         name = \"athermal-with-plugins\"\n\
         version = \"0.0.0\"\n\
         edition = \"2024\"\n\
         publish = false\n\n\
         [[bin]]\n\
         name = \"athermal\"\n\
         path = \"src/main.rs\"\n\n\
         [dependencies]\n\
         athermal = {{ path = {athermal} }}\n\
         {plugins}\n\
         {patch}\
         [workspace]\n"
    )
}

fn program(wishes: &[Wish]) -> String {
    let uses: String = wishes
        .iter()
        .map(|wish| format!("use {} as _;\n", wish.package().replace('-', "_")))
        .collect();
    format!(
        "//! athermal with plugins. A plugin that no code names is left out by the linker.\n\n\
         {uses}\n\
         fn main() -> std::process::ExitCode {{\n    athermal::command_line()\n}}\n"
    )
}

fn source(vendored: &Path) -> Result<String, Failure> {
    let folder = fs::canonicalize(vendored).map_err(|error| {
        Failure::Outside(format!(
            "no vendored crates in {}: {error}",
            vendored.display()
        ))
    })?;
    Ok(format!(
        "[source.crates-io]\nreplace-with = \"vendored\"\n\n[source.vendored]\ndirectory = {}\n",
        in_toml(&folder)
    ))
}
