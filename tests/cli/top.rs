//! `athermal top` in a terminal of tmux.

use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use crate::workbench::{Scratch, athermal};

const MACHINE: &str = r#"schema = 1
name = "line"
time = { column = "time_s", unit = "s" }
signals.temperature = { unit = "Cel", channels = ["plate", "room"], max_age = "3s" }
nodes.trend = { type = "slope", inputs.signal = "temperature", windows = ["2s"] }
nodes.state = { type = "stability", inputs.drift = "trend", stable_below = "3 K/min", transient_above = "9 K/min" }
outputs.trend = "trend"
outputs.state = "state"
[runtime]
wait = "0 s"
settle = "0 s"
[sources.log]
type = "replay"
path = "log.csv"
speed = 20
[alarms.hot]
of = "temperature.plate"
above = 19
text = "the plate is hot"
"#;

struct Ends(Child);

impl Drop for Ends {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// A terminal of so many columns and lines.
struct Screen(String);

impl Screen {
    fn new(scratch: &Scratch, width: u16, height: u16, command: &str) -> Option<Self> {
        let socket = scratch.path(&format!("tmux-{width}")).display().to_string();
        let screen = Self(socket);
        let size = [width, height].map(|of| of.to_string());
        let started = screen.tmux(&["new-session", "-d", "-x", &size[0], "-y", &size[1], command]);
        if started.is_none() {
            assert!(
                std::env::var("ATHERMAL_REQUIRE_SERVERS").is_err(),
                "tmux is not installed"
            );
            eprintln!("skipped: tmux is not installed");
        }
        started.map(|_| screen)
    }

    fn tmux(&self, arguments: &[&str]) -> Option<String> {
        let out = Command::new("tmux")
            .args(["-S", &self.0])
            .args(arguments)
            .output()
            .ok()?;
        out.status
            .success()
            .then(|| String::from_utf8_lossy(&out.stdout).into_owned())
    }

    fn until(&self, what: &str, holds: impl Fn(&str) -> bool) -> String {
        let began = Instant::now();
        loop {
            let text = self.tmux(&["capture-pane", "-p"]).unwrap_or_default();
            if holds(&text) {
                return text;
            }
            assert!(began.elapsed() < Duration::from_secs(30), "{what}:\n{text}");
            std::thread::sleep(Duration::from_millis(100));
        }
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        let _ = self.tmux(&["kill-server"]);
    }
}

#[test]
fn a_service_is_seen_in_terminals_of_two_sizes_and_nothing_outlives_it() {
    let scratch = Scratch::new("top");
    let rows = (0..100_000).map(|nth| {
        format!(
            "{}.{},{},21.{}\n",
            nth / 10,
            nth % 10,
            20.0 + f64::from(nth) / 600.0,
            nth % 7
        )
    });
    scratch.file(
        "log.csv",
        "time_s,plate,room\n".to_owned() + &rows.collect::<String>(),
    );
    let machine = scratch.file("line.toml", MACHINE);
    let mut command = Command::new(env!("CARGO_BIN_EXE_athermal"));
    command
        .arg("serve")
        .arg(&machine)
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    let mut service = Ends(command.spawn().unwrap());
    let began = Instant::now();
    while athermal(&[&"status", &machine]).out.is_empty() {
        assert!(began.elapsed() < Duration::from_secs(20));
    }
    let top = format!(
        "{} top {}",
        env!("CARGO_BIN_EXE_athermal"),
        machine.display()
    );
    let Some(small) = Screen::new(&scratch, 80, 24, &top) else {
        return;
    };
    let large = Screen::new(&scratch, 200, 50, &top).unwrap();
    let mut lines = Vec::new();
    for (screen, height) in [(&small, 24), (&large, 50)] {
        let seen = |text: &str| {
            let all = [
                "line  running",
                "plate drifts 1.0 K/min; stable for",
                "may measure: yes",
                "temperature.room",
                "raised hot",
                "q end",
            ];
            all.iter().all(|of| text.contains(of))
                && text.contains('⠤') | text.contains('⠒') | text.contains('⣀') | text.contains('⠉')
        };
        let text = screen.until("a picture", seen);
        assert_eq!(text.lines().count(), height, "{text}");
        lines.push(text);
    }
    println!("{}\n{}", lines[0], lines[1]);
    small.tmux(&["send-keys", "a"]);
    small.until("that it is acknowledged", |text| {
        text.contains("acknowledged hot")
    });
    small.tmux(&["send-keys", "Right"]);
    small.until("the other axis", |text| {
        text.contains(" room, ") && text.contains("▶")
    });
    service.0.kill().unwrap();
    service.0.wait().unwrap();
    for screen in [&small, &large] {
        screen.until("that it is lost", |text| {
            text.contains("connection lost since")
                && text.contains("plate: not known")
                && !text.contains("may measure: yes")
        });
    }
    small.tmux(&["send-keys", "q"]);
    let began = Instant::now();
    while small.tmux(&["has-session"]).is_some() {
        assert!(began.elapsed() < Duration::from_secs(10), "it does not end");
        std::thread::sleep(Duration::from_millis(50));
    }
    let lost = athermal(&[&"top", &machine]).ended(3);
    assert!(!lost.told.is_empty());
}
