//! What the cargo project of a binary with chosen plugins consists of.

use std::fs;
use std::path::{Path, PathBuf};

use super::wish::Wish;
use crate::checkout::{Checkout, VERSION, in_toml};
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

/// What a project makes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Product {
    /// The program.
    Program,
    /// The Python package.
    Wheel,
}

impl Product {
    /// What stands in the manifest between the package and the plugins.
    fn target(self, checkout: &Checkout) -> String {
        let at = |folder: &str| in_toml(&checkout.folder().join(folder));
        match self {
            Self::Program => format!(
                "[[bin]]\nname = \"athermal\"\npath = \"src/main.rs\"\n\n[dependencies]\nathermal = {{ path = {} }}\n",
                in_toml(checkout.folder())
            ),
            Self::Wheel => format!(
                "[lib]\ncrate-type = [\"cdylib\"]\n\n[dependencies]\nathermal-python = {{ path = {} }}\n",
                at("python")
            ),
        }
    }

    /// The source, by its place.
    fn source(self, wishes: &[Wish]) -> (&'static str, String) {
        let library = |wish: &Wish| format!("use {} as _;\n", wish.package.replace('-', "_"));
        let uses: String = wishes.iter().map(library).collect();
        let plugins = "A plugin that no code names is left out by the linker.";
        match self {
            Self::Program => (
                "src/main.rs",
                format!(
                    "//! athermal with plugins. {plugins}\n\n{uses}\n\
                     fn main() -> std::process::ExitCode {{\n    athermal::command_line()\n}}\n"
                ),
            ),
            Self::Wheel => (
                "src/lib.rs",
                format!(
                    "//! The Python package with plugins. {plugins}\n\nuse _athermal as _;\n{uses}"
                ),
            ),
        }
    }

    /// Files of the checkout that the project has copies of, with their places there.
    fn copies(self, checkout: &Checkout) -> std::io::Result<Vec<(PathBuf, PathBuf)>> {
        let mut copies = Vec::new();
        if self == Self::Wheel {
            let python = checkout.folder().join("python");
            for name in ["pyproject.toml", "README.md"] {
                copies.push((python.join(name), PathBuf::from(name)));
            }
            for file in fs::read_dir(python.join("athermal"))? {
                let path = file?.path();
                let is_source =
                    |of: &std::ffi::OsStr| ["py", "pyi", "typed"].iter().any(|end| of == *end);
                if let Some(name) = path.file_name()
                    && path.extension().is_some_and(is_source)
                {
                    copies.push((path.clone(), Path::new("athermal").join(name)));
                }
            }
        }
        Ok(copies)
    }
}

/// Writes the project into a folder, which is new or has one already. A lock file that is there stays; a new one begins as that of
/// athermal, so that what is common is the same.
///
/// # Errors
/// When the folder holds something else, or cannot be written.
pub(super) fn write(
    folder: &Path,
    product: Product,
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
        ("Cargo.toml", manifest(product, wishes, checkout)),
        product.source(wishes),
        (".cargo/config.toml", config),
    ] {
        fs::write(folder.join(path), text).map_err(failed)?;
    }
    for (from, to) in product.copies(checkout).map_err(failed)? {
        let to = folder.join(to);
        let copied = to.parent().map_or(Ok(()), fs::create_dir_all);
        copied
            .and_then(|()| fs::copy(from, to).map(drop))
            .map_err(failed)?;
    }
    let lock = folder.join("Cargo.lock");
    if !lock.exists() {
        fs::copy(checkout.folder().join("Cargo.lock"), lock).map_err(failed)?;
    }
    Ok(())
}

/// The manifest. Crates that ask a registry for athermal get the one at hand.
fn manifest(product: Product, wishes: &[Wish], checkout: &Checkout) -> String {
    let target = product.target(checkout);
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
version = "{VERSION}"
edition = "2024"
publish = false

{target}{plugins}
{patch}[workspace]
"#
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
