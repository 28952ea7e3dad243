//! The token that orders over TCP need: a file that its owner alone reads.

use std::fs::{File, OpenOptions};
use std::io::{self, Read, Write};
use std::os::unix::fs::{OpenOptionsExt, PermissionsExt};
use std::path::Path;

use athermal_serve::folder::may_pass;

/// The name of the file in the state folder: what orders need.
pub const ORDER: &str = "token";
/// That of what it takes to look, where that takes something.
pub const READ: &str = "token-read";

/// A secret that is compared in a time that does not depend on where it differs.
#[derive(Clone)]
pub struct Token(String);

impl Token {
    /// A token of a state folder, by the name of its file; it is made where there is none.
    ///
    /// # Errors
    /// When others can read it, or it cannot be read or made.
    pub fn of(state: &Path, file: &str) -> io::Result<Self> {
        let path = state.join(file);
        match File::open(&path) {
            Ok(mut file) => {
                let mode = file.metadata()?.permissions().mode();
                if mode & 0o077 != 0 {
                    return Err(io::Error::other(format!(
                        "{} can be read by others: `chmod 600` it, or remove it for a new one",
                        path.display()
                    )));
                }
                let mut text = String::new();
                file.read_to_string(&mut text)?;
                let text = text.trim().to_owned();
                if text.len() < 16 {
                    let words = format!("{} is too short: remove it for a new one", path.display());
                    return Err(io::Error::other(words));
                }
                Ok(Self(text))
            }
            // One that cannot be kept is known to nobody: until the next start nothing is ordered by it.
            Err(error) if error.kind() == io::ErrorKind::NotFound => Self::make(&path),
            Err(error) => Err(error),
        }
    }

    fn make(path: &Path) -> io::Result<Self> {
        let mut bytes = [0; 32];
        File::open("/dev/urandom")?.read_exact(&mut bytes)?;
        let text: String = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
        match write_private(path, &text) {
            Err(error) if !may_pass(&error) => return Err(error),
            Err(_) => drop(std::fs::remove_file(path)),
            Ok(()) => {}
        }
        Ok(Self(text))
    }

    /// Whether a text is the token.
    pub fn is(&self, text: &str) -> bool {
        let (own, given) = (self.0.as_bytes(), text.as_bytes());
        let pairs = own.iter().zip(given.iter().chain(std::iter::repeat(&0)));
        let difference = pairs.fold(0, |all, (a, b)| all | (a ^ b));
        difference == 0 && own.len() == given.len()
    }
}

/// Writes a file that its owner alone reads, and that is not there yet.
pub fn write_private(path: &Path, text: &str) -> io::Result<()> {
    let mut options = OpenOptions::new();
    let file = options.write(true).create_new(true).mode(0o600).open(path);
    file.and_then(|mut file| writeln!(file, "{}", text.trim_end()))
}
