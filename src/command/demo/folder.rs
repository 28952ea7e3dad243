//! Decides into which folder the demo writes: its own, and never over somebody's work.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::super::data::fnv_1a;
use crate::invocation::program;
use crate::terminal::Failure;

/// The file that says which files the demo has written, and with which content.
const MARK: &str = ".athermal-demo.json";

/// A folder that the demo may write into.
#[derive(Debug)]
pub struct Folder {
    path: PathBuf,
    files: Vec<String>,
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
        let own: BTreeMap<String, String> = serde_json::from_str(&mark).unwrap_or_default();
        for file in files {
            let there = path.join(file);
            if let Ok(content) = std::fs::read(&there)
                && own.get(*file) != Some(&fnv_1a(&content))
            {
                let what = if own.contains_key(*file) {
                    "has been changed since a demo wrote it"
                } else {
                    "is not the demo's"
                };
                return Err(Failure::Request(format!(
                    "{} {what} and is left alone; name another folder: {} demo {}-2",
                    there.display(),
                    program(),
                    path.display()
                )));
            }
        }
        Ok(Self {
            path: path.to_owned(),
            files: files.iter().map(|&file| file.to_owned()).collect(),
        })
    }

    /// Remembers what has been written.
    ///
    /// # Errors
    /// When the folder cannot be read or written.
    pub fn close(&mut self) -> Result<(), Failure> {
        let failed = |error: std::io::Error| {
            Failure::Outside(format!("cannot write {}: {error}", self.path.display()))
        };
        let mut own = BTreeMap::new();
        for file in &self.files {
            let content = std::fs::read(self.path.join(file)).map_err(failed)?;
            own.insert(file, fnv_1a(&content));
        }
        let text = serde_json::to_string_pretty(&own).unwrap_or_default();
        std::fs::write(self.path.join(MARK), text + "\n").map_err(failed)
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
    fn a_folder_of_its_own_is_taken_again_until_somebody_works_in_it() {
        let path = fresh("own");
        let mut folder = Folder::open(&path, &["a"]).unwrap();
        std::fs::write(path.join("a"), "demo").unwrap();
        folder.close().unwrap();
        assert!(Folder::open(&path, &["a"]).is_ok());
        std::fs::write(path.join("a"), "mine").unwrap();
        assert!(matches!(
            Folder::open(&path, &["a"]),
            Err(Failure::Request(text)) if text.contains("has been changed")
        ));
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
