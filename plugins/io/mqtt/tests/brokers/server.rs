//! Real brokers, each on a free port of loopback and in a folder of its own, and what stands between them and a client.

#[path = "../../../../../tests/workbench/peers/folder.rs"]
mod folder;
#[path = "../../../../../tests/workbench/peers/line.rs"]
mod line;

use std::fs;
use std::net::TcpListener;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

pub use folder::Folder;
pub use line::Line;

/// What is asked of Mosquitto in the guide.
pub const SAFE: &str = "autosave_on_changes true\nautosave_interval 1\nmax_queued_messages 0\n";
/// What Debian's configuration has.
pub const DEBIAN: &str = "";

pub fn free_port() -> u16 {
    TcpListener::bind("127.0.0.1:0")
        .unwrap()
        .local_addr()
        .unwrap()
        .port()
}

/// Whether a program is there. Without it the test is skipped, or fails where servers are required.
pub fn has(program: &str) -> bool {
    let found = Command::new(program)
        .arg("-h")
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status();
    if found.is_ok() {
        return true;
    }
    let is_required = std::env::var("ATHERMAL_REQUIRE_SERVERS").is_ok_and(|of| of == "1");
    assert!(
        !is_required,
        "{program} is not installed, and ATHERMAL_REQUIRE_SERVERS=1 asks for it"
    );
    println!("skipped: {program} is not installed");
    false
}

/// A broker that can be killed and started again.
pub struct Broker {
    pub port: u16,
    pub folder: Folder,
    program: &'static str,
    child: Option<Child>,
}

impl Broker {
    /// Mosquitto with persistence and these lines in its configuration; none where it is not installed.
    pub fn mosquitto(lines: &str) -> Option<Self> {
        let mut broker = Self::mosquitto_down(lines)?;
        broker.start();
        Some(broker)
    }

    pub fn mosquitto_down(lines: &str) -> Option<Self> {
        if !has("mosquitto") {
            return None;
        }
        let (folder, port) = (Folder::new("broker"), free_port());
        let store = folder.0.display().to_string();
        let text = format!(
            "listener {port} 127.0.0.1\nallow_anonymous true\nuser root\npersistence true\npersistence_location {store}/\nlog_dest file {store}/log\n{lines}"
        );
        fs::write(folder.0.join("conf"), text).unwrap();
        Some(Self {
            port,
            folder,
            program: "mosquitto",
            child: None,
        })
    }

    /// The MQTT of a NATS server, which keeps sessions in JetStream. It writes what it acknowledges only where that is asked of it.
    pub fn nats(ack_wait: &str) -> Option<Self> {
        if !has("nats-server") {
            return None;
        }
        let (folder, port, client) = (Folder::new("nats"), free_port(), free_port());
        let store = folder.0.display().to_string();
        let text = format!(
            "server_name: one\nlisten: 127.0.0.1:{client}\njetstream {{ store_dir: \"{store}\", sync_interval: always }}\n\
             mqtt {{ listen: \"127.0.0.1:{port}\", ack_wait: \"{ack_wait}\", max_ack_pending: 10000 }}\n"
        );
        fs::write(folder.0.join("conf"), text).unwrap();
        let mut broker = Self {
            port,
            folder,
            program: "nats-server",
            child: None,
        };
        broker.start();
        Some(broker)
    }

    pub fn is_nats(&self) -> bool {
        self.program == "nats-server"
    }

    pub fn start(&mut self) {
        let mut command = Command::new(self.program);
        command.arg("-c").arg(self.folder.0.join("conf"));
        command.stdin(Stdio::null()).stdout(Stdio::null());
        self.child = Some(command.stderr(Stdio::null()).spawn().unwrap());
        let began = Instant::now();
        while crate::peer::Peer::connect(self.port, "probe", true).is_err() {
            assert!(
                began.elapsed() < Duration::from_secs(20),
                "the broker does not start"
            );
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// As `kill -9`.
    pub fn kill(&mut self) {
        if let Some(mut child) = self.child.take() {
            child.kill().unwrap();
            child.wait().unwrap();
        }
    }

    /// As systemd ends it.
    pub fn terminate(&mut self) {
        if let Some(mut child) = self.child.take() {
            let id = child.id().to_string();
            Command::new("kill").args(["-TERM", &id]).status().unwrap();
            child.wait().unwrap();
        }
    }

    /// Forgets all that it kept.
    pub fn forget(&self) {
        let _ = fs::remove_file(self.folder.0.join("mosquitto.db"));
    }
}

impl Drop for Broker {
    fn drop(&mut self) {
        self.kill();
    }
}

pub fn read(path: &Path) -> String {
    fs::read_to_string(path).unwrap_or_default()
}
