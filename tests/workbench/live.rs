//! A run beside a machine, as a test is the machine and who looks after it. Decides nothing that is expected.

use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::time::{Duration, Instant};

/// A watched run of a graph with the one output `predicted.Z`, which is fed row by row while its files change.
pub struct Live {
    child: Child,
    rows: ChildStdin,
    out: BufReader<ChildStdout>,
    /// That of the last row.
    pub time: u32,
}

impl Live {
    /// One that begins with nothing.
    pub fn new(graph: &Path) -> Self {
        Self::going_on(graph, &[], 0)
    }

    /// One that begins at a time of its own.
    pub fn going_on(graph: &Path, more: &[&str], time: u32) -> Self {
        let mut child = Command::new(env!("CARGO_BIN_EXE_athermal"))
            .arg("run")
            .arg(graph)
            .args(["--input", "-", "--output", "-", "--watch"])
            .args(more)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut rows = child.stdin.take().unwrap();
        rows.write_all(b"time_s,Z\n").unwrap();
        let mut live = Self {
            rows,
            out: BufReader::new(child.stdout.take().unwrap()),
            child,
            time,
        };
        live.row();
        assert_eq!(live.line(), "time_s,predicted.Z,revision");
        live.line();
        live
    }

    /// Feeds a row.
    pub fn row(&mut self) {
        self.time += 10;
        writeln!(self.rows, "{},{}", self.time, self.time).unwrap();
        self.rows.flush().unwrap();
    }

    /// What comes of a row.
    pub fn line(&mut self) -> String {
        let mut line = String::new();
        self.out.read_line(&mut line).unwrap();
        line.trim_end().to_owned()
    }

    /// The revision that makes a row, which is fed.
    pub fn revision(&mut self) -> String {
        self.row();
        self.line().rsplit(',').next().unwrap().to_owned()
    }

    /// Feeds rows until another revision makes them.
    pub fn until_swapped(&mut self, before: &str) -> String {
        let began = Instant::now();
        while began.elapsed() < Duration::from_secs(60) {
            let now = self.revision();
            if now != before {
                return now;
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        panic!("revision {before} goes on");
    }

    /// Feeds rows for longer than its files are looked at twice, all of which this revision makes.
    #[track_caller]
    pub fn stays(&mut self, revision: &str) {
        let began = Instant::now();
        while began.elapsed() < Duration::from_millis(700) {
            assert_eq!(self.revision(), revision);
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// Ends it as a failure of power does, and gives the time of its last row.
    pub fn killed(mut self) -> u32 {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
        self.time
    }

    /// Ends its input, and gives what was told.
    pub fn told(self) -> String {
        drop(self.rows);
        let output = self.child.wait_with_output().unwrap();
        assert!(output.status.success());
        String::from_utf8(output.stderr).unwrap()
    }
}
