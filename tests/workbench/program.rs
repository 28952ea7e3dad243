//! The program as a user calls it. Decides nothing that is expected.

use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::Mutex;

/// What a call of the program left behind.
#[derive(Debug)]
pub struct Finished {
    pub status: i32,
    pub out: String,
    pub told: String,
}

impl Finished {
    /// The same, if the program ended with this status.
    #[track_caller]
    pub fn ended(self, status: i32) -> Self {
        assert_eq!(self.status, status, "{}\n{}", self.told, self.out);
        self
    }

    /// What was printed, as JSON.
    #[track_caller]
    pub fn json(&self) -> serde_json::Value {
        serde_json::from_str(&self.out).unwrap_or_else(|error| panic!("{error} in:\n{}", self.out))
    }

    /// Whether everything that a message should say is in it.
    #[track_caller]
    pub fn tells(&self, parts: &[&str]) {
        for part in parts {
            assert!(
                self.told.contains(part),
                "`{part}` is not in:\n{}",
                self.told
            );
        }
    }
}

fn command(arguments: &[&dyn AsRef<OsStr>]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_athermal"));
    command.args(arguments.iter().map(|argument| argument.as_ref()));
    command.env("SOURCE_DATE_EPOCH", "0");
    command
}

/// Calls the program.
pub fn athermal(arguments: &[&dyn AsRef<OsStr>]) -> Finished {
    athermal_fed(arguments, b"")
}

/// Calls a command for a graph or model and recorded data, with more arguments.
pub fn athermal_on(
    command: &str,
    graph: &Path,
    data: &Path,
    more: &[&dyn AsRef<OsStr>],
) -> Finished {
    let mut arguments: Vec<&dyn AsRef<OsStr>> = vec![&command, &graph, &"--data", &data];
    arguments.extend(more);
    athermal(&arguments)
}

/// Calls the program with something on its standard input.
pub fn athermal_fed(arguments: &[&dyn AsRef<OsStr>], input: &[u8]) -> Finished {
    let mut child = command(arguments)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut stdin = child.stdin.take().unwrap();
    let input = input.to_vec();
    let feeding = std::thread::spawn(move || {
        // A program that does not read all of its input is right to do so.
        let _ = stdin.write_all(&input);
    });
    let output = child.wait_with_output().unwrap();
    feeding.join().unwrap();
    Finished {
        status: output.status.code().unwrap(),
        out: String::from_utf8(output.stdout).unwrap(),
        told: String::from_utf8(output.stderr).unwrap(),
    }
}

/// Calls the program where nobody reads what it prints, as behind `| head -0`, and gives its status.
pub fn athermal_unread(arguments: &[&dyn AsRef<OsStr>]) -> i32 {
    let mut child = command(arguments)
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    child.wait().unwrap().code().unwrap()
}

/// The name of a folder, with a number where this process has used the name before: tests run at the same time.
fn unshared(name: &str) -> String {
    static USED: Mutex<BTreeMap<String, usize>> = Mutex::new(BTreeMap::new());
    let mut used = USED.lock().unwrap();
    let count = used.entry(name.to_owned()).or_default();
    *count += 1;
    match *count {
        1 => name.to_owned(),
        nth => format!("{name}-{nth}"),
    }
}

/// A folder for one test, empty at first.
pub struct Scratch(PathBuf);

impl Scratch {
    pub fn new(test: &str) -> Self {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR"))
            .join(env!("CARGO_CRATE_NAME"))
            .join(unshared(test));
        let _ = std::fs::remove_dir_all(&folder);
        std::fs::create_dir_all(&folder).unwrap();
        Self(folder)
    }

    /// The path of a file in it.
    pub fn path(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }

    /// Writes a file and gives its path.
    pub fn file(&self, name: &str, content: impl AsRef<[u8]>) -> PathBuf {
        let path = self.path(name);
        std::fs::write(&path, content).unwrap();
        path
    }
}

/// A fresh folder in which the program is called, as a user does; gone at the end.
pub struct Folder(pub PathBuf);

impl Folder {
    pub fn new(name: &str) -> Self {
        let name = format!("athermal-{}-{}", std::process::id(), unshared(name));
        let path = std::env::temp_dir().join(name);
        let _ = std::fs::remove_dir_all(&path);
        std::fs::create_dir_all(&path).unwrap();
        Self(path)
    }

    pub fn run(&self, arguments: &[&str]) -> Output {
        let mut command = Command::new(env!("CARGO_BIN_EXE_athermal"));
        command.args(arguments).current_dir(&self.0);
        command.output().unwrap()
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}
