//! A crate that is asked for. Whether it goes together with others is for cargo to find out.

use std::path::Path;

use semver::{Version, VersionReq};

use crate::checkout::in_toml;
use crate::terminal::Failure;

/// A crate that is asked for.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Wish {
    /// Its name.
    pub(super) package: String,
    /// Where it is from, as it stands behind its name in a manifest.
    source: String,
    /// Whether it asks a registry for athermal.
    pub(super) asks_registry: bool,
}

impl Wish {
    /// Reads `NAME`, `NAME@VERSION` or `path:DIR`.
    ///
    /// # Errors
    /// When it is none of these, or there is no crate in the folder.
    pub(super) fn read(text: &str) -> Result<Self, Failure> {
        if let Some(folder) = text.strip_prefix("path:") {
            return Self::in_folder(Path::new(folder));
        }
        let (package, version) = text.split_once('@').unwrap_or((text, "*"));
        let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_".contains(c);
        if package.is_empty() || !package.chars().all(is_plain) {
            return Err(Failure::Request(format!(
                "`--with {text}` names no crate: write NAME, NAME@VERSION, or path:DIR for a folder"
            )));
        }
        if let Err(error) = version.parse::<VersionReq>() {
            return Err(Failure::Request(format!(
                "`--with {text}`: `{version}` is no version: {error}"
            )));
        }
        // A whole version is that one alone.
        let sign = version.parse::<Version>().map_or("", |_| "=");
        Ok(Self {
            package: package.to_owned(),
            source: format!("\"{sign}{version}\""),
            asks_registry: true,
        })
    }

    fn in_folder(folder: &Path) -> Result<Self, Failure> {
        let path = folder.join("Cargo.toml");
        let text = std::fs::read_to_string(&path).map_err(|error| {
            Failure::Outside(format!(
                "there is no crate in {}: {error}",
                folder.display()
            ))
        })?;
        let manifest = toml::from_str::<toml::Value>(&text)
            .map_err(|error| Failure::Request(format!("{}: {error}", path.display())))?;
        let package = manifest.get("package").and_then(|of| of.get("name"));
        let Some(package) = package.and_then(toml::Value::as_str) else {
            return Err(Failure::Request(format!(
                "{} describes no crate with a name",
                path.display()
            )));
        };
        let core = manifest.get("dependencies");
        let core = core.and_then(|all| all.get("athermal-core"));
        let elsewhere = |of: &toml::Value| {
            ["path", "workspace"]
                .iter()
                .any(|key| of.get(key).is_some())
        };
        let folder = std::fs::canonicalize(folder).unwrap_or_else(|_| folder.to_owned());
        Ok(Self {
            package: package.to_owned(),
            source: format!("{{ path = {} }}", in_toml(&folder)),
            asks_registry: core.is_some_and(|of| !elsewhere(of)),
        })
    }

    /// Its line in a manifest.
    pub(super) fn dependency(&self) -> String {
        format!("{} = {}\n", self.package, self.source)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_crate_is_named_with_or_without_a_version() {
        let lines = [
            ("drift-nodes", "drift-nodes = \"*\"\n"),
            ("drift-nodes@0.3.1", "drift-nodes = \"=0.3.1\"\n"),
            ("drift-nodes@^0.3", "drift-nodes = \"^0.3\"\n"),
        ];
        for (text, line) in lines {
            assert_eq!(Wish::read(text).unwrap().dependency(), line);
        }
        let refused = |text: &str| match Wish::read(text) {
            Err(Failure::Request(message) | Failure::Outside(message)) => message,
            other => panic!("{other:?}"),
        };
        for wrong in ["", "a b", "@1", "../there", "x@one"] {
            assert!(refused(wrong).contains("`--with"), "{wrong}");
        }
        assert!(refused("path:no-such-folder").contains("no crate in no-such-folder"));
    }
}
