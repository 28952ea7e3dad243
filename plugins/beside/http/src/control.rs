//! The companion of a service: opens its sockets, and starts the thread that serves them.

use std::fs;
use std::io;
use std::net::{SocketAddr, TcpListener};
use std::os::unix::fs::{FileTypeExt, PermissionsExt};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use std::time::Duration as Wait;

use athermal_core::engine::fnv_1a;
use athermal_serve::companion::{Beside, Companion};
use athermal_serve::connector::ConnectorError;
use athermal_serve::service::Service;
#[cfg(feature = "tls")]
use athermal_serve::service::ServiceEvent;

use crate::guard::Guard;
use crate::hub::{ControlFacts, Hub, Looker};
use crate::routes::Routes;
use crate::server::{Doors, Server, TcpDoor};
use crate::settings::{Control, Https};
use crate::token::{ORDER, READ, Token};

/// Where services have their sockets, by name.
pub(crate) const RUN: &str = "/run/athermal";
/// The socket in a state folder, where that folder cannot be written.
const SOCKET: &str = "control.sock";
/// The file in a state folder that says where the socket is.
const NOTE: &str = "socket";
/// How many bytes the path of a socket has at most, on all systems.
const LONGEST: usize = 100;
/// How long the service may take to let somebody look on.
const PATIENCE: Wait = Wait::from_secs(10);

athermal_core::events! {
    /// A certificate that nobody has signed.
    #[derive(Debug)]
    #[cfg_attr(not(feature = "tls"), allow(dead_code))]
    enum OwnCertificate {
        /// The control interface was given no certificate, and shows its own.
        InUse {
            /// Its SHA-256.
            fingerprint: String,
        } => "own_certificate", note, { fingerprint: String = fingerprint },
            format!("[control] https: nobody has signed the certificate in use; a browser should show this fingerprint (SHA-256): {fingerprint}");
    }
}

athermal_serve::register_events!(OwnCertificate);

impl Companion for Control {
    fn start(&self, beside: &Beside) -> Result<Box<dyn Send>, ConnectorError> {
        let failed = |what: String| {
            move |error: io::Error| ConnectorError::new(format!("[control] {what}: {error}"))
        };
        let (path, unix) = self.socket(beside)?;
        let tcp = self.tcp(beside)?;
        // Whoever asks finds the socket by the state folder, wherever it is, and that by the machine file. Where nothing can be written
        // it is looked for where it may be.
        let bytes = path.as_os_str().as_encoded_bytes();
        let _ = fs::write(beside.state.join(NOTE), bytes);
        let note = Note::of(beside);
        let hub = Arc::new(Hub::default());
        let (handle, seen) = (beside.handle.clone(), Arc::clone(&hub));
        let look = move |service: &mut Service| {
            service.observe(Box::new(Looker(Arc::clone(&seen))));
            service.contribute("control", move || ControlFacts::read(&seen));
        };
        // The service answers once it is pumped, which is after this.
        std::thread::spawn(move || handle.ask(PATIENCE, look));
        let routes = Routes::new(beside.clone(), hub);
        let doors = Doors { unix, tcp, path };
        let server = Server::start(doors, routes).map_err(failed("thread".to_owned()))?;
        Ok(Box::new((server, note)))
    }
}

impl Control {
    /// The doors of TCP.
    fn tcp(&self, beside: &Beside) -> Result<Vec<TcpDoor>, ConnectorError> {
        let failed = |what: String| {
            move |error: io::Error| ConnectorError::new(format!("[control] {what}: {error}"))
        };
        let token = |file| Token::of(&beside.state, file).map_err(failed(file.to_owned()));
        let door = |at: SocketAddr, is_tls| {
            Ok::<_, ConnectorError>(TcpDoor {
                listener: TcpListener::bind(at).map_err(failed(at.to_string()))?,
                guard: Arc::new(Guard {
                    order: token(ORDER)?,
                    read: token(READ)?,
                    is_tls,
                    origins: self.origins.clone(),
                    wrong: Mutex::default(),
                }),
                #[cfg(feature = "tls")]
                tls: None,
            })
        };
        let mut doors = Vec::new();
        doors.extend(self.http.map(|of| door(of.0, false)).transpose()?);
        if let Some(https) = &self.https {
            let mut over_tls = door(https.at, true)?;
            self.encrypt(https, beside, &mut over_tls)?;
            doors.push(over_tls);
        }
        Ok(doors)
    }

    #[cfg(feature = "tls")]
    fn encrypt(
        &self,
        https: &Https,
        beside: &Beside,
        door: &mut TcpDoor,
    ) -> Result<(), ConnectorError> {
        let (acceptor, own) = crate::tls::acceptor(https, &beside.machine, &beside.state)
            .map_err(|error| ConnectorError::new(format!("[control] https: {error}")))?;
        door.tls = Some(acceptor);
        if let Some(fingerprint) = own {
            let event = ServiceEvent::Of(Box::new(OwnCertificate::InUse { fingerprint }));
            let handle = beside.handle.clone();
            std::thread::spawn(move || handle.ask(PATIENCE, |service| service.report(event)));
        }
        Ok(())
    }

    #[cfg(not(feature = "tls"))]
    fn encrypt(&self, _: &Https, _: &Beside, _: &mut TcpDoor) -> Result<(), ConnectorError> {
        Err(ConnectorError::new(
            "[control] https: this program has no TLS; take one that was built with `--features tls`",
        ))
    }

    fn socket(&self, beside: &Beside) -> Result<(PathBuf, UnixListener), ConnectorError> {
        let mut path = match &self.socket {
            Some(path) => std::path::absolute(path).unwrap_or_else(|_| path.clone()),
            None => socket_of(Path::new(RUN), &beside.name, &beside.state),
        };
        let mut bound = bind(&path);
        if bound.is_err() && self.socket.is_none() {
            // A state folder that cannot be written keeps nobody from asking.
            path = elsewhere(&beside.state.join(SOCKET));
            bound = bind(&path);
        }
        let bound = bound.map_err(|error| {
            let path = path.display();
            ConnectorError::new(format_args!(
                "[control] cannot listen on {path}: {error}; name another by `socket`"
            ))
        });
        Ok((path, bound?))
    }
}

/// The socket of a service, by its name among the others, or in its state folder where another has that name.
fn socket_of(run: &Path, name: &str, state: &Path) -> PathBuf {
    let probe = run.join(format!(".{}", std::process::id()));
    let is_writable = fs::File::create(&probe).is_ok();
    let _ = fs::remove_file(probe);
    let path = run.join(format!("{name}.sock"));
    let is_taken = name.is_empty() || name.contains('/') || UnixStream::connect(&path).is_ok();
    match is_writable && !is_taken {
        true => path,
        false => short(state.join(SOCKET)),
    }
}

/// A path that a socket can have: one that is too long stands among temporary files, and the state folder says where.
fn short(path: PathBuf) -> PathBuf {
    if path.as_os_str().len() <= LONGEST {
        return path;
    }
    elsewhere(&path)
}

/// Where what has no room at a path stands, among temporary files.
fn elsewhere(path: &Path) -> PathBuf {
    std::env::temp_dir().join(format!("athermal-{:016x}.sock", hash(path)))
}

fn hash(path: &Path) -> u64 {
    fnv_1a(path.as_os_str().as_encoded_bytes())
}

/// Where the socket of a service with this state folder may be.
pub(crate) fn sockets(state: &Path) -> Vec<PathBuf> {
    let state = std::path::absolute(state).unwrap_or_else(|_| state.to_owned());
    let noted = fs::read_to_string(state.join(NOTE)).ok().map(PathBuf::from);
    let own = state.join(SOCKET);
    let elsewhere = elsewhere(&own);
    noted.into_iter().chain([own, elsewhere]).collect()
}

/// Where a service may note its state folder by its machine file.
pub(crate) fn notes(machine: &Path) -> [PathBuf; 2] {
    let machine = fs::canonicalize(machine).unwrap_or_else(|_| machine.to_owned());
    let name = format!("athermal-{:016x}.state", hash(&machine));
    [Path::new(RUN).join(&name), std::env::temp_dir().join(name)]
}

/// A link to the state folder of a service, for as long as that runs.
struct Note(Option<PathBuf>);

impl Note {
    fn of(beside: &Beside) -> Self {
        let link = |path: &PathBuf| {
            let _ = fs::remove_file(path);
            std::os::unix::fs::symlink(&beside.state, path).is_ok()
        };
        Self(notes(&beside.machine).into_iter().find(link))
    }
}

impl Drop for Note {
    fn drop(&mut self) {
        if let Some(path) = &self.0 {
            let _ = fs::remove_file(path);
        }
    }
}

/// Binds a socket that its user and group may use. One that nobody listens on any more is taken over; what is no socket stays.
fn bind(path: &Path) -> io::Result<UnixListener> {
    if let Ok(of) = fs::symlink_metadata(path) {
        if !of.file_type().is_socket() {
            return Err(io::Error::other("what is there is no socket"));
        }
        if UnixStream::connect(path).is_ok() {
            return Err(io::Error::other("another service listens there"));
        }
        fs::remove_file(path)?;
    }
    // Made elsewhere and renamed, so that nobody finds it before it has its rights.
    let folder = path.parent().unwrap_or(Path::new("."));
    let aside = folder.join(format!(".s{}", std::process::id()));
    let _ = fs::remove_file(&aside);
    let listener = UnixListener::bind(&aside)?;
    fs::set_permissions(&aside, fs::Permissions::from_mode(0o660))?;
    fs::rename(&aside, path)?;
    Ok(listener)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_socket_stays_and_a_socket_that_nobody_listens_on_is_taken_over() {
        let folder = std::env::temp_dir().join(format!("athermal-bind-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let [file, link] = ["notes.txt", "link"].map(|name| folder.join(name));
        fs::write(&file, "of somebody").unwrap();
        std::os::unix::fs::symlink(&file, &link).unwrap();
        for path in [&file, &link, &folder] {
            let refused = bind(path).unwrap_err().to_string();
            assert!(refused.contains("no socket"), "{refused}");
        }
        assert_eq!(fs::read_to_string(&link).unwrap(), "of somebody");
        let socket = socket_of(&folder, "line", &folder.join("state"));
        assert_eq!(socket, folder.join("line.sock"));
        let listener = bind(&socket).unwrap();
        assert!(bind(&socket).is_err());
        // Another service has the name.
        let beside = socket_of(&folder, "line", &folder.join("state"));
        assert_eq!(beside, folder.join("state/control.sock"));
        drop(listener);
        assert_eq!(socket_of(&folder, "line", &folder), socket);
        drop(bind(&socket).unwrap());
        fs::remove_dir_all(folder).unwrap();
    }
}
