//! Asks a running service.

use std::fmt;
use std::fs;
use std::io::{self, BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::os::unix::fs::FileTypeExt;
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::time::Duration as Wait;

use athermal_command::{Failure, Format, Terminal, println};
use athermal_core::diagnostic::{Diagnostics, Sources};
use athermal_core::document::{Disk, load};
use athermal_serve::service::usual_state;
use serde_json::{Value, json};

use crate::control::{RUN, notes, sockets};

/// Where the unit of the package keeps the states of services.
const STATES: &str = "/var/lib/athermal";

/// How long an answer may take.
const PATIENCE: Wait = Wait::from_secs(90);
/// How large an answer may be.
const LARGEST: u64 = 64 << 20;

/// A name as it stands in a query.
#[must_use]
pub fn escaped(name: &str) -> String {
    let escaped = name.bytes().map(|byte| match byte {
        byte if byte.is_ascii_alphanumeric() || b"._-*".contains(&byte) => {
            char::from(byte).to_string()
        }
        byte => format!("%{byte:02X}"),
    });
    escaped.collect()
}

/// Where a service is asked.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Address {
    /// At its Unix socket.
    Socket(PathBuf),
    /// At a loopback address, with the token that orders need.
    Loopback {
        /// Address and port.
        authority: String,
        /// The token, where there is one.
        token: Option<String>,
    },
}

/// An answer of a service.
#[derive(Debug)]
pub struct Reply {
    /// The status.
    pub status: u16,
    /// What was answered.
    pub body: Vec<u8>,
}

/// Why there is no answer.
#[derive(Debug)]
pub enum ClientError {
    /// No service is found by a name.
    NoService {
        /// The name.
        name: String,
        /// Where it was looked for.
        tried: Vec<PathBuf>,
    },
    /// The file with the token cannot be read.
    NoToken {
        /// The file.
        path: PathBuf,
        /// Why.
        error: io::Error,
    },
    /// It cannot be reached, or did not answer in time.
    Unreachable {
        /// Where.
        address: Address,
        /// Why.
        error: io::Error,
    },
}

impl Address {
    /// The service of a name, a machine file, a state folder, a socket, or an `http://` address.
    ///
    /// # Errors
    /// When none is found, or the token cannot be read that `http://` needs for orders.
    pub fn of(name: &str, token: Option<&Path>) -> Result<Self, ClientError> {
        if let Some(rest) = name.strip_prefix("http://") {
            let authority = rest.trim_end_matches('/').to_owned();
            let read = |path: &Path| match fs::read_to_string(path) {
                Ok(text) => Ok(text.trim().to_owned()),
                Err(error) => Err(ClientError::NoToken {
                    path: path.to_owned(),
                    error,
                }),
            };
            let token = token.map(read).transpose()?;
            return Ok(Self::Loopback { authority, token });
        }
        let tried = places(name, Path::new(STATES), Path::new(RUN));
        let found = one_of(&tried).cloned();
        found
            .map(Self::Socket)
            .ok_or_else(|| ClientError::NoService {
                name: name.to_owned(),
                tried,
            })
    }

    /// The service of a machine file, and the folder in which it keeps its state.
    ///
    /// # Errors
    /// As [`of`](Self::of).
    pub fn of_machine(
        machine: &Path,
        state: Option<&Path>,
    ) -> Result<(Self, PathBuf), ClientError> {
        let states = state.map_or_else(|| states_of(machine), |of| vec![of.to_owned()]);
        let of_state = |state: PathBuf| {
            sockets(&state)
                .into_iter()
                .map(move |of| (of, state.clone()))
        };
        let (tried, states): (Vec<_>, Vec<_>) = states.into_iter().flat_map(of_state).unzip();
        let found = one_of(&tried).and_then(|found| tried.iter().position(|of| of == found));
        match found {
            Some(nth) => Ok((Self::Socket(tried[nth].clone()), states[nth].clone())),
            None => Err(ClientError::NoService {
                name: machine.display().to_string(),
                tried,
            }),
        }
    }

    /// Asks for something.
    ///
    /// # Errors
    /// When it cannot be reached, or does not answer in time.
    pub fn get(&self, path: &str) -> Result<Reply, ClientError> {
        self.request("GET", path, None)
    }

    /// Orders something.
    ///
    /// # Errors
    /// As [`get`](Self::get).
    pub fn post(&self, path: &str, body: &Value) -> Result<Reply, ClientError> {
        self.request("POST", path, Some(body))
    }

    /// Listens to a stream, whose lines come as they are.
    ///
    /// # Errors
    /// As [`get`](Self::get).
    pub fn listen(&self, path: &str) -> Result<(u16, Box<dyn BufRead>), ClientError> {
        let stream = self.send("GET", path, None, None);
        let begun = stream.and_then(|stream| begin(BufReader::new(stream)));
        begun.map_err(|error| self.unreachable(error))
    }

    fn request(
        &self,
        method: &str,
        path: &str,
        body: Option<&Value>,
    ) -> Result<Reply, ClientError> {
        let stream = self.send(method, path, body, Some(PATIENCE));
        let answered = stream.and_then(|stream| {
            let (status, rest) = begin(BufReader::new(stream))?;
            let mut body = Vec::new();
            rest.take(LARGEST).read_to_end(&mut body)?;
            Ok(Reply { status, body })
        });
        answered.map_err(|error| self.unreachable(error))
    }

    fn unreachable(&self, error: io::Error) -> ClientError {
        let address = self.clone();
        ClientError::Unreachable { address, error }
    }

    fn send(
        &self,
        method: &str,
        path: &str,
        body: Option<&Value>,
        patience: Option<Wait>,
    ) -> io::Result<Box<dyn Read>> {
        let body = body.map(ToString::to_string).unwrap_or_default();
        // Of HTTP/1.0, so that the end of the answer is the end of the connection.
        let mut head = format!(
            "{method} {path} HTTP/1.0\r\nContent-Length: {}\r\n",
            body.len()
        );
        let head_for = |host: &str| format!("{head}Host: {host}\r\n");
        match self {
            Self::Socket(path) => {
                head = head_for("localhost") + "\r\n";
                let mut stream = UnixStream::connect(path)?;
                stream.set_read_timeout(patience)?;
                stream.write_all((head + &body).as_bytes())?;
                Ok(Box::new(stream))
            }
            Self::Loopback { authority, token } => {
                head = head_for(authority);
                if let Some(token) = token {
                    head += &format!("Authorization: Bearer {token}\r\n");
                }
                head += "\r\n";
                let mut stream = TcpStream::connect(authority)?;
                stream.set_read_timeout(patience)?;
                stream.write_all((head + &body).as_bytes())?;
                Ok(Box::new(stream))
            }
        }
    }
}

/// The socket of these at which a service answers; without one, the first that there is.
fn one_of(places: &[PathBuf]) -> Option<&PathBuf> {
    let is_socket = |path: &&PathBuf| fs::metadata(path).is_ok_and(|of| of.file_type().is_socket());
    // One that was killed leaves its socket behind.
    let answers = |path: &&PathBuf| is_socket(path) && UnixStream::connect(path).is_ok();
    let found = places.iter().find(answers);
    found.or_else(|| places.iter().find(is_socket))
}

/// Where the service of a machine file may keep its state: where one noted it that runs, where the file says, and beside the file.
fn states_of(machine: &Path) -> Vec<PathBuf> {
    let noted = notes(machine)
        .into_iter()
        .filter_map(|of| fs::read_link(of).ok());
    noted
        .chain(named_state(machine))
        .chain([usual_state(machine)])
        .collect()
}

/// The state folder that a machine file names, or one that it extends.
fn named_state(machine: &Path) -> Option<PathBuf> {
    let (mut files, mut mistakes) = (Sources::new(), Diagnostics::new());
    let document = load(machine, &Disk, &mut files, &mut mistakes)?;
    let runtime = document.tree.as_table()?.get("runtime")?;
    let state = runtime.as_table()?.get("state")?;
    Some(files.resolve(state.place, state.as_text()?))
}

/// Where the socket of a service may be. State folders know where it is.
fn places(name: &str, states: &Path, run: &Path) -> Vec<PathBuf> {
    let path = Path::new(name);
    let folders = match path.is_dir() {
        true => vec![path.to_owned()],
        false => states_of(path),
    };
    // A name may have dots of its own.
    let is_file = path.exists() || path.extension().is_some_and(|of| of == "toml");
    let stem = path.file_stem().filter(|_| is_file);
    let stem = stem.map_or(name.into(), |of| of.to_string_lossy());
    let mut places = vec![path.to_owned()];
    let packaged = [states.join(name), states.join(&*stem)];
    places.extend(
        folders
            .into_iter()
            .chain(packaged)
            .flat_map(|of| sockets(&of)),
    );
    places.push(run.join(format!("{stem}.sock")));
    // Each once, where it comes first.
    let mut seen = std::collections::BTreeSet::new();
    places.retain(|place| seen.insert(place.clone()));
    places
}

/// The status of an answer, and what follows its head.
fn begin(mut answer: impl BufRead + 'static) -> io::Result<(u16, Box<dyn BufRead>)> {
    let mut line = String::new();
    answer.read_line(&mut line)?;
    let status = line.split(' ').nth(1).and_then(|code| code.parse().ok());
    let status = status.ok_or_else(|| io::Error::other("it does not answer as a service"))?;
    loop {
        line.clear();
        if answer.read_line(&mut line)? == 0 || line.trim_end().is_empty() {
            return Ok((status, Box::new(answer)));
        }
    }
}

impl Reply {
    /// Whether what was asked for was done.
    #[must_use]
    pub fn is_fine(&self) -> bool {
        (200..300).contains(&self.status)
    }

    /// What was answered, as JSON.
    #[must_use]
    pub fn json(&self) -> Value {
        serde_json::from_slice(&self.body)
            .unwrap_or_else(|_| json!({ "error": String::from_utf8_lossy(&self.body) }))
    }

    /// What was answered, or why not: with all mistakes of a graph and their places.
    ///
    /// # Errors
    /// When it was refused.
    pub fn answered(&self, terminal: &Terminal) -> Result<Value, Failure> {
        let body = self.json();
        if self.is_fine() {
            return Ok(body);
        }
        if terminal.format == Format::Json {
            println!("{body:#}");
            return Err(Failure::Exit(2));
        }
        if let Some(text) = body["text"].as_str() {
            terminal.warning(format!(
                "the service refuses the graph:\n{}",
                text.trim_end()
            ));
        }
        let words = body["error"].as_str().unwrap_or("it was refused");
        Err(Failure::Request(words.to_owned()))
    }
}

impl From<ClientError> for Failure {
    fn from(error: ClientError) -> Self {
        match error {
            ClientError::NoService { .. } => Self::Request(error.to_string()),
            ClientError::NoToken { .. } | ClientError::Unreachable { .. } => {
                Self::Outside(error.to_string())
            }
        }
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Socket(path) => path.display().fmt(f),
            Self::Loopback { authority, .. } => write!(f, "http://{authority}"),
        }
    }
}

impl fmt::Display for ClientError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoService { name, tried } => {
                let tried: Vec<_> = tried.iter().map(|of| of.display().to_string()).collect();
                write!(
                    f,
                    "no service is found by `{name}`: give its name, its machine file, its state folder or its socket; looked for {}",
                    tried.join(", ")
                )
            }
            Self::NoToken { path, error } => {
                write!(f, "cannot read the token in {}: {error}", path.display())
            }
            Self::Unreachable { address, error } => {
                write!(f, "{address}: the service does not answer: {error}")
            }
        }
    }
}

impl std::error::Error for ClientError {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_service_is_found_by_its_name_with_dots_and_by_that_of_its_unit() {
        let states = std::env::temp_dir().join(format!("athermal-names-{}", std::process::id()));
        let run = Path::new("/run/athermal");
        fs::create_dir_all(states.join("line.v2")).unwrap();
        fs::write(states.join("line.v2/socket"), "/run/athermal/another.sock").unwrap();
        let found = places("line.v2", &states, run);
        let own = run.join("line.v2.sock");
        assert!(found.contains(&run.join("another.sock")), "{found:?}");
        assert_eq!(found.last(), Some(&own));
        // The name of a machine file is that of its service.
        assert_eq!(places("line.v2.toml", &states, run).last(), Some(&own));
        fs::remove_dir_all(states).unwrap();
    }

    #[test]
    fn a_token_that_cannot_be_read_is_an_error_with_its_path() {
        let error = Address::of("http://127.0.0.1:1", Some(Path::new("/nowhere/token")));
        let words = error.unwrap_err().to_string();
        assert!(words.contains("/nowhere/token"), "{words}");
    }
}
