//! What the cargo project of a binary with chosen plugins consists of.

use std::fs;
use std::path::Path;

use super::wish::Wish;
use crate::checkout::{Checkout, in_toml};
use crate::terminal::Failure;

/// What every manifest written here begins with, so that no other is written over.
const MARK: &str = "# Written by `athermal build`, which writes it again.\n";

/// The crates of athermal that a plugin may ask a registry for.
const CRATES: [(&str, &str); 7] = [
    ("athermal-core", "core/framework"),
    ("athermal-graph", "core/graph"),
    ("athermal-run", "core/run"),
    ("athermal-serve", "core/serve"),
    ("athermal-trial", "core/trial"),
    ("athermal-testkit", "core/testkit"),
    ("athermal-numerics", "core/numerics"),
];

/// Writes the project into a folder, which is new or has one already. A lock file that is there stays; a new one begins as that of
/// athermal, so that what is common is the same.
///
/// # Errors
/// When the folder holds something else, or cannot be written.
pub(super) fn write(
    folder: &Path,
    wishes: &[Wish],
    checkout: &Checkout,
    vendored: Option<&Path>,
) -> Result<(), Failure> {
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
    let config = vendored.map_or(Ok(String::new()), source)?;
    fs::create_dir_all(folder.join("src")).map_err(failed)?;
    fs::create_dir_all(folder.join(".cargo")).map_err(failed)?;
    for (path, text) in [
        ("Cargo.toml", manifest(wishes, checkout)),
        ("src/main.rs", program(wishes)),
        (".cargo/config.toml", config),
    ] {
        fs::write(folder.join(path), text).map_err(failed)?;
    }
    let lock = folder.join("Cargo.lock");
    if !lock.exists() {
        fs::copy(checkout.folder().join("Cargo.lock"), lock).map_err(failed)?;
    }
    Ok(())
}

/// The manifest. Crates that ask a registry for athermal get the one at hand.
fn manifest(wishes: &[Wish], checkout: &Checkout) -> String {
    let athermal = in_toml(checkout.folder());
    let plugins: String = wishes.iter().map(Wish::dependency).collect();
    let crates = CRATES.map(|(name, folder)| {
        let folder = in_toml(&checkout.folder().join(folder));
        format!("{name} = {{ path = {folder} }}\n")
    });
    let patch = if wishes.iter().any(|wish| wish.asks_registry) {
        format!(
            "# A plugin that asks a registry for athermal gets this one.\n[patch.crates-io]\n{}\n",
            crates.concat()
        )
    } else {
        String::new()
    };
    format!(
        r#"{MARK}[package]
name = "athermal-with-plugins"
version = "0.0.0"
edition = "2024"
publish = false

[[bin]]
name = "athermal"
path = "src/main.rs"

[dependencies]
athermal = {{ path = {athermal} }}
{plugins}
{patch}[workspace]
"#
    )
}

fn program(wishes: &[Wish]) -> String {
    let library = |wish: &Wish| format!("use {} as _;\n", wish.package.replace('-', "_"));
    let uses: String = wishes.iter().map(library).collect();
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
