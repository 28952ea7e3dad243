//! Whether an output file still stands where it was begun.

use std::fs;
use std::path::{Path, PathBuf};

/// An output file that has been begun.
#[derive(Debug)]
pub struct OutputIdentity {
    path: PathBuf,
    /// Which file it is; none where it is no file, or that cannot be known.
    place: Option<Place>,
}

/// A device and a number on it, which is not given again while the file is open.
type Place = (u64, u64);

impl OutputIdentity {
    /// The output that has just been opened at a path.
    #[must_use]
    pub fn of(path: &Path) -> Self {
        Self {
            path: path.to_owned(),
            place: Some(path)
                .filter(|path| path.as_os_str() != "-")
                .and_then(place),
        }
    }

    /// Its path, once, when the file there is no longer the one that was opened.
    pub(crate) fn moved(&mut self) -> Option<&Path> {
        if self.place.is_none() || place(&self.path) == self.place {
            return None;
        }
        self.place = None;
        Some(&self.path)
    }
}

#[cfg(unix)]
fn place(path: &Path) -> Option<Place> {
    use std::os::unix::fs::MetadataExt;

    let of = fs::metadata(path).ok().filter(fs::Metadata::is_file)?;
    Some((of.dev(), of.ino()))
}

#[cfg(not(unix))]
fn place(_path: &Path) -> Option<Place> {
    None
}
