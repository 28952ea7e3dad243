//! Whole files: written aside, then renamed.

use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Writes a file aside and renames it. A reader never sees half of it, and a failure, be it of power, leaves the old one.
/// What is there and is no file, such as `/dev/null` or a pipe, is written to instead.
///
/// # Errors
/// When it cannot be written.
pub fn write_whole(path: &Path, content: &[u8]) -> io::Result<()> {
    let synced = |to: &Path| {
        let mut file = fs::File::create(to)?;
        file.write_all(content)?;
        file.sync_all()
    };
    put(path, "part", synced, |to| fs::write(to, content))
}

/// The same with a copy of another file, which keeps its rights.
///
/// # Errors
/// When it cannot be read or written.
pub fn copy_whole(from: &Path, path: &Path) -> io::Result<()> {
    let copied = |to: &Path| fs::copy(from, to).map(|_| ());
    let written = |to: &Path| fs::write(to, fs::read(from)?);
    put(path, "new", copied, written)
}

/// Makes a file beside a path and gives it that name; or writes to what is there, where that is no file. A link stays one, to what
/// takes the place of what it links to.
fn put(
    path: &Path,
    ending: &str,
    make: impl FnOnce(&Path) -> io::Result<()>,
    write_to: impl FnOnce(&Path) -> io::Result<()>,
) -> io::Result<()> {
    if fs::metadata(path).is_ok_and(|of| !of.is_file() && !of.is_dir()) {
        return write_to(path);
    }
    let path = &fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    let mut aside = path.as_os_str().to_owned();
    aside.push(".");
    aside.push(ending);
    let aside = PathBuf::from(aside);
    make(&aside)
        .and_then(|()| fs::rename(&aside, path))
        .inspect_err(|_| {
            // Half a file is of no use, and on a full disk it takes the room of the next.
            let _ = fs::remove_file(&aside);
        })
}
