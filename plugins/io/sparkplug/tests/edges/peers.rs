//! A broker and edge nodes, which can be killed and started again.

#[path = "../../../../../tests/workbench/peers/folder.rs"]
mod folder;

use std::io::{BufRead, BufReader, Write};
use std::net::{TcpListener, TcpStream};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::{Value, json};

pub use folder::Folder;

/// Who has made an edge node.
#[derive(Debug, Clone, Copy)]
pub enum Make {
    /// `mqtt-spb-wrapper`.
    Wrapper,
    /// `sparkplug-client`.
    Client,
}

impl Make {
    fn command(self) -> Command {
        let python = || std::env::var("ATHERMAL_PYTHON").unwrap_or_else(|_| "python3".to_owned());
        match self {
            Self::Wrapper => Command::new(python()),
            Self::Client => Command::new("node"),
        }
    }

    fn is_there(self) -> bool {
        let (option, text) = match self {
            Self::Wrapper => ("-c", "import mqtt_spb_wrapper"),
            Self::Client => ("-e", "require('sparkplug-client')"),
        };
        let mut command = self.command();
        let asked = command.args([option, text]).stderr(Stdio::null()).status();
        asked.is_ok_and(|of| of.success())
    }
}

/// What ends with the test.
struct Running(Child);

impl Running {
    fn kill(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        self.kill();
    }
}

/// Mosquitto.
pub struct Broker {
    pub port: u16,
    running: Option<Running>,
}

impl Broker {
    /// One that runs; none where it is not installed, or edge nodes of this make are not.
    pub fn start(make: Make) -> Option<Self> {
        let is_there = make.is_there() && Command::new("mosquitto").arg("-h").output().is_ok();
        let is_required = std::env::var("ATHERMAL_REQUIRE_SERVERS").is_ok_and(|of| of == "1");
        assert!(
            is_there || !is_required,
            "mosquitto or {make:?} is not installed, and ATHERMAL_REQUIRE_SERVERS=1 asks for it"
        );
        if !is_there {
            println!("skipped: mosquitto or {make:?} is not installed");
            return None;
        }
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let mut broker = Self {
            port: listener.local_addr().unwrap().port(),
            running: None,
        };
        drop(listener);
        broker.again();
        Some(broker)
    }

    pub fn again(&mut self) {
        let mut command = Command::new("mosquitto");
        let command = command.args(["-p", &self.port.to_string()]);
        let child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn();
        self.running = Some(Running(child.unwrap()));
        until("the broker", || {
            TcpStream::connect(("127.0.0.1", self.port)).is_ok()
        });
    }

    pub fn kill(&mut self) {
        self.running = None;
    }
}

/// An edge node.
pub struct Edge {
    running: Running,
    orders: ChildStdin,
    answers: BufReader<ChildStdout>,
}

impl Edge {
    pub fn start(make: Make, port: u16, arguments: &[&str]) -> Self {
        let script = match make {
            Make::Wrapper => concat!(env!("CARGO_MANIFEST_DIR"), "/tests/edges/edge.py"),
            Make::Client => concat!(env!("CARGO_MANIFEST_DIR"), "/tests/edges/edge.js"),
        };
        let mut command = make.command();
        command.args([script, &port.to_string()]).args(arguments);
        let command = command.stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut child = command.stderr(Stdio::null()).spawn().unwrap();
        let (orders, answers) = (child.stdin.take().unwrap(), child.stdout.take().unwrap());
        let mut edge = Self {
            running: Running(child),
            orders,
            answers: BufReader::new(answers),
        };
        edge.hear("ready");
        edge
    }

    fn line(&mut self) -> String {
        let mut line = String::new();
        let read = self.answers.read_line(&mut line).unwrap();
        assert!(read > 0, "the edge node has ended");
        line.trim().to_owned()
    }

    /// Waits for a word.
    pub fn hear(&mut self, word: &str) {
        while self.line() != word {}
    }

    /// Lets it do something, and gives its answer.
    pub fn order(&mut self, order: &Value) -> Value {
        writeln!(self.orders, "{order}").unwrap();
        loop {
            if let Ok(answer @ Value::Object(_)) = serde_json::from_str(&self.line()) {
                return answer;
            }
        }
    }

    /// Publishes a value of `T`.
    pub fn publish(&mut self, value: f64) {
        self.order(&json!({ "do": "data", "value": value }));
    }

    pub fn kill(&mut self) {
        self.running.kill();
    }
}

pub fn until(what: &str, mut is: impl FnMut() -> bool) {
    let began = Instant::now();
    while !is() {
        assert!(
            began.elapsed() < Duration::from_secs(30),
            "{what} takes too long"
        );
        std::thread::sleep(Duration::from_millis(20));
    }
}
