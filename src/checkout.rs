//! The sources of athermal that other crates build on; they are not on a registry yet.

use std::path::{Path, PathBuf};

use crate::terminal::Failure;

/// A folder with the sources of athermal.
#[derive(Debug)]
pub struct Checkout {
    folder: PathBuf,
}

impl Checkout {
    /// The folder given as `path:DIR`, else the one that this program was built in.
    ///
    /// # Errors
    /// When athermal is not there, or in another version than this program.
    pub fn find(stated: Option<&str>) -> Result<Self, Failure> {
        let folder = match stated {
            None => PathBuf::from(env!("CARGO_MANIFEST_DIR")),
            Some(stated) => match stated.strip_prefix("path:") {
                Some(folder) => PathBuf::from(folder),
                None => {
                    return Err(Failure::Request(format!(
                        "`--athermal {stated}` names no folder: give the folder of the sources as path:DIR"
                    )));
                }
            },
        };
        let core = folder.join("core/framework/Cargo.toml");
        if !core.is_file() || !folder.join("Cargo.toml").is_file() {
            let whose = match stated {
                None => "the sources that this program was built from are not",
                Some(_) => "athermal is not",
            };
            return Err(Failure::Outside(format!(
                "{whose} in {}: athermal is not on crates.io yet, so name the folder of its sources with `--athermal path:DIR` \
                 (a checkout of version {VERSION})",
                folder.display()
            )));
        }
        let folder = std::fs::canonicalize(&folder).unwrap_or(folder);
        let checkout = Self { folder };
        let found = checkout.version();
        if found.as_deref() == Some(VERSION) {
            return Ok(checkout);
        }
        Err(Failure::Request(format!(
            "{} has athermal {}, and this program is {VERSION}: check out the same version, or use the program built there",
            checkout.folder.display(),
            found.unwrap_or_else(|| "without a version".to_owned())
        )))
    }

    /// The folder.
    #[must_use]
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The version that the workspace states.
    fn version(&self) -> Option<String> {
        let manifest = std::fs::read_to_string(self.folder.join("Cargo.toml")).ok()?;
        let manifest: toml::Table = toml::from_str(&manifest).ok()?;
        let version = manifest.get("workspace")?.get("package")?.get("version")?;
        version.as_str().map(str::to_owned)
    }
}

/// The version of this program.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");

/// A path as it stands in a manifest.
#[must_use]
pub fn in_toml(path: &Path) -> String {
    toml::Value::String(path.display().to_string()).to_string()
}
