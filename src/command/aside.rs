//! Writing whole files: beside their place first, then renamed, so that a reader never sees half of one.

use std::fs;
use std::io;
use std::path::Path;

use athermal::files::STANDARD_INPUT;
use athermal::run::live::store::write_whole;

use crate::terminal::Failure;

/// Refuses an output that is another file of the same command, such as one that is read: what stands in it would be lost.
///
/// # Errors
/// When it is.
pub fn check_apart<'a>(
    option: &str,
    output: &Path,
    others: impl IntoIterator<Item = &'a Path>,
) -> Result<(), Failure> {
    // What is not there yet is known by its name alone; what is there and is no file loses nothing.
    let known = |path: &Path| fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    let is_file =
        |path: &Path| fs::metadata(path).map_or(path.as_os_str() != "-", |of| of.is_file());
    let is_same =
        |other: &&Path| known(other) == known(output) || is_one_file(output, from_stream(other));
    match others
        .into_iter()
        .find(|other| is_file(output) && is_same(other))
    {
        Some(other) => Err(Failure::Request(format!(
            "{option} {}: this is the same file as {}, and what stands in it would be lost; name another file",
            output.display(),
            if other.as_os_str() == "-" {
                STANDARD_INPUT.to_owned()
            } else {
                other.display().to_string()
            }
        ))),
        None => Ok(()),
    }
}

/// Where a path is looked at that stands for standard input: a shell may have opened a file there.
fn from_stream(path: &Path) -> &Path {
    if path.as_os_str() == "-" {
        Path::new("/dev/stdin")
    } else {
        path
    }
}

/// Whether two paths lead to one file, be it by links or by what is open already.
#[cfg(unix)]
fn is_one_file(one: &Path, other: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;

    let place = |path: &Path| fs::metadata(path).map(|of| (of.dev(), of.ino()));
    matches!((place(one), place(other)), (Ok(one), Ok(other)) if one == other)
}

#[cfg(not(unix))]
fn is_one_file(_one: &Path, _other: &Path) -> bool {
    false
}

/// Writes a file aside and renames it, so that a reader never sees half of it and a failure, be it of power, leaves the old one.
/// What is there and is no file, such as `/dev/null` or a pipe, is written to instead: it would be no more.
///
/// # Errors
/// When it cannot be written.
pub fn write_aside(path: &Path, content: impl AsRef<[u8]>) -> Result<(), Failure> {
    write_whole(path, content.as_ref()).map_err(|error| Failure::Outside(not_written(path, &error)))
}

/// Lets a file be written beside its place, under a name with the same ending, and puts it there once it is whole: what fails or is
/// stopped leaves what was there. What is there and is no file is written to as it is.
///
/// # Errors
/// When it cannot be written.
pub fn beside<T>(
    path: &Path,
    write: impl FnOnce(&Path) -> Result<T, Failure>,
) -> Result<T, Failure> {
    let is_other = path.as_os_str() == "-" || fs::metadata(path).is_ok_and(|of| !of.is_file());
    let (false, Some(name)) = (is_other, path.file_name()) else {
        return write(path);
    };
    // A link stays one: the file that it leads to is written.
    let place = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    let name = place.file_name().unwrap_or(name).to_string_lossy();
    let aside = place.with_file_name(format!(".{}-{name}", std::process::id()));
    let written = write(&aside).and_then(|written| {
        let put =
            fs::rename(&aside, &place).map_err(|error| Failure::Outside(not_written(path, &error)));
        put.map(|()| written)
    });
    if written.is_err() {
        let _ = fs::remove_file(&aside);
    }
    // Of the name aside nobody knows.
    let (aside, path) = (aside.display().to_string(), path.display().to_string());
    written.map_err(|failure| match failure {
        Failure::Outside(text) => Failure::Outside(text.replace(&aside, &path)),
        Failure::Request(text) => Failure::Request(text.replace(&aside, &path)),
        other => other,
    })
}

/// Why a file is not written.
pub fn not_written(path: &Path, error: &io::Error) -> String {
    format!("cannot write {}: {error}", path.display())
}

#[cfg(test)]
#[cfg(unix)]
mod tests {
    use athermal::run::live::store::copy_whole;

    use super::*;

    /// What a pipe is given, which stays one.
    fn through_a_pipe(name: &str, write: impl FnOnce(&Path)) -> String {
        let name = format!("athermal-{name}-{}", std::process::id());
        let pipe = std::env::temp_dir().join(name);
        let made = std::process::Command::new("mkfifo").arg(&pipe).status();
        assert!(made.unwrap().success());
        let reader = std::thread::spawn({
            let pipe = pipe.clone();
            move || fs::read_to_string(pipe).unwrap()
        });
        write(&pipe);
        let read = reader.join().unwrap();
        assert!(!fs::metadata(&pipe).unwrap().is_file());
        fs::remove_file(&pipe).unwrap();
        read
    }

    #[test]
    fn a_link_stays_one() {
        let file = std::env::temp_dir().join(format!("athermal-linked-{}", std::process::id()));
        let link = file.with_extension("link");
        fs::write(&file, "old").unwrap();
        std::os::unix::fs::symlink(&file, &link).unwrap();
        write_aside(&link, "new").unwrap();
        assert_eq!(fs::read_to_string(&file).unwrap(), "new");
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        for path in [link, file] {
            fs::remove_file(path).unwrap();
        }
    }

    #[test]
    fn what_is_no_file_is_written_to_and_stays_what_it_is() {
        let read = through_a_pipe("written", |pipe| write_aside(pipe, "a model").unwrap());
        assert_eq!(read, "a model");
        let program = std::env::temp_dir().join(format!("athermal-built-{}", std::process::id()));
        fs::write(&program, "a program").unwrap();
        let read = through_a_pipe("copied", |pipe| copy_whole(&program, pipe).unwrap());
        assert_eq!(read, "a program");
        let placed = program.with_extension("placed");
        copy_whole(&program, &placed).unwrap();
        assert_eq!(fs::read_to_string(&placed).unwrap(), "a program");
        for file in [program, placed] {
            fs::remove_file(file).unwrap();
        }
    }
}
