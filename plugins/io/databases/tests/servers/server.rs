//! Servers, each on a free port of loopback and in a folder of its own, which can be killed and started again.

#[path = "../../../../../tests/workbench/peers/folder.rs"]
mod folder;

use std::fs;
use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

pub use folder::Folder;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    Influx,
    Victoria,
    Postgres,
}

/// A small disk.
pub struct Disk(PathBuf);

impl Disk {
    /// One at this place; none where that may not be made.
    fn mount(path: PathBuf) -> Option<Self> {
        fs::create_dir_all(&path).unwrap();
        let mut mount = Command::new("mount");
        mount
            .args(["-t", "tmpfs", "-o", "size=32m,mode=0700", "athermal"])
            .arg(&path);
        let made = is_root() && mount.status().is_ok_and(|of| of.success());
        if !made {
            println!("skipped: no small disk can be mounted here");
            return None;
        }
        std::os::unix::fs::chown(&path, Some(NOBODY), Some(NOBODY)).unwrap();
        Some(Self(path))
    }

    /// Leaves no room on it.
    pub fn fill(&self) {
        let mut file = fs::File::create(self.0.join("ballast")).unwrap();
        while file.write_all(&[1; 4096]).is_ok() {}
    }

    pub fn clear(&self) {
        fs::remove_file(self.0.join("ballast")).unwrap();
    }
}

impl Drop for Disk {
    fn drop(&mut self) {
        let _ = Command::new("umount").arg(&self.0).status();
    }
}

/// A database.
pub struct Server {
    pub kind: Kind,
    pub port: u16,
    /// What its rows lie on, where that is small; it goes before the folder that it is in.
    pub disk: Option<Disk>,
    pub folder: Folder,
    child: Option<Child>,
}

const POSTGRES: &str = "/usr/lib/postgresql/15/bin";
/// Who runs a PostgreSQL, which no root may.
const NOBODY: u32 = 65534;

fn is_root() -> bool {
    fs::metadata("/proc/self").is_ok_and(|of| std::os::unix::fs::MetadataExt::uid(&of) == 0)
}

impl Kind {
    fn program(self) -> PathBuf {
        match self {
            Self::Influx => "influxd".into(),
            Self::Victoria => "victoria-metrics".into(),
            Self::Postgres => Path::new(POSTGRES).join("postgres"),
        }
    }

    fn is_there(self) -> bool {
        let asked = Command::new(self.program())
            .arg("--version")
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .status();
        let is_required = std::env::var("ATHERMAL_REQUIRE_SERVERS").is_ok_and(|of| of == "1");
        let is_there = asked.is_ok();
        assert!(
            is_there || !is_required,
            "{self:?} is not installed, and ATHERMAL_REQUIRE_SERVERS=1 asks for it"
        );
        if !is_there {
            println!("skipped: {self:?} is not installed");
        }
        is_there
    }
}

impl Server {
    /// One that runs; none where it is not installed.
    pub fn start(kind: Kind) -> Option<Self> {
        Self::start_on(kind, false)
    }

    /// One whose rows lie on a small disk; none either where there can be none.
    pub fn start_on_small_disk(kind: Kind) -> Option<Self> {
        let server = Self::start_on(kind, true)?;
        if kind == Kind::Postgres {
            let mut client = server.client().unwrap();
            let place = server.path("small");
            client
                .batch_execute(&format!("create tablespace small location '{place}'"))
                .unwrap();
            client
                .batch_execute("alter role me set default_tablespace = small")
                .unwrap();
        }
        Some(server)
    }

    fn start_on(kind: Kind, is_small: bool) -> Option<Self> {
        if !kind.is_there() {
            return None;
        }
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let mut server = Self {
            kind,
            port: listener.local_addr().unwrap().port(),
            disk: None,
            folder: Folder::new("server"),
            child: None,
        };
        drop(listener);
        if is_small {
            let name = if kind == Kind::Postgres {
                "small"
            } else {
                "data"
            };
            server.disk = Some(Disk::mount(server.folder.0.join(name))?);
        }
        if kind == Kind::Postgres {
            server.initialise();
        }
        server.again();
        if kind == Kind::Influx {
            server.query("CREATE DATABASE plant");
        }
        Some(server)
    }

    fn path(&self, name: &str) -> String {
        self.folder.0.join(name).to_string_lossy().into_owned()
    }

    /// A command of PostgreSQL's.
    fn command(&self, program: &Path) -> Command {
        let mut command = Command::new(program);
        if is_root() {
            command.uid(NOBODY).gid(NOBODY);
        }
        command.current_dir(&self.folder.0);
        command
    }

    fn initialise(&self) {
        fs::write(self.folder.0.join("password"), "w0rd\n").unwrap();
        if is_root() {
            std::os::unix::fs::chown(&self.folder.0, Some(NOBODY), Some(NOBODY)).unwrap();
            std::os::unix::fs::chown(self.folder.0.join("password"), Some(NOBODY), Some(NOBODY))
                .unwrap();
        }
        let made = self
            .command(&Path::new(POSTGRES).join("initdb"))
            .args([
                "-U",
                "me",
                "-A",
                "scram-sha-256",
                "--no-sync",
                "--pwfile",
                &self.path("password"),
                "-D",
                &self.path("data"),
            ])
            .stdout(Stdio::null())
            .status();
        assert!(made.unwrap().success());
    }

    /// Starts it, and waits until it answers.
    pub fn again(&mut self) {
        let (port, data) = (self.port, self.path("data"));
        let mut command = match self.kind {
            Kind::Influx => {
                let text = format!(
                    "reporting-disabled = true\nbind-address = \"127.0.0.1:0\"\n[meta]\ndir = \"{data}/meta\"\n\
                     [data]\ndir = \"{data}/data\"\nwal-dir = \"{data}/wal\"\n[http]\nbind-address = \"127.0.0.1:{port}\"\n\
                     [monitor]\nstore-enabled = false\n"
                );
                fs::write(self.folder.0.join("conf"), text).unwrap();
                let mut command = Command::new(self.kind.program());
                command.args(["-config", &self.path("conf")]);
                command
            }
            Kind::Victoria => {
                let mut command = Command::new(self.kind.program());
                command.args([
                    format!("-httpListenAddr=127.0.0.1:{port}"),
                    format!("-storageDataPath={data}"),
                    "-retentionPeriod=100y".to_owned(),
                ]);
                command
            }
            Kind::Postgres => {
                let mut command = self.command(&self.kind.program());
                command.args(["-D", &data, "-p", &port.to_string(), "-k", &self.path("")]);
                command.args([
                    "-c",
                    "listen_addresses=127.0.0.1",
                    "-c",
                    "shared_buffers=16MB",
                ]);
                command
            }
        };
        let child = command
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn();
        self.child = Some(child.unwrap());
        let began = Instant::now();
        while !self.answers() {
            assert!(
                began.elapsed() < Duration::from_secs(60),
                "the server does not start"
            );
            std::thread::sleep(Duration::from_millis(50));
        }
    }

    fn answers(&self) -> bool {
        match self.kind {
            Kind::Postgres => self.client().is_ok(),
            Kind::Influx => self.get("/ping").is_ok(),
            Kind::Victoria => self.get("/health").is_ok_and(|of| of.contains("OK")),
        }
    }

    /// As `kill -9`.
    pub fn kill(&mut self) {
        if let Some(mut child) = self.child.take() {
            child.kill().unwrap();
            child.wait().unwrap();
            // What it has left is none that runs.
            let _ = fs::remove_file(self.folder.0.join("data/postmaster.pid"));
        }
    }

    pub fn client(&self) -> Result<postgres::Client, postgres::Error> {
        postgres::Config::new()
            .host("127.0.0.1")
            .port(self.port)
            .dbname("postgres")
            .user("me")
            .password("w0rd")
            .connect(postgres::NoTls)
    }

    /// What is answered to a request.
    pub fn get(&self, path: &str) -> std::io::Result<String> {
        let mut stream = TcpStream::connect(("127.0.0.1", self.port))?;
        stream.set_read_timeout(Some(Duration::from_secs(20)))?;
        write!(stream, "GET {path} HTTP/1.0\r\nHost: localhost\r\n\r\n")?;
        let mut text = Vec::new();
        stream.read_to_end(&mut text)?;
        Ok(String::from_utf8_lossy(&text).into_owned())
    }

    /// A query of InfluxDB.
    pub fn query(&self, text: &str) -> serde_json::Value {
        let text = text
            .replace(' ', "+")
            .replace('"', "%22")
            .replace('\'', "%27");
        let path = format!("/query?db=plant&epoch=ns&q={text}");
        // What changes something is posted.
        let mut stream = TcpStream::connect(("127.0.0.1", self.port)).unwrap();
        write!(
            stream,
            "POST {path} HTTP/1.0\r\nHost: localhost\r\nContent-Length: 0\r\n\r\n"
        )
        .unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        let (_, body) = answer.split_once("\r\n\r\n").unwrap();
        serde_json::from_str(body).unwrap_or_else(|of| panic!("{of}: {answer}"))
    }

    /// The keys of all rows of a machine, with their values: microseconds and output.
    pub fn rows(&self, machine: &str) -> Vec<(i64, String, f64)> {
        let mut all = match self.kind {
            Kind::Postgres => {
                let mut client = self.client().unwrap();
                let text = "select (extract(epoch from time) * 1000000)::bigint, output, value from athermal where machine = $1";
                let rows = client.query(text, &[&machine]).unwrap();
                rows.iter()
                    .map(|of| (of.get(0), of.get(1), of.get(2)))
                    .collect::<Vec<_>>()
            }
            _ => {
                let found = self.query(&format!(
                    "SELECT \"output\", \"value\" FROM \"athermal\" WHERE \"machine\" = '{machine}'"
                ));
                let rows = found["results"][0]["series"][0]["values"]
                    .as_array()
                    .cloned()
                    .unwrap_or_default();
                let row = |of: &serde_json::Value| {
                    let (at, output, value) = (of[0].as_i64(), of[1].as_str(), of[2].as_f64());
                    (
                        at.unwrap() / 1000,
                        output.unwrap().to_owned(),
                        value.unwrap(),
                    )
                };
                rows.iter().map(row).collect()
            }
        };
        all.sort_by(|a, b| (a.0, &a.1).cmp(&(b.0, &b.1)));
        all
    }

    /// What a machine file says of a sink into it.
    pub fn sink(&self) -> String {
        let port = self.port;
        match self.kind {
            Kind::Influx => format!(
                "type = \"influx\"\nurl = \"http://127.0.0.1:{port}\"\ndatabase = \"plant\"\n"
            ),
            Kind::Victoria => format!(
                "type = \"influx\"\nurl = \"http://127.0.0.1:{port}\"\norg = \"plant\"\nbucket = \"line\"\ntoken = {{ file = \"password\" }}\n"
            ),
            Kind::Postgres => format!(
                "type = \"postgres\"\nhost = \"127.0.0.1\"\nport = {port}\ndatabase = \"postgres\"\n\
                 login = {{ name = \"me\", password = {{ file = \"password\" }} }}\n"
            ),
        }
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.kill();
    }
}
