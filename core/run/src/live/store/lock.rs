//! Locks: of two runs no more than one writes a file. The lock goes with the program, however it ends.

use std::fs::{self, File, TryLockError};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// How long a run may take to end after its signal.
const ENDS: Duration = Duration::from_secs(1);

/// A file that no other run writes for as long as this lives; any, where there are no locks.
#[derive(Debug)]
pub struct FileLock {
    lock: Option<(PathBuf, File)>,
}

impl FileLock {
    /// Locks a file by an empty one beside it, `FILE.held`, which stays where it is when the file is replaced. None where another
    /// run holds it for more than a second. A path that cannot be written, or is no file, is not locked.
    #[must_use]
    pub fn acquire(path: &Path) -> Option<Self> {
        let is_file = fs::metadata(path).map_or(path.as_os_str() != "-", |of| of.is_file());
        if !is_file {
            return Some(Self { lock: None });
        }
        let mut beside = fs::canonicalize(path)
            .unwrap_or_else(|_| path.to_owned())
            .into_os_string();
        beside.push(".held");
        let beside = PathBuf::from(beside);
        let began = Instant::now();
        loop {
            let opened = File::options()
                .write(true)
                .create(true)
                .truncate(false)
                .open(&beside);
            // Whoever writes the file reports why it cannot be written, as on a full disk.
            let Ok(file) = opened else {
                return Some(Self { lock: None });
            };
            match file.try_lock() {
                // Whoever held it before may have removed it since it was opened here.
                Ok(()) if is_at(&file, &beside) || began.elapsed() >= ENDS => {
                    return Some(Self {
                        lock: Some((beside, file)),
                    });
                }
                Ok(()) => {}
                Err(TryLockError::Error(_)) => return Some(Self { lock: None }),
                Err(TryLockError::WouldBlock) if began.elapsed() >= ENDS => return None,
                Err(TryLockError::WouldBlock) => {
                    std::thread::sleep(Duration::from_millis(20));
                }
            }
        }
    }
}

impl Drop for FileLock {
    fn drop(&mut self) {
        if let Some((beside, file)) = self.lock.take() {
            // While it is locked, so that nobody else's is removed; nor one with something in it, which is no lock of a run.
            if file.metadata().is_ok_and(|of| of.len() == 0) {
                let _ = fs::remove_file(beside);
            }
        }
    }
}

/// Whether a file still has its name.
#[cfg(unix)]
fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;

    let of = |of: fs::Metadata| (of.dev(), of.ino());
    matches!((file.metadata().map(of), fs::metadata(path).map(of)), (Ok(one), Ok(other)) if one == other)
}

#[cfg(not(unix))]
fn is_at(_file: &File, _path: &Path) -> bool {
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_held_by_one_alone_until_it_lets_go_and_nothing_is_left_beside_it() {
        let name = format!("athermal-held-{}", std::process::id());
        let path = std::env::temp_dir().join(name);
        let held = FileLock::acquire(&path).unwrap();
        let beside = path.with_extension("held");
        assert!(beside.exists());
        assert!(FileLock::acquire(&path).is_none());
        // One that is just ending is waited for.
        let ending = std::thread::spawn(move || {
            std::thread::sleep(Duration::from_millis(100));
            drop(held);
        });
        let next = FileLock::acquire(&path).unwrap();
        ending.join().unwrap();
        assert!(beside.exists() && FileLock::acquire(&path).is_none());
        drop(next);
        assert!(!beside.exists());
        assert!(FileLock::acquire(Path::new("-")).unwrap().lock.is_none());
        let nowhere = path.join("nowhere");
        assert!(FileLock::acquire(&nowhere).unwrap().lock.is_none());
    }
}
