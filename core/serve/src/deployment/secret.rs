//! Texts that do not belong into a file that others read, such as a password, and who logs in with one.

use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::de::Error;
use serde::{Deserialize, Deserializer};

use crate::node::Forms;

/// A text that does not belong into a file that others read.
#[derive(Debug, Clone, PartialEq, Eq, JsonSchema)]
#[schemars(transparent)]
pub struct Secret(SecretPlace);

/// Where a text stands that does not belong into a file that others read.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct SecretPlace {
    /// A file with it, relative to the machine file; blanks and line ends around it do not count.
    #[serde(default)]
    file: Option<PathBuf>,
    /// A variable of the environment with it.
    #[serde(default)]
    env: Option<String>,
}

impl<'de> Deserialize<'de> for Secret {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let place = Forms::new("where it stands, { file = \"…\" } or { env = \"…\" }")
            .text(|_: String| None)
            .table(Some)
            .read(deserializer)?;
        place.map(Self).ok_or_else(|| {
            Error::custom(
                "a secret has no place in a file that others read: write `{ file = \"…\" }` with a file that has it, or \
                 `{ env = \"…\" }` with a variable of the environment",
            )
        })
    }
}

impl Secret {
    /// What stands there; a file is looked for from a folder on.
    ///
    /// # Errors
    /// When it cannot be read, and why.
    pub fn read(&self, folder: &Path) -> Result<String, String> {
        let SecretPlace { file, env } = &self.0;
        match (file, env) {
            (Some(file), None) => {
                let path = folder.join(file);
                let read = std::fs::read_to_string(&path);
                let text =
                    read.map_err(|error| format!("cannot read {}: {error}", path.display()))?;
                Ok(text.trim().to_owned())
            }
            (None, Some(name)) => {
                std::env::var(name).map_err(|_| format!("the environment has no variable `{name}`"))
            }
            _ => Err("a secret is either { file = \"…\" } or { env = \"…\" }".to_owned()),
        }
    }
}

/// Who logs in.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Login {
    /// The name of the user; without it `user` says where it stands.
    #[serde(default)]
    name: Option<String>,
    /// Where the name of the user stands.
    #[serde(default)]
    user: Option<Secret>,
    /// Where the password stands: { file = "…" } or { env = "…" }. It has no place in the machine file itself.
    password: Secret,
}

impl Login {
    /// Name and password; files are looked for from a folder on.
    ///
    /// # Errors
    /// When one of them cannot be read, and why.
    pub fn read(&self, folder: &Path) -> Result<(String, String), String> {
        let name = match (&self.name, &self.user) {
            (Some(name), None) => name.clone(),
            (None, Some(user)) => user.read(folder)?,
            _ => return Err("`login` needs either `name` or `user`".to_owned()),
        };
        Ok((name, self.password.read(folder)?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_password_comes_from_a_file_or_the_environment_and_from_nowhere_else() {
        let folder = std::env::temp_dir();
        let secret = |file: Option<&str>, env: Option<&str>| {
            Secret(SecretPlace {
                file: file.map(PathBuf::from),
                env: env.map(str::to_owned),
            })
        };
        let name = format!("athermal-secret-{}", std::process::id());
        std::fs::write(folder.join(&name), " word \n").unwrap();
        assert_eq!(
            secret(Some(&name), None).read(&folder),
            Ok("word".to_owned())
        );
        std::fs::remove_file(folder.join(&name)).unwrap();
        assert!(secret(Some(&name), None).read(&folder).is_err());
        let path = std::env::var("PATH").unwrap();
        assert_eq!(secret(None, Some("PATH")).read(&folder), Ok(path));
        assert!(secret(None, None).read(&folder).is_err());
        assert!(secret(Some("a"), Some("b")).read(&folder).is_err());
    }

    #[test]
    fn a_password_in_clear_is_refused_with_the_way_to_write_it_and_without_the_password() {
        let read = |of: serde_json::Value| serde_json::from_value::<Login>(of);
        let place = serde_json::json!({ "env": "P" });
        for of in [
            serde_json::json!({ "password": "w0rd" }),
            serde_json::json!({ "user": "w0rd", "password": place }),
        ] {
            let error = read(of).unwrap_err().to_string();
            assert!(error.contains("{ file = \"…\" }"), "{error}");
            assert!(error.contains("{ env = \"…\" }"), "{error}");
            assert!(!error.contains("w0rd"), "{error}");
        }
        assert!(read(serde_json::json!({ "name": "me", "password": place })).is_ok());
        let error = read(serde_json::json!({ "name": "me", "password": 7 })).unwrap_err();
        assert!(error.to_string().contains("{ file = "), "{error}");
    }
}
