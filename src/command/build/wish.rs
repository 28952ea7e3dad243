//! A crate that is asked for, and whether it is made for this athermal; checked before anything is built.

use std::path::{Path, PathBuf};

use semver::{Version, VersionReq};
use serde_json::Value;

use super::cargo::Cargo;
use crate::checkout::{Checkout, VERSION, in_toml};
use crate::terminal::Failure;

/// A crate that is asked for.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Wish {
    /// From a registry, in this version or the newest that fits.
    Registry {
        package: String,
        version: Option<String>,
    },
    /// From a folder.
    Folder { package: String, folder: PathBuf },
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
        let (package, version) = match text.split_once('@') {
            Some((package, version)) => (package, Some(version)),
            None => (text, None),
        };
        let is_name = !package.is_empty()
            && package
                .chars()
                .all(|c| c.is_ascii_alphanumeric() || "-_".contains(c));
        if !is_name {
            return Err(Failure::Request(format!(
                "`--with {text}` names no crate: write NAME, NAME@VERSION, or path:DIR for a folder"
            )));
        }
        if let Some(version) = version
            && let Err(error) = version.parse::<VersionReq>()
        {
            return Err(Failure::Request(format!(
                "`--with {text}`: `{version}` is no version: {error}"
            )));
        }
        Ok(Self::Registry {
            package: package.to_owned(),
            version: version.map(str::to_owned),
        })
    }

    fn in_folder(folder: &Path) -> Result<Self, Failure> {
        let manifest = folder.join("Cargo.toml");
        let text = std::fs::read_to_string(&manifest).map_err(|error| {
            Failure::Outside(format!(
                "there is no crate in {}: {error}",
                folder.display()
            ))
        })?;
        let manifest_of = toml::from_str::<toml::Table>(&text)
            .map_err(|error| Failure::Request(format!("{}: {error}", manifest.display())))?;
        let name = manifest_of
            .get("package")
            .and_then(|package| package.get("name"));
        let Some(package) = name.and_then(toml::Value::as_str) else {
            return Err(Failure::Request(format!(
                "{} describes no crate with a name",
                manifest.display()
            )));
        };
        Ok(Self::Folder {
            package: package.to_owned(),
            folder: std::fs::canonicalize(folder).unwrap_or_else(|_| folder.to_owned()),
        })
    }

    /// The name of the crate.
    pub(super) fn package(&self) -> &str {
        match self {
            Self::Registry { package, .. } | Self::Folder { package, .. } => package,
        }
    }

    /// Its line in a manifest.
    pub(super) fn dependency(&self) -> String {
        match self {
            Self::Registry { package, version } => {
                let version = version.as_ref().map_or("*".to_owned(), |version| {
                    if version.parse::<Version>().is_ok() {
                        format!("={version}")
                    } else {
                        version.clone()
                    }
                });
                format!("{package} = \"{version}\"")
            }
            Self::Folder { package, folder } => {
                format!("{package} = {{ path = {} }}", in_toml(folder))
            }
        }
    }

    /// Makes sure that a crate in a folder is made for this version of athermal; of others cargo knows. The answer is whether
    /// it asks a registry for the core.
    ///
    /// # Errors
    /// When it is not, with both versions.
    pub(super) fn check(&self, cargo: &Cargo, checkout: &Checkout) -> Result<bool, Failure> {
        let Self::Folder { package, folder } = self else {
            return Ok(true);
        };
        let metadata = cargo.metadata(folder, false)?;
        let all = metadata["packages"].as_array().into_iter().flatten();
        let found = all.filter(|found| found["name"] == package.as_str());
        let found: Vec<&Value> = found.collect();
        without_testkit(found.iter().copied())?;
        let mut dependencies = found
            .into_iter()
            .flat_map(|found| found["dependencies"].as_array().into_iter().flatten());
        let core = dependencies.find(|dependency| {
            dependency["name"] == "athermal-core" && dependency["kind"].is_null()
        });
        let Some(core) = core else {
            return Err(Failure::Request(format!(
                "{package} does not depend on athermal-core, so it can bring no node type and no machine"
            )));
        };
        made_for(package, core, checkout)?;
        Ok(core["path"].is_null())
    }
}

/// The conformance kit is for the tests of a crate: it counts what a program allocates.
///
/// # Errors
/// When a package takes it into programs.
pub(super) fn without_testkit<'a>(
    packages: impl Iterator<Item = &'a Value>,
) -> Result<(), Failure> {
    let brings_it = |dependency: &Value| {
        dependency["name"] == "athermal-testkit"
            && dependency["kind"].is_null()
            && dependency["optional"] != true
    };
    for package in packages {
        let mut dependencies = package["dependencies"].as_array().into_iter().flatten();
        if dependencies.any(brings_it) {
            let name = package["name"].as_str().unwrap_or_default();
            return Err(Failure::Request(format!(
                "{name} has athermal-testkit under `[dependencies]`, which would count every allocation of the program: move it to \
                 `[dev-dependencies]`"
            )));
        }
    }
    Ok(())
}

fn made_for(package: &str, core: &Value, checkout: &Checkout) -> Result<(), Failure> {
    let asked = core["req"].as_str().unwrap_or("*");
    let version = Version::parse(VERSION).map_err(|error| Failure::Outside(error.to_string()))?;
    let fits = asked
        .parse::<VersionReq>()
        .is_ok_and(|asked| asked.matches(&version));
    if !fits {
        return Err(Failure::Request(format!(
            "{package} is made for athermal-core {asked}, and this program is athermal {VERSION}: \
             use a version of it for {VERSION}, or the athermal that it is made for"
        )));
    }
    let ours = checkout.core();
    if let Some(theirs) = core["path"].as_str()
        && std::fs::canonicalize(theirs).ok() != std::fs::canonicalize(&ours).ok()
    {
        return Err(Failure::Request(format!(
            "{package} builds on the athermal-core in {theirs}, and this binary on that in {}: two copies do not know \
             each other's nodes. Change the path in its Cargo.toml, or give `--athermal path:DIR` for the other",
            ours.display()
        )));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn message(result: Result<impl std::fmt::Debug, Failure>) -> String {
        match result {
            Err(Failure::Request(message) | Failure::Outside(message)) => message,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn a_crate_is_named_with_or_without_a_version() {
        let lines = [
            ("drift-nodes", "drift-nodes = \"*\""),
            ("drift-nodes@0.3.1", "drift-nodes = \"=0.3.1\""),
            ("drift-nodes@^0.3", "drift-nodes = \"^0.3\""),
        ];
        for (text, line) in lines {
            assert_eq!(Wish::read(text).unwrap().dependency(), line);
        }
        for wrong in ["", "a b", "@1", "../there", "x@one"] {
            assert!(message(Wish::read(wrong)).contains("`--with"), "{wrong}");
        }
        assert!(message(Wish::read("path:no-such-folder")).contains("no crate in no-such-folder"));
    }

    #[test]
    fn a_crate_for_another_version_is_refused_with_both() {
        let checkout = Checkout::find(None).unwrap();
        let core = json!({ "name": "athermal-core", "req": "^99.1" });
        let told_of = message(made_for("old-nodes", &core, &checkout));
        assert!(
            told_of.contains("made for athermal-core ^99.1"),
            "{told_of}"
        );
        assert!(told_of.contains(VERSION), "{told_of}");
        let there =
            json!({ "name": "athermal-core", "req": "*", "path": env!("CARGO_MANIFEST_DIR") });
        assert!(message(made_for("nodes", &there, &checkout)).contains("two copies"));
        let here = checkout.core();
        let here = json!({ "name": "athermal-core", "req": "*", "path": here });
        assert!(made_for("nodes", &here, &checkout).is_ok());
    }
}
