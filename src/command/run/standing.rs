//! Decides whether an output still stands where it was begun, and what is told where it does not; not where it is written.

use std::fs;
use std::path::{Path, PathBuf};

use crate::terminal::Terminal;

/// An output file that has been begun.
pub struct Standing {
    path: PathBuf,
    /// Which file it is; none where it is no file, or that cannot be known.
    place: Option<Place>,
}

/// A device and a number on it, which is not given again while the file is open.
type Place = (u64, u64);

impl Standing {
    /// The output that has just been opened at a path.
    pub fn at(path: &Path) -> Self {
        Self {
            path: path.to_owned(),
            place: Some(path)
                .filter(|path| path.as_os_str() != "-")
                .and_then(place),
        }
    }

    /// Tells, once, that the file is no longer the one that its name leads to.
    pub fn look(&mut self, terminal: &Terminal) {
        if self.place.is_none() || place(&self.path) == self.place {
            return;
        }
        self.place = None;
        terminal.warning(format_args!(
            "{} was removed, moved or replaced while it is written: rows go on into the file that was there, and none into what is there \
             now; end the run before it is moved, or copy it and cut it to nothing",
            self.path.display()
        ));
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
