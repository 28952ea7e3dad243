//! `[retrain]`: when a service fits anew, and what becomes of it.

use std::process::{Child, Command, Stdio};
use std::time::{Duration as Wait, Instant as Clock};

use athermal_core::time::Duration;
use athermal_serve::companion::{Beside, Companion};
use athermal_serve::connector::{ConnectorError, Stop};
use athermal_serve::service::ServiceHandle;
use schemars::JsonSchema;
use serde::Deserialize;

/// How long the service may take to answer.
const PATIENCE: Wait = Wait::from_secs(10);

/// When a service fits anew from its journal. Without the section it does not.
#[derive(Debug, Clone, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Retrain {
    /// How often.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub every: Option<Duration>,
    /// On how much of the past; 14 d without.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub on: Option<Duration>,
    /// How long the new fit is compared with what runs; 30 min without.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub shadow: Option<Duration>,
    /// By how much its error may be larger: 0.05 for 5 %; not at all without.
    #[schemars(range(min = 0))]
    pub margin: f64,
    /// Whether it takes over by itself where it is no worse. Without it is proposed, and `athermal commit` lets it.
    pub commit: bool,
    /// How much memory the fit may take, in MB; 2,000 without.
    #[schemars(range(min = 100))]
    pub memory_mb: Option<u64>,
}

/// The usual values of keys that need not be given.
pub const ON: Duration = Duration::from_ns(14 * 86_400_000_000_000);
/// As of [`ON`].
pub const SHADOW: Duration = Duration::from_ns(30 * 60_000_000_000);

impl Companion for Retrain {
    fn start(&self, beside: &Beside) -> Result<Box<dyn Send>, ConnectorError> {
        let Some(every) = self.every else {
            return Ok(Box::new(()));
        };
        let every = Wait::from_nanos(every.as_ns().max(1) as u64);
        let stop = Stop::default();
        let (settings, beside, stopped) = (self.clone(), beside.clone(), stop.clone());
        let thread = std::thread::Builder::new().name("retrain".to_owned());
        let thread = thread.spawn(move || {
            while stopped.wait(every) {
                settings.retrain(&beside, &stopped);
            }
        });
        thread.map_err(|error| ConnectorError::new(format_args!("[retrain] {error}")))?;
        Ok(Box::new(Running(stop)))
    }
}

/// Until this is dropped.
struct Running(Stop);

impl Drop for Running {
    fn drop(&mut self) {
        self.0.ask();
    }
}

impl Retrain {
    /// Runs the process, unless learning is frozen, and notes how it ended.
    fn retrain(&self, beside: &Beside, stop: &Stop) {
        let frozen = beside.handle.ask(PATIENCE, |service| {
            service
                .running()
                .is_none_or(athermal_core::engine::Engine::frozen)
        });
        if frozen != Ok(false) {
            return note(
                &beside.handle,
                "retrain: not while learning is frozen".to_owned(),
            );
        }
        let began = Clock::now();
        let ended = self
            .spawn(beside)
            .and_then(|mut child| wait(&mut child, stop));
        let words = match ended {
            Ok(0) => "retrain: proposed".to_owned(),
            Ok(1) => "retrain: nothing is proposed".to_owned(),
            Ok(status) => format!("retrain: the fit ended with {status}"),
            Err(error) => format!("retrain: the fit could not be made: {error}"),
        };
        let took = began.elapsed().as_secs();
        note(&beside.handle, format!("{words}, after {took} s"));
    }

    /// A process with little priority and bounded memory.
    fn spawn(&self, beside: &Beside) -> std::io::Result<Child> {
        let kilobytes = self.memory_mb.unwrap_or(2_000) * 1_000;
        let script = format!(
            "ulimit -v {kilobytes}; command -v ionice >/dev/null && set -- ionice -c 3 \"$@\"; exec nice -n 19 \"$@\""
        );
        let mut command = Command::new("/bin/sh");
        command
            .args(["-c", &script, "sh"])
            .arg(std::env::current_exe()?)
            .arg("retrain")
            .arg(&beside.machine)
            .arg("--state")
            .arg(&beside.state)
            .args(["--on", &self.on.unwrap_or(ON).to_string()])
            .args(["--shadow", &self.shadow.unwrap_or(SHADOW).to_string()])
            .args(["--margin", &self.margin.to_string()])
            .stdin(Stdio::null())
            .stdout(Stdio::null());
        if self.commit {
            command.arg("--commit");
        }
        command.spawn()
    }
}

/// Waits for a process, which is ended with the service.
fn wait(child: &mut Child, stop: &Stop) -> std::io::Result<i32> {
    loop {
        if let Some(status) = child.try_wait()? {
            return Ok(status.code().unwrap_or(-1));
        }
        if !stop.wait(Wait::from_millis(200)) {
            child.kill()?;
            child.wait()?;
            return Ok(-1);
        }
    }
}

fn note(handle: &ServiceHandle, words: String) {
    let _ = handle.ask(PATIENCE, move |service| service.note(&words));
}
