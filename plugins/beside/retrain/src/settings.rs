//! `[retrain]`: when a service fits anew, and what becomes of it.

use std::io;
use std::process::{Child, Command, Stdio};
use std::thread::JoinHandle;
use std::time::{Duration as Wait, Instant as Clock};

use athermal_core::time::Duration;
use athermal_serve::companion::{Beside, Companion};
use athermal_serve::connector::{ConnectorError, Stop};
use athermal_serve::service::{NoAnswer, ServiceHandle};
use schemars::JsonSchema;
use serde::Deserialize;
use serde_json::Value;

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
/// How long a fit may take.
const LONGEST: Wait = Wait::from_secs(6 * 3_600);
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
        let failed = |error| ConnectorError::new(format_args!("[retrain] {error}"));
        let thread = Some(thread.map_err(failed)?);
        Ok(Box::new(Running { stop, thread }))
    }
}

/// Until this is dropped. A fit under way is ended then.
struct Running {
    stop: Stop,
    thread: Option<JoinHandle<()>>,
}

impl Drop for Running {
    fn drop(&mut self) {
        self.stop.ask();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

impl Retrain {
    /// Runs the process, unless learning is frozen, and notes how it ended.
    fn retrain(&self, beside: &Beside, stop: &Stop) {
        let frozen = beside
            .handle
            .ask(PATIENCE, |service| service.running().map(|of| of.frozen));
        if let Some(reason) = reason_against(frozen) {
            return note(&beside.handle, format!("retrain: {reason}"));
        }
        let began = Clock::now();
        let ended = self
            .spawn(beside)
            .and_then(|child| wait(child, stop, LONGEST));
        let words = match ended {
            Ok((status, answer)) => outcome(status, &answer),
            Err(error) => format!("the fit could not be made: {error}"),
        };
        let took = began.elapsed().as_secs();
        note(&beside.handle, format!("retrain: after {took} s, {words}"));
    }

    fn spawn(&self, beside: &Beside) -> io::Result<Child> {
        let mut command = modest(self.memory_mb.unwrap_or(2_000));
        command
            .arg(std::env::current_exe()?)
            .args(["retrain", "--format", "json"])
            .arg(&beside.machine)
            .arg("--state")
            .arg(&beside.state)
            .args(["--on", &self.on.unwrap_or(ON).to_string()])
            .args(["--shadow", &self.shadow.unwrap_or(SHADOW).to_string()])
            .args(["--margin", &format!("{}e2%", self.margin)])
            .stdin(Stdio::null())
            .stdout(Stdio::piped());
        if self.commit {
            command.arg("--commit");
        }
        command.spawn()
    }
}

/// A process with little priority and bounded memory, which the system ends before others.
fn modest(megabytes: u64) -> Command {
    let script = format!(
        "echo 1000 2>/dev/null >/proc/self/oom_score_adj; ulimit -v {megabytes}000; \
         command -v ionice >/dev/null && set -- ionice -c 3 \"$@\"; exec nice -n 19 \"$@\""
    );
    let mut command = Command::new("/bin/sh");
    command.args(["-c", &script, "sh"]);
    command
}

/// Why nothing is fitted now; none where something may be. `frozen` is whether what runs is.
fn reason_against(frozen: Result<Option<bool>, NoAnswer>) -> Option<String> {
    match frozen {
        Ok(Some(false)) => None,
        Ok(Some(true)) => Some("not while learning is frozen".to_owned()),
        Ok(None) => Some("what runs is not known, since ticks were missed".to_owned()),
        Err(error) => Some(format!("nothing is fitted: {error}")),
    }
}

/// Waits for a process, which is ended with the service, and where it takes too long: its status, and what it answers.
fn wait(mut child: Child, stop: &Stop, longest: Wait) -> io::Result<(i32, String)> {
    let began = Clock::now();
    // Read beside, so that the process never waits for its reader.
    let read = |out| std::thread::spawn(move || io::read_to_string(out).unwrap_or_default());
    let answer = child.stdout.take().map(read);
    let status = loop {
        if let Some(status) = child.try_wait()? {
            break status.code().unwrap_or(-1);
        }
        let is_late = began.elapsed() > longest;
        if is_late || !stop.wait(Wait::from_millis(200)) {
            child.kill()?;
            child.wait()?;
            if is_late {
                let words = format!("it took longer than {} s, and was ended", longest.as_secs());
                return Err(io::Error::other(words));
            }
            break -1;
        }
    };
    let answer = answer.and_then(|answer| answer.join().ok());
    Ok((status, answer.unwrap_or_default()))
}

/// What came of the process, with the reason that it gives.
fn outcome(status: i32, answer: &str) -> String {
    let answer: Value = serde_json::from_str(answer).unwrap_or_default();
    let reason = answer["reason"].as_str().or(answer["error"].as_str());
    let reason = reason.map_or_else(String::new, |of| format!(": {of}"));
    match status {
        0 => "a fit is proposed".to_owned(),
        1 => format!("nothing is proposed{reason}"),
        status => format!("the fit ended with {status}{reason}"),
    }
}

fn note(handle: &ServiceHandle, words: String) {
    let _ = handle.ask(PATIENCE, move |service| service.note(&words));
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What comes of a process that answers so, and ends with a status.
    fn ended(answer: &str, status: i32) -> String {
        let mut command = modest(2_000);
        command.args(["sh", "-c", "printf %s \"$1\"; exit $2", "sh", answer]);
        let child = command.arg(status.to_string()).stdout(Stdio::piped());
        let (status, answer) = wait(child.spawn().unwrap(), &Stop::default(), LONGEST).unwrap();
        outcome(status, &answer)
    }

    #[test]
    fn the_journal_has_the_reason_why_nothing_is_proposed() {
        let refusal = r#"{ "proposed": null, "reason": "sensors are broken in the data" }"#;
        assert_eq!(
            ended(refusal, 1),
            "nothing is proposed: sensors are broken in the data"
        );
        let refused = r#"{ "error": "nothing is staged" }"#;
        assert_eq!(ended(refused, 2), "the fit ended with 2: nothing is staged");
        assert_eq!(ended("", 3), "the fit ended with 3");
        assert_eq!(
            ended(r#"{ "proposed": "it.json" }"#, 0),
            "a fit is proposed"
        );
        // An answer that is longer than a pipe holds.
        let long = format!(r#"{{ "reason": "{}" }}"#, "sensor ".repeat(15_000));
        assert!(ended(&long, 1).len() > 100_000);
    }

    #[test]
    fn frozen_nothing_running_and_no_answer_are_reasons_of_their_own() {
        assert_eq!(reason_against(Ok(Some(false))), None);
        let reasons = [
            Ok(Some(true)),
            Ok(None),
            Err(NoAnswer::Busy),
            Err(NoAnswer::TooLate),
        ];
        let reasons: std::collections::BTreeSet<_> =
            reasons.into_iter().filter_map(reason_against).collect();
        assert_eq!(reasons.len(), 4, "{reasons:?}");
    }

    #[test]
    fn a_fit_has_the_least_priority_bounded_memory_and_is_ended_by_the_system_before_others() {
        let mut command = modest(300);
        let script =
            "nice; ulimit -v; cat /proc/self/oom_score_adj; ionice 2>/dev/null || echo idle";
        let out = command.args(["sh", "-c", script]).output().unwrap();
        let out = String::from_utf8_lossy(&out.stdout);
        assert_eq!(out.trim_end(), "19\n300000\n1000\nidle");
        // More than that it is not given.
        let mut command = modest(300);
        let out = command.args(["sh", "-c", "head -c 400m /dev/zero | tail | wc -c"]);
        assert_eq!(
            String::from_utf8_lossy(&out.output().unwrap().stdout),
            "0\n"
        );
    }

    #[test]
    fn a_fit_that_takes_too_long_is_ended() {
        let child = modest(300).args(["sleep", "60"]).spawn().unwrap();
        let id = child.id();
        let ended = wait(child, &Stop::default(), Wait::from_millis(300));
        let words = ended.unwrap_err().to_string();
        assert!(words.contains("longer than 0 s"), "{words}");
        assert!(!std::path::Path::new(&format!("/proc/{id}")).exists());
    }

    #[test]
    fn a_fit_under_way_is_over_when_the_service_is() {
        let stop = Stop::default();
        let stopped = stop.clone();
        let (tell, ended) = std::sync::mpsc::channel();
        let thread = std::thread::spawn(move || {
            let mut command = modest(2_000);
            let child = command.args(["sleep", "60"]).stdout(Stdio::piped()).spawn();
            let child = child.unwrap();
            let id = child.id();
            let status = wait(child, &stopped, LONGEST).unwrap().0;
            tell.send((id, status)).unwrap();
        });
        let thread = Some(thread);
        drop(Running { stop, thread });
        let (id, status) = ended.try_recv().unwrap();
        assert_eq!(status, -1);
        assert!(!std::path::Path::new(&format!("/proc/{id}")).exists());
    }
}
