//! Decides that of two runs no more than one writes a file: by a lock beside it, which goes with the program however it ends. Not what is
//! written.

use std::fs::{self, File, TryLockError};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use crate::terminal::Failure;

/// How long one may take that has just been told to end.
const ENDS: Duration = Duration::from_secs(1);

/// A file that no other run writes for as long as this lives; any, where there are no locks.
pub struct Held {
    lock: Option<(PathBuf, File)>,
}

impl Held {
    /// Holds a state.
    ///
    /// # Errors
    /// When another run does.
    pub fn state(path: &Path) -> Result<Self, Failure> {
        Self::of(path).ok_or_else(|| {
            Failure::Outside(format!(
                "{}: another run keeps there what it knows: end that one first, or name another file with `--state`",
                path.display()
            ))
        })
    }

    /// Holds an output, where it is a file.
    ///
    /// # Errors
    /// When another run does.
    pub fn output(path: &Path) -> Result<Self, Failure> {
        let is_file = fs::metadata(path).map_or(path.as_os_str() != "-", |of| of.is_file());
        if !is_file {
            return Ok(Self { lock: None });
        }
        Self::of(path).ok_or_else(|| {
            Failure::Outside(format!(
                "{}: another run writes it: end that one first, or name another file with `--output`",
                path.display()
            ))
        })
    }

    /// Holds a file by one beside it, which nobody reads and which stays where it is when the file is put in place of another; none
    /// where somebody else does.
    fn of(path: &Path) -> Option<Self> {
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
            // A file that cannot be written, as on a disk that is full, is told of by who writes it.
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

impl Drop for Held {
    fn drop(&mut self) {
        if let Some((beside, file)) = self.lock.take() {
            // While it is held, so that nobody else's is removed; nor one with something in it, which is no lock of a run.
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
        let held = Held::state(&path).unwrap();
        let beside = path.with_extension("held");
        assert!(beside.exists());
        let refused = Held::state(&path).err().unwrap();
        assert!(matches!(refused, Failure::Outside(_)));
        // One that is just ending is waited for.
        let ending = std::thread::spawn(move || {
            std::thread::sleep(Duration::from_millis(100));
            drop(held);
        });
        let next = Held::state(&path).unwrap();
        ending.join().unwrap();
        assert!(beside.exists() && Held::output(&path).is_err());
        drop(next);
        assert!(!beside.exists());
        assert!(Held::output(Path::new("-")).unwrap().lock.is_none());
        assert!(Held::state(&path.join("nowhere")).unwrap().lock.is_none());
    }
}
