//! The folder that the demo writes into: its own, and never over somebody's work.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::super::aside::write_aside;
use athermal::run::model::content_of;

use crate::invocation::{program, quoted};
use crate::terminal::Failure;

/// The file that lists the files that the demo has written, with their checksums.
const MARK: &str = ".athermal-demo.json";

/// A folder that the demo may write into.
#[derive(Debug)]
pub struct Folder {
    path: PathBuf,
    /// The checksum of each file that the demo has written; none while it does.
    own: BTreeMap<String, Option<String>>,
}

impl Folder {
    /// Makes the folder, or takes it again if nothing in the way has been changed since the demo wrote it.
    ///
    /// # Errors
    /// When a file that would be written is not as the demo has left it, or the folder cannot be made.
    pub fn open(path: &Path, files: &[&str]) -> Result<Self, Failure> {
        std::fs::create_dir_all(path).map_err(|error| {
            Failure::Outside(format!("cannot make {}: {error}", path.display()))
        })?;
        let mark = std::fs::read_to_string(path.join(MARK)).unwrap_or_default();
        let own: BTreeMap<String, Option<String>> = serde_json::from_str(&mark).unwrap_or_default();
        for file in files {
            let there = path.join(file);
            let left = |(_, hash)| match own.get(*file) {
                // A demo that was stopped has left it.
                Some(None) => true,
                Some(Some(written)) => *written == hash,
                None => false,
            };
            if content_of(&there).is_ok_and(|content| !left(content)) {
                let what = if own.contains_key(*file) {
                    "has been changed since a demo wrote it"
                } else {
                    "is not the demo's"
                };
                // Without the `/` that it may end with.
                let bare: PathBuf = path.components().collect();
                return Err(Failure::Request(format!(
                    "{} {what} and is left alone; name another folder: {} demo {}",
                    there.display(),
                    program(),
                    quoted(&format!("{}-2", bare.display()))
                )));
            }
        }
        Ok(Self {
            path: path.to_owned(),
            own,
        })
    }

    /// Writes a file, and remembers what has been written.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn write<T>(
        &mut self,
        file: &str,
        make: impl FnOnce(&Path) -> Result<T, Failure>,
    ) -> Result<T, Failure> {
        let path = self.path.join(file);
        self.remember(file, None)?;
        let made = make(&path)?;
        let (_, hash) = content_of(&path).map_err(|error| {
            Failure::Outside(format!("cannot read {}: {error}", path.display()))
        })?;
        self.remember(file, Some(hash))?;
        Ok(made)
    }

    fn remember(&mut self, file: &str, hash: Option<String>) -> Result<(), Failure> {
        self.own.insert(file.to_owned(), hash);
        let text = serde_json::to_string_pretty(&self.own).unwrap_or_default();
        write_aside(&self.path.join(MARK), text + "\n")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fresh(name: &str) -> PathBuf {
        let path = std::env::temp_dir().join(format!("athermal-{}-{name}", std::process::id()));
        let _ = std::fs::remove_dir_all(&path);
        path
    }

    #[test]
    fn another_folder_is_named_so_that_the_command_can_be_typed() {
        let path = fresh("my demo/");
        std::fs::create_dir_all(&path).unwrap();
        std::fs::write(path.join("a"), "mine").unwrap();
        let refused = Folder::open(&path, &["a"]);
        let bare = path.display().to_string();
        let advice = format!("demo '{}-2'", bare.trim_end_matches('/'));
        assert!(
            matches!(&refused, Err(Failure::Request(text)) if text.ends_with(&advice)),
            "{refused:?}"
        );
        std::fs::remove_dir_all(&path).unwrap();
    }

    #[test]
    fn a_folder_of_its_own_is_taken_again_until_somebody_works_in_it() {
        let path = fresh("own");
        let mut folder = Folder::open(&path, &["a"]).unwrap();
        let written = |folder: &mut Folder| folder.write("a", |path| write_aside(path, "demo"));
        written(&mut folder).unwrap();
        assert!(Folder::open(&path, &["a"]).is_ok());
        std::fs::write(path.join("a"), "mine").unwrap();
        assert!(matches!(
            Folder::open(&path, &["a"]),
            Err(Failure::Request(text)) if text.contains("has been changed")
        ));
        std::fs::remove_dir_all(&path).unwrap();
    }

    #[test]
    fn what_a_demo_that_was_stopped_has_left_is_its_own() {
        let path = fresh("stopped");
        let mut folder = Folder::open(&path, &["a", "b"]).unwrap();
        let stopped = folder.write("a", |path| {
            write_aside(path, "half")?;
            Err::<(), _>(Failure::Exit(1))
        });
        assert!(stopped.is_err());
        assert!(Folder::open(&path, &["a", "b"]).is_ok());
        std::fs::write(path.join("b"), "mine").unwrap();
        assert!(Folder::open(&path, &["a", "b"]).is_err());
        std::fs::remove_dir_all(&path).unwrap();
    }

    #[test]
    fn a_file_of_somebody_is_left_alone() {
        let path = fresh("foreign");
        std::fs::create_dir_all(&path).unwrap();
        std::fs::write(path.join("a"), "mine").unwrap();
        let refused = Folder::open(&path, &["a"]).unwrap_err();
        assert!(matches!(refused, Failure::Request(text) if text.contains("is not the demo's")));
        std::fs::remove_dir_all(&path).unwrap();
    }
}
