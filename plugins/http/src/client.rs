//! Asks a running service.

use std::fmt;
use std::fs;
use std::io::{self, BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::os::unix::fs::FileTypeExt;
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::time::Duration as Wait;

use athermal_serve::service::usual_state;
use serde_json::{Value, json};

/// How long an answer may take.
const PATIENCE: Wait = Wait::from_secs(90);
/// How large an answer may be.
const LARGEST: u64 = 64 << 20;

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
    /// When none is found.
    pub fn of(name: &str, token: Option<&Path>) -> Result<Self, ClientError> {
        if let Some(rest) = name.strip_prefix("http://") {
            let authority = rest.trim_end_matches('/').to_owned();
            let token = token.and_then(|path| fs::read_to_string(path).ok());
            let token = token.map(|text| text.trim().to_owned());
            return Ok(Self::Loopback { authority, token });
        }
        let path = Path::new(name);
        let folder = match path.is_dir() {
            true => path.to_owned(),
            false => usual_state(path),
        };
        // The state folder knows where the socket is.
        let noted = fs::read_to_string(folder.join("socket")).ok();
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        let tried: Vec<_> = [path.to_owned()]
            .into_iter()
            .chain(noted.map(PathBuf::from))
            .chain([PathBuf::from(format!("/run/athermal/{stem}.sock"))])
            .collect();
        let is_socket =
            |path: &&PathBuf| fs::metadata(path).is_ok_and(|of| of.file_type().is_socket());
        let found = tried.iter().find(is_socket).cloned();
        found
            .map(Self::Socket)
            .ok_or_else(|| ClientError::NoService {
                name: name.to_owned(),
                tried,
            })
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
            Self::Unreachable { address, error } => {
                write!(f, "{address}: the service does not answer: {error}")
            }
        }
    }
}

impl std::error::Error for ClientError {}
