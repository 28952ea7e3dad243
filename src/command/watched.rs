//! Decides when a graph has changed on disk, in its own file or in one that it extends or takes modules from; not what is done then.

use std::cell::RefCell;
use std::io;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use athermal::core::diagnostic::{Diagnostics, Sources};
use athermal::core::document::{self, Disk, FileReader};

/// When a file was written, and how long it is; none where there is no file.
type Written = Option<(SystemTime, u64)>;

/// A graph on disk, as it was when it was last looked at.
pub(super) struct Watched {
    /// Its own file.
    pub(super) path: PathBuf,
    files: Vec<(PathBuf, Written)>,
}

impl Watched {
    /// The graph or model in a file, as it is now.
    pub(super) fn of(path: &Path) -> Self {
        let noting = Noting::default();
        if path
            .extension()
            .is_some_and(|extension| extension == "toml")
        {
            // Mistakes are told when the graph is taken over; its files are watched all the same.
            let (mut sources, mut diagnostics) = (Sources::new(), Diagnostics::new());
            document::load(path, &noting, &mut sources, &mut diagnostics);
        } else {
            noting.note(path);
        }
        Self {
            path: path.to_owned(),
            files: noting.files.into_inner(),
        }
    }

    /// Whether a file has been written since. One that is gone is about to be written again.
    pub(super) fn changed(&self) -> bool {
        self.files.iter().any(|(path, seen)| {
            let now = written(path);
            now.is_some() && now != *seen
        })
    }
}

/// Notes which files are read, those that are missing too, and when each was written.
#[derive(Default)]
struct Noting {
    files: RefCell<Vec<(PathBuf, Written)>>,
}

impl Noting {
    fn note(&self, path: &Path) {
        self.files
            .borrow_mut()
            .push((path.to_owned(), written(path)));
    }
}

impl FileReader for Noting {
    fn read(&self, path: &Path) -> Result<String, io::Error> {
        self.note(path);
        Disk.read(path)
    }
}

fn written(path: &Path) -> Written {
    let facts = std::fs::metadata(path).ok()?;
    Some((facts.modified().ok()?, facts.len()))
}
