//! A server in a folder of its own, which can be killed and started again, and what stands between it and a client.

#[path = "../../../../../tests/workbench/peers/folder.rs"]
mod folder;
#[path = "../../../../../tests/workbench/peers/line.rs"]
mod line;

use std::io::{BufRead, BufReader, Write};
use std::net::TcpListener;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::{Value, json};

pub use folder::Folder;
pub use line::Line;

fn python() -> String {
    std::env::var("ATHERMAL_PYTHON").unwrap_or_else(|_| "python3".to_owned())
}

/// Who has made a server.
#[derive(Debug, Clone, Copy)]
pub enum Make {
    Asyncua,
    NodeOpcua,
}

impl Make {
    /// What runs it, and its script.
    fn command(self) -> (Command, &'static str) {
        match self {
            Self::Asyncua => (
                Command::new(python()),
                concat!(env!("CARGO_MANIFEST_DIR"), "/tests/plant/server.py"),
            ),
            Self::NodeOpcua => (
                Command::new("node"),
                concat!(env!("CARGO_MANIFEST_DIR"), "/tests/plant/server.js"),
            ),
        }
    }

    fn is_there(self) -> bool {
        let (option, text) = match self {
            Self::Asyncua => ("-c", "import asyncua"),
            Self::NodeOpcua => ("-e", "require('node-opcua')"),
        };
        let (mut command, _) = self.command();
        let found = command.args([option, text]).stderr(Stdio::null()).status();
        if found.is_ok_and(|of| of.success()) {
            return true;
        }
        let is_required = std::env::var("ATHERMAL_REQUIRE_SERVERS").is_ok_and(|of| of == "1");
        assert!(
            !is_required,
            "{self:?} is not installed, and ATHERMAL_REQUIRE_SERVERS=1 asks for it"
        );
        println!("skipped: {self:?} is not installed");
        false
    }
}

/// A server.
pub struct Plant {
    pub port: u16,
    make: Make,
    arguments: Vec<String>,
    child: Option<(Child, ChildStdin, BufReader<ChildStdout>)>,
}

impl Plant {
    /// One with these arguments; none where asyncua is not installed.
    pub fn start(arguments: &[&str]) -> Option<Self> {
        Self::of(Make::Asyncua, arguments)
    }

    /// One of a make; none where that is not installed.
    pub fn of(make: Make, arguments: &[&str]) -> Option<Self> {
        if !make.is_there() {
            return None;
        }
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let mut plant = Self {
            port: listener.local_addr().unwrap().port(),
            make,
            arguments: arguments.iter().map(|of| (*of).to_owned()).collect(),
            child: None,
        };
        drop(listener);
        plant.again(&[]);
        Some(plant)
    }

    /// Starts it, with more arguments, and waits until its nodes are there.
    pub fn again(&mut self, more: &[&str]) -> Instant {
        let (mut command, script) = self.make.command();
        let mut child = command
            .arg(script)
            .args(["--port", &self.port.to_string()])
            .args(&self.arguments)
            .args(more)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let (orders, answers) = (child.stdin.take().unwrap(), child.stdout.take().unwrap());
        self.child = Some((child, orders, BufReader::new(answers)));
        while self.answer().get("ready").is_none() {}
        Instant::now()
    }

    fn answer(&mut self) -> Value {
        let mut line = String::new();
        let read = self.child.as_mut().unwrap().2.read_line(&mut line).unwrap();
        assert!(read > 0, "the server has ended");
        serde_json::from_str(&line).unwrap_or_else(|_| json!({}))
    }

    /// Lets it do something.
    pub fn order(&mut self, order: &Value) -> Value {
        let orders = &mut self.child.as_mut().unwrap().1;
        writeln!(orders, "{order}").unwrap();
        self.answer()
    }

    pub fn write(&mut self, name: &str, value: impl Into<Value>) {
        self.order(&json!({ "do": "write", "name": name, "value": value.into() }));
    }

    pub fn add(&mut self, name: &str, kind: &str, value: impl Into<Value>) {
        let order = json!({ "do": "add", "name": name, "kind": kind, "value": value.into(), "writable": true });
        self.order(&order);
    }

    pub fn read(&mut self, name: &str) -> (f64, String) {
        let read = self.order(&json!({ "do": "read", "name": name }));
        (
            read["value"].as_f64().unwrap(),
            read["type"].as_str().unwrap().to_owned(),
        )
    }

    /// As `kill -9`.
    pub fn kill(&mut self) {
        if let Some((mut child, ..)) = self.child.take() {
            child.kill().unwrap();
            child.wait().unwrap();
        }
    }
}

impl Drop for Plant {
    fn drop(&mut self) {
        self.kill();
    }
}

/// Makes a certificate of a server in a folder: its path, without an ending.
pub fn certificate(folder: &Folder, kind: &str) -> String {
    let path = folder.0.join(kind).to_string_lossy().into_owned();
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/plant/server.py");
    let made = Command::new(python())
        .args([script, "--certify", kind, "--certificate", &path])
        .status();
    assert!(made.unwrap().success());
    path
}

/// Waits until something is true.
pub fn until(what: &str, within: Duration, mut is: impl FnMut() -> bool) -> Duration {
    let began = Instant::now();
    while !is() {
        assert!(
            began.elapsed() < within,
            "{what} takes longer than {within:?}"
        );
        std::thread::sleep(Duration::from_millis(10));
    }
    began.elapsed()
}
