//! A file that is read as it grows, until it is rotated.

use std::fs::{File, Metadata};
use std::io::{self, Read, Seek};
use std::path::PathBuf;
use std::time::{Duration, Instant};

use athermal_serve::connector::Stop;

/// How long the end of a file is left alone before it is looked at again, at least and at most: for twice as long as nothing has come.
const PAUSES: (Duration, Duration) = (Duration::from_millis(50), Duration::from_millis(500));

/// Reads a file to its end and waits there for more. Ends where the file was replaced or cut short, after what still stood in it, or
/// where it is to stop.
pub(crate) struct Follow {
    file: File,
    path: PathBuf,
    stop: Stop,
    /// Whether the file was found to be another one, so that what is left of this one is the last.
    is_replaced: bool,
    /// When something came.
    came: Instant,
}

impl Follow {
    /// A file from its beginning on.
    pub(crate) fn open(path: PathBuf, stop: Stop) -> io::Result<Self> {
        Ok(Self {
            file: File::open(&path)?,
            path,
            stop,
            is_replaced: false,
            came: Instant::now(),
        })
    }

    /// Whether the path leads to another file than the one that is read, or that one has become shorter than what was read of it.
    fn looks_replaced(&mut self) -> io::Result<bool> {
        let (read, here) = (self.file.stream_position()?, self.file.metadata()?);
        if here.len() < read {
            return Ok(true);
        }
        // Between a file that is moved away and the next one there may be none.
        let there = std::fs::metadata(&self.path);
        Ok(there.is_ok_and(|there| !is_same(&here, &there)))
    }
}

#[cfg(unix)]
fn is_same(one: &Metadata, other: &Metadata) -> bool {
    use std::os::unix::fs::MetadataExt;
    (one.dev(), one.ino()) == (other.dev(), other.ino())
}

#[cfg(not(unix))]
fn is_same(one: &Metadata, other: &Metadata) -> bool {
    one.created().ok() == other.created().ok()
}

impl Read for Follow {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        loop {
            let read = self.file.read(into)?;
            if read > 0 || self.is_replaced {
                self.came = Instant::now();
                return Ok(read);
            }
            if self.looks_replaced()? {
                // Whoever wrote it may have done so until it was moved away.
                self.is_replaced = true;
                continue;
            }
            if !self
                .stop
                .wait((2 * self.came.elapsed()).clamp(PAUSES.0, PAUSES.1))
            {
                return Ok(0);
            }
        }
    }
}
