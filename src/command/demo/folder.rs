//! The folder that the demo writes into: its own, and never over somebody's work.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::super::aside::write_aside;
use athermal::run::model::content_of;

use crate::invocation::{program, quoted};
use crate::terminal::Failure;

/// The file that lists the files that the demo has written, with their checksums.
const MARK: &str = ".athermal-demo.json";

/// Makes the folder, or takes it again if no file in the way has been changed since a demo wrote it.
///
/// # Errors
/// When a file that would be written is not as a demo has left it, or the folder cannot be made.
pub fn open(path: &Path, files: &[&str]) -> Result<(), Failure> {
    std::fs::create_dir_all(path)
        .map_err(|error| Failure::Outside(format!("cannot make {}: {error}", path.display())))?;
    let mark = std::fs::read_to_string(path.join(MARK)).unwrap_or_default();
    let own: BTreeMap<String, String> = serde_json::from_str(&mark).unwrap_or_default();
    for file in files {
        let there = path.join(file);
        let what = match (content_of(&there), own.get(*file)) {
            (Ok((_, hash)), Some(written)) if hash != *written => {
                "has been changed since a demo wrote it"
            }
            (Ok(_), None) => "is not the demo's",
            _ => continue,
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
    Ok(())
}

/// Remembers the files as the demo has written them.
///
/// # Errors
/// When one cannot be read, or that cannot be written.
pub fn mark(path: &Path, files: &[&str]) -> Result<(), Failure> {
    let mut own = BTreeMap::new();
    for file in files {
        let there = path.join(file);
        let (_, hash) = content_of(&there).map_err(|error| {
            Failure::Outside(format!("cannot read {}: {error}", there.display()))
        })?;
        own.insert(file, hash);
    }
    let text = serde_json::to_string_pretty(&own).unwrap_or_default();
    write_aside(&path.join(MARK), text + "\n")
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
        let refused = open(&path, &["a"]);
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
        open(&path, &["a"]).unwrap();
        write_aside(&path.join("a"), "demo").unwrap();
        mark(&path, &["a"]).unwrap();
        assert!(open(&path, &["a"]).is_ok());
        std::fs::write(path.join("a"), "mine").unwrap();
        assert!(matches!(
            open(&path, &["a"]),
            Err(Failure::Request(text)) if text.contains("has been changed")
        ));
        std::fs::remove_dir_all(&path).unwrap();
    }

    #[test]
    fn a_file_of_somebody_is_left_alone() {
        let path = fresh("foreign");
        std::fs::create_dir_all(&path).unwrap();
        std::fs::write(path.join("a"), "mine").unwrap();
        let refused = open(&path, &["a"]).unwrap_err();
        assert!(matches!(refused, Failure::Request(text) if text.contains("is not the demo's")));
        std::fs::remove_dir_all(&path).unwrap();
    }
}
